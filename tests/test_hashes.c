/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The program hapode-hashes: the same bits in each run, whatever the heap gives, and a file that is
 * not of these bits is found out. HAPODE_HASHES: path of the program. */

#include "tests/program.h"
#include "tests/tap.h"

#define HANDFUL "--quick --seeds 1-12 --only "

static const char *const handful[] = {"lever", "lightstand", "cross=on",
                                      "storm", "random",     "lookback"};

/* In a file of the folder; the number of lines. */
static int hash_into(const char *file, const char *only, const char *more)
{
  CHECK(run(HANDFUL "%s %s", only, more) == 0);
  file_write(folder_path(file), ran.out);
  return lines_with(ran.out, "  ");
}

static bool is_same_as(const char *file, const char *only, const char *more)
{
  int code = run(HANDFUL "%s %s --compare %s", only, more, folder_path(file));
  if (code != 0) {
    printf("# %s %s\n# %.1000s", only, more, ran.out);
  }
  return code == 0;
}

TEST(every_run_has_the_same_bits)
{
  for (size_t i = 0; i < sizeof handful / sizeof handful[0]; ++i) {
    CHECK(hash_into("plain", handful[i], "") > 0);
    CHECK(is_same_as("plain", handful[i], ""));
  }
}

TEST(whatever_addresses_the_heap_gives)
{
  for (size_t i = 0; i < sizeof handful / sizeof handful[0]; ++i) {
    (void)hash_into("plain", handful[i], "");
    CHECK(is_same_as("plain", handful[i], "--heap 1"));
    CHECK(is_same_as("plain", handful[i], "--heap 2"));
  }
  (void)hash_into("plain", "random", "");
  setenv("GLIBC_TUNABLES", "glibc.malloc.tcache_count=0", 1);
  CHECK(is_same_as("plain", "random", ""));
  unsetenv("GLIBC_TUNABLES");
}

/* In program 8125 a geom comes with the address of one that is gone, while the loop still tells the
 * friction of the contact with the old one. */
TEST(a_new_geom_has_no_friction_of_the_one_whose_address_it_has)
{
  CHECK(run("--only random --seeds 8125-8125") == 0 && lines_with(ran.out, "random 8125") == 1);
  file_write(folder_path("program"), ran.out);
  for (int heap = 1; heap <= 6; ++heap) {
    CHECK(run("--only random --seeds 8125-8125 --heap %d --compare %s", heap,
              folder_path("program")) == 0);
  }
}

/* In another order of addresses, with and without those that come again at once. */
TEST(twenty_thousand_random_programs)
{
  if (strcmp(tap_argument, "long") != 0) {
    SKIP("takes an hour; argument long");
  }
  for (int seed = 1; seed <= 20000; seed += 250) {
    CHECK(run("--only random --seeds %d-%d", seed, seed + 249) == 0);
    CHECK(lines_with(ran.out, "random") == 250);
    file_write(folder_path("programs"), ran.out);
    CHECK(run("--only random --seeds %d-%d --heap 1 --compare %s", seed, seed + 249,
              folder_path("programs")) == 0);
    setenv("GLIBC_TUNABLES", "glibc.malloc.tcache_count=0", 1);
    CHECK(run("--only random --seeds %d-%d --compare %s", seed, seed + 249,
              folder_path("programs")) == 0);
    unsetenv("GLIBC_TUNABLES");
  }
}

TEST(another_bit_is_found)
{
  CHECK(hash_into("plain", "lever", "") > 1);
  char *digit = ran.out + 3;
  *digit = *digit == '0' ? '1' : '0';
  file_write(folder_path("other"), ran.out);
  CHECK(run(HANDFUL "lever --compare %s", folder_path("other")) == 1);
  CHECK(lines_from(ran.out, "- ") == 1 && lines_from(ran.out, "+ ") == 1);
  file_write(folder_path("other"), "");
  CHECK(run(HANDFUL "lever --compare %s", folder_path("other")) == 1); /* nothing to compare with */
}

/* Its own run is the recording's, or the program says so. */
TEST(what_was_recorded_is_played)
{
  CHECK(hash_into("plain", "friction=on,torque=on", "") == 1);
  CHECK(run(HANDFUL "sine --recordings %s", test_folder) == 0);
  CHECK(lines_with(ran.out, "played ") == 1);
  file_write(folder_path("played"), ran.out);
  CHECK(run(HANDFUL "sine --recordings %s --compare %s", test_folder, folder_path("played")) == 0);
}

TEST(wrong_usage)
{
  CHECK(run("--heap x") == 2 && says("--heap"));
  CHECK(run("--seeds 5-2") == 2 && run("--seeds") == 2 && run("frob") == 2);
  CHECK(run("--compare /nowhere/at/all") == 2);
  CHECK(run("--list") == 0 && lines_with(ran.out, "--scene") > 300);
}

SET_UP
{
  return program_use("HAPODE_HASHES");
}
