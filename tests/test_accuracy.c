/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench accuracy in parts: shards and their table, a run that was killed and goes on, and
 * files that do not belong together. On the quickest scene. HAPODE_BENCH: path of the program,
 * HAPODE_SOURCE: of the sources, for the job files. */

#include "tests/files.h"
#include "tests/tap.h"

#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#define PATH_LENGTH 512
#define WHAT "--quick --scene topple"

/* Exit code of a shell's command; what it says goes to FOLDER/said. In the command $B is the
 * program, $F the folder and $S the sources. */
static int shell_run(const char *format, ...)
{
  char command[2048];
  char whole[3072];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(command, sizeof command, format, arguments);
  va_end(arguments);
  snprintf(whole, sizeof whole,
           "B=\"$HAPODE_BENCH\" S=\"$HAPODE_SOURCE\" F=%s; {\n%s\n} >%s/said 2>&1", test_folder,
           command, test_folder);
  int result = system(whole);
  return WIFEXITED(result) ? WEXITSTATUS(result) : -1;
}

/* Whole ones. */
static int count_lines(const char *name)
{
  int lines = 0;
  for (const char *c = file_text(folder_path(name)); *c != '\0'; ++c) {
    lines += *c == '\n';
  }
  return lines;
}

static bool shell_said(const char *part)
{
  const char *text = file_text(folder_path("said"));
  bool has = strstr(text, part) != NULL;
  if (!has) {
    printf("# not \"%s\" but: %.600s\n", part, text);
  }
  return has;
}

/* That two tables have the same rows but for what a clock says: up to peak_ratio, and from
 * haptic_hz to lines, which is the last column but the front's. */
static void check_same_rows(const char *a, const char *b)
{
  CHECK(shell_run("cut -d, -f1-8,12-27 $F/%s >$F/a.cut && cut -d, "
                  "-f1-8,12-27 $F/%s >$F/b.cut && cmp $F/a.cut $F/b.cut",
                  a, b) == 0);
  CHECK(count_lines(a) > 30 && count_lines(a) == count_lines(b));
}

/* ---- shards ---- */

TEST(shards_of_the_slurm_file_make_the_table)
{
  for (int shard = 1; shard <= 2; ++shard) {
    REQUIRE(
        shell_run("HAPODE_BENCH=$B HAPODE_OUT=$F/s SLURM_ARRAY_TASK_ID=%d SLURM_ARRAY_TASK_COUNT=2 "
                  "sh $S/bench/jobs/accuracy.slurm " WHAT,
                  shard) == 0);
    CHECK(shell_said("is done"));
    CHECK(!file_exists(folder_path("s/accuracy.csv")));
  }
  CHECK(shell_run("env -u SLURM_ARRAY_TASK_ID sh $S/bench/jobs/accuracy.slurm") != 0);
  CHECK(shell_said("submit it as an array"));
  REQUIRE(shell_run("$B accuracy --merge $F/s/accuracy-1-of-2.rows $F/s/accuracy-2-of-2.rows --out "
                    "$F/s") == 0);
  CHECK(shell_said("topple: the default is "));
  CHECK(count_lines("s/accuracy.csv") > 40);
  CHECK(file_exists(folder_path("s/accuracy-1-of-2.rows")) &&
        file_exists(folder_path("s/accuracy-2-of-2.rows")));
}

TEST(shards_under_parallel_make_the_same_table)
{
  if (shell_run("command -v parallel") != 0) {
    SKIP("needs GNU parallel");
  }
  REQUIRE(shell_run("HAPODE_BENCH=$B HAPODE_OUT=$F/p $S/bench/jobs/accuracy-parallel 3 " WHAT) ==
          0);
  check_same_rows("s/accuracy.csv", "p/accuracy.csv");
}

TEST(a_shard_that_is_done_is_not_done_again)
{
  REQUIRE(file_exists(folder_path("s/accuracy-1-of-2.rows")));
  CHECK(shell_run("cp $F/s/accuracy-1-of-2.rows $F/kept; $B accuracy " WHAT
                  " --shard 1/2 --out $F/s && cmp $F/kept $F/s/accuracy-1-of-2.rows") == 0);
}

/* There are fewer references than shards. */
TEST(a_shard_may_have_nothing_to_do)
{
  REQUIRE(shell_run("$B accuracy " WHAT " --shard 50/50 --out $F/n") == 0);
  CHECK(count_lines("n/accuracy-50-of-50.rows") == 6); /* a head alone */
}

TEST(files_that_do_not_belong_together_are_refused)
{
  static const struct {
    const char *files;
    const char *says;
  } cases[] = {
      {"$F/s/accuracy-1-of-2.rows", "shard 2 of 2 is missing"},
      {"$F/s/accuracy-1-of-2.rows $F/s/accuracy-2-of-2.rows $F/s/accuracy-1-of-2.rows",
       "shard 1 of 2 is there twice"},
      {"$F/s/accuracy-1-of-2.rows $F/other", "different builds"},
      {"$F/s/accuracy-1-of-2.rows $F/three", "different numbers of shards"},
      {"$F/s/accuracy-1-of-2.rows $F/quick", "different settings"},
      {"$F/s/accuracy-1-of-2.rows $F/short", "1 rows are missing: shard 2/2 has not ended"},
      {"$F/s/accuracy-1-of-2.rows $F/swapped", "are of another shard than 2/2"},
      {"$F/s/accuracy-1-of-2.rows $F/torn", "rows are missing"},
      {"$F/s/accuracy-1-of-2.rows $F/garbage", "line 9 is no row"},
      {"$F/s/accuracy-1-of-2.rows $F/double", "is there twice"},
      {"$F/s/accuracy.csv", "not a file of finished rows"},
      {"$F/nothing", "No such file"},
  };
  REQUIRE(shell_run("cd $F; a=s/accuracy-2-of-2.rows; sed '2s/: .*/: 0/' $a >other; "
                    "sed '5s/2$/3/' $a >three; sed '3s/quick/full/' $a >quick; sed '$d' $a >short; "
                    "sed '5s/1/2/' s/accuracy-1-of-2.rows >swapped; head -c -20 $a >torn; "
                    "sed '9s/,/;/' $a >garbage; sed '9p' $a >double") == 0);
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    CHECK(shell_run("$B accuracy --merge %s --out $F/m", cases[i].files) == 1);
    CHECK(shell_said(cases[i].says));
    CHECK(!file_exists(folder_path("m/accuracy.csv")));
  }
}

TEST(wrong_parts_are_usage)
{
  static const struct {
    const char *arguments;
    const char *says;
  } cases[] = {
      {"accuracy --shard 0/2", "1 <= K <= N"},
      {"accuracy --shard 3/2", "1 <= K <= N"},
      {"accuracy --shard 1", "1 <= K <= N"},
      {"accuracy --shard 1/2x", "1 <= K <= N"},
      {"accuracy --shard -1/2", "1 <= K <= N"},
      {"accuracy --shard 1/20000", "1 <= K <= N"},
      {"accuracy --merge", "needs the files"},
      {"fig5 --shard 1/2", "are for accuracy"},
      {"accuracy --merge a --quick", "from its files"},
      {"tick --fresh", "are for accuracy"},
      {"accuracy --coupling nope", "takes --coupling proxy"},
      {"tick --coupling proxy", "for accuracy and impedance"},
      {"accuracy --estimates some", "takes --estimates all or default"},
      {"fig5 --estimates all", "for accuracy"},
      {"accuracy --merge a --estimates all", "from its files"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    CHECK(shell_run("$B %s", cases[i].arguments) == 2);
    CHECK(shell_said(cases[i].says));
  }
}

/* ---- a run that is killed ---- */

static pid_t begin_run(void)
{
  char program[PATH_LENGTH];
  char out[PATH_LENGTH];
  char words[6][16] = {"accuracy", "--quick", "--scene", "topple", "--out"};
  snprintf(program, sizeof program, "%s", getenv("HAPODE_BENCH"));
  snprintf(out, sizeof out, "%s/k", test_folder);
  char *argv[] = {program, words[0], words[1], words[2], words[3], words[4], out, NULL};
  pid_t child = -1;
  return posix_spawn(&child, program, NULL, NULL, argv, environ) == 0 ? child : -1;
}

TEST(a_run_that_is_killed_goes_on_where_it_was)
{
  pid_t child = begin_run();
  REQUIRE(child > 0);
  for (int i = 0; i < 20000 && count_lines("k/accuracy.rows") < 6 + 8; ++i) {
    usleep(5000);
  }
  CHECK(kill(child, SIGKILL) == 0 && waitpid(child, NULL, 0) == child);
  int there = count_lines("k/accuracy.rows") - 6;
  REQUIRE(there >= 8 && !file_exists(folder_path("k/accuracy.csv")));
  /* in the middle of a row, as it may be */
  REQUIRE(
      shell_run("printf 'topple,contact,20' >>$F/k/accuracy.rows; cp $F/k/accuracy.rows $F/kept") ==
      0);
  REQUIRE(shell_run("$B accuracy " WHAT " --out $F/k") == 0);
  CHECK(shell_said("goes on from "));
  CHECK(!file_exists(folder_path("k/accuracy.rows")));
  check_same_rows("s/accuracy.csv", "k/accuracy.csv");
  /* what was finished was not measured again: its times are the same */
  CHECK(shell_run(
            "sed 1,6d $F/kept | sed '$d' | cut -d, -f1-11 | while read row; do grep -qF \"$row\" "
            "$F/k/accuracy.csv || exit 1; done") == 0);
}

TEST(rows_of_another_build_or_setting_are_kept_and_told)
{
  REQUIRE(shell_run("mkdir -p $F/o; sed '2s/: .*/: 0/' $F/kept >$F/o/accuracy.rows; cp "
                    "$F/o/accuracy.rows $F/before") == 0);
  CHECK(shell_run("$B accuracy " WHAT " --out $F/o") == 1);
  CHECK(shell_said("another build") && shell_said("--fresh"));
  CHECK(shell_run("cmp $F/o/accuracy.rows $F/before") == 0);
  CHECK(shell_run("cp $F/kept $F/o/accuracy.rows; $B accuracy --quick --scene hit --out $F/o") ==
        1);
  CHECK(shell_said("other settings"));
  CHECK(shell_run("echo nothing >$F/o/accuracy.rows; $B accuracy " WHAT " --out $F/o") == 1);
  CHECK(shell_said("not a file of finished rows"));
}

SET_UP
{
  return getenv("HAPODE_BENCH") != NULL && getenv("HAPODE_SOURCE") != NULL
             ? folder_make()
             : tap_skip_all("needs HAPODE_BENCH and HAPODE_SOURCE");
}
