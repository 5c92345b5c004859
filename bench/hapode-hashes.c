/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-hashes [--quick] [--only TEXT] [--seeds FIRST-LAST] [--heap N] [--compare FILE]
 * [--recordings DIR] [--list]: runs everything in lockstep and prints one line for each run: the
 * hash of all ticks, a hash of the world, the number of testing simulations, and the run's name.
 * A change of the library that is meant to change no result leaves every line as it is. The name
 * of a scene's run is what hapode-run takes to repeat it. Exit 0: done, 1: a run failed or a
 * line differs, 2: usage. */

#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "base/regular.h"
#include "bench/random_use.h"
#include "bench/storm.h"
#include "tools/run_recording.h"

#define NAME_MAX_LENGTH 300
#define ARGUMENTS_MAX 40
#define STRETCH 10 /* ticks at once */

typedef enum case_kind {
  CASE_RUN = 0,  /* a scene, as hapode-run has it */
  CASE_MODELS,   /* the same, its model changed all the time */
  CASE_RECORDED, /* the same, recorded in real time, then played */
  CASE_STORM,    /* a world that is edited all the time */
  CASE_RANDOM    /* a program of random calls */
} case_kind;

typedef struct net_case {
  case_kind kind;
  char name[NAME_MAX_LENGTH];
  hap_model model; /* of a storm */
  double physics_hz;
  double seconds;
  uint64_t seed; /* of a storm and a random program */
} net_case;

typedef struct net_line {
  uint64_t ticks; /* their hash */
  uint64_t world;
  uint64_t probe_steps;
} net_line;

typedef struct net {
  bool quick;
  bool list;
  const char *only;
  const char *compare;
  const char *recordings; /* folder; NULL: they are thrown away */
  uint64_t first_seed;
  uint64_t last_seed;
  int heap; /* -1: the C library's */
  net_case *cases;
  size_t count;
  size_t capacity;
  char *wanted; /* text of the file to compare with */
  int same;
  int different;
  int failed;
} net;

/* ---- another heap ---- */

/* Gives addresses in another order for each N: blocks are padded, kept when they are freed, and
 * given again or not, as dice say. What is new holds rubbish. */

#define HEAP_GRAIN 64u
#define HEAP_SIZES 512u

typedef struct heap_block {
  struct heap_block *next;
  size_t grains;
  char pad[HEAP_GRAIN - 2 * sizeof(void *)];
} heap_block;

static struct {
  uint64_t dice;
  heap_block *freed[HEAP_SIZES];
} heap;

static uint32_t heap_dice(uint32_t count)
{
  heap.dice = heap.dice * 6364136223846793005u + 1442695040888963407u;
  return (uint32_t)(heap.dice >> 33) % count;
}

static void *heap_allocate(size_t size)
{
  size_t grains = size / HEAP_GRAIN + 1;
  heap_block *block = grains < HEAP_SIZES ? heap.freed[grains] : NULL;
  if (block != NULL && heap_dice(3) != 0) {
    heap.freed[grains] = block->next;
  } else {
    block = aligned_alloc(HEAP_GRAIN, sizeof *block + (grains + heap_dice(4)) * HEAP_GRAIN);
  }
  if (block == NULL) {
    return NULL;
  }
  block->grains = grains;
  memset(block + 1, (int)(0x80u | heap_dice(0x7f)), grains * HEAP_GRAIN);
  return block + 1;
}

static void heap_release(void *memory)
{
  if (memory == NULL) {
    return;
  }
  heap_block *block = (heap_block *)memory - 1;
  if (block->grains >= HEAP_SIZES || heap_dice(4) == 0) {
    free(block);
    return;
  }
  memset(memory, 0xcd, block->grains * HEAP_GRAIN);
  block->next = heap.freed[block->grains];
  heap.freed[block->grains] = block;
}

static void *heap_ode_allocate(size_t size)
{
  return heap_allocate(size);
}

static void *heap_ode_reallocate(void *memory, size_t old_size, size_t size)
{
  void *more = heap_allocate(size);
  if (memory != NULL && more != NULL) {
    memcpy(more, memory, old_size < size ? old_size : size);
  }
  heap_release(memory);
  return more;
}

static void heap_ode_free(void *memory, size_t size)
{
  (void)size;
  heap_release(memory);
}

static void *heap_hook_allocate(size_t size, void *user)
{
  (void)user;
  return heap_allocate(size);
}

static void heap_hook_release(void *memory, void *user)
{
  (void)user;
  heap_release(memory);
}

/* Before dInitODE2. */
static void heap_begin(int seed)
{
  static const hap_hooks hooks = {.allocate = heap_hook_allocate, .release = heap_hook_release};
  heap.dice = (uint64_t)seed * 2654435761u + 1;
  dSetAllocHandler(heap_ode_allocate);
  dSetReallocHandler(heap_ode_reallocate);
  dSetFreeHandler(heap_ode_free);
  (void)hap_hooks_set(&hooks);
}

/* ---- hashes ---- */

static uint64_t hash_word(uint64_t hash, uint64_t word)
{
  hash = (hash ^ word) * 0x9e3779b97f4a7c15u;
  return hash ^ (hash >> 29);
}

static uint64_t hash_doubles(uint64_t hash, const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    uint64_t bits;
    memcpy(&bits, &values[i], sizeof bits);
    hash = hash_word(hash, bits);
  }
  return hash;
}

/* What counts of the statistics and is no time. */
static uint64_t hash_stats(uint64_t hash, const hap_stats *s)
{
  const uint64_t counts[] = {s->loop.ticks,         s->loop.contact_ticks,     s->physics.steps,
                             s->model.bodies_known, s->model.capacity_dropped, s->faults.count,
                             s->probes.reused,      s->error.lookbacks,        s->error.spoilt};
  const double values[] = {s->hand.impulse_ns, s->hand.peak_force_n, s->error.force_error};
  for (size_t i = 0; i < sizeof counts / sizeof counts[0]; ++i) {
    hash = hash_word(hash, counts[i]);
  }
  return hash_doubles(hash, values, sizeof values / sizeof values[0]);
}

static uint64_t hash_bodies(uint64_t hash, const scene *s)
{
  for (size_t i = 0; i < s->body_count; ++i) {
    hash = hash_doubles(hash, dBodyGetPosition(s->bodies[i]), 3);
    hash = hash_doubles(hash, dBodyGetQuaternion(s->bodies[i]), 4);
    hash = hash_doubles(hash, dBodyGetLinearVel(s->bodies[i]), 3);
    hash = hash_doubles(hash, dBodyGetAngularVel(s->bodies[i]), 3);
  }
  return hash;
}

/* ---- runs ---- */

/* Splits a name, which has no quotes, at its spaces. */
static int arguments_split(char *text, char **out)
{
  int count = 0;
  for (char *word = strtok(text, " "); word != NULL && count < ARGUMENTS_MAX;
       word = strtok(NULL, " ")) {
    out[count++] = word;
  }
  return count;
}

static void sleep_seconds(double seconds)
{
  struct timespec time = {(time_t)seconds, (long)(1e9 * (seconds - floor(seconds)))};
  nanosleep(&time, NULL);
}

/* HAP_END: a replay is over. */
static hap_status run_advance(const net_case *c, const run_options *options, const rig *r)
{
  uint64_t ticks = (uint64_t)(options->seconds * options->rig.def.haptic_hz + 0.5);
  hap_status status = hap_session_start(r->session);
  if (options->rig.record != NULL && status >= HAP_OK) {
    sleep_seconds(options->seconds);
    return HAP_OK;
  }
  for (uint64_t done = 0; status >= HAP_OK && status != HAP_END && done < ticks; done += STRETCH) {
    if (c->kind == CASE_MODELS && done % 150 == 0) {
      status = hap_session_set_model(r->session, (hap_model)(3 - done / 150 % 4));
    }
    status = status >= HAP_OK ? hap_session_advance(r->session, STRETCH) : status;
  }
  return status;
}

static hap_status run_started(const net_case *c, const run_options *options, const rig *r,
                              net_line *out, hap_detail *detail)
{
  hap_stats stats;
  hap_play_difference difference = {.what = HAP_DIFFERENCE_NONE};
  hap_status status = run_advance(c, options, r);
  if (status < HAP_OK) {
    (void)hap_session_detail(r->session, detail);
  }
  (void)hap_session_stop(r->session);
  (void)hap_session_stats(r->session, &stats, sizeof stats);
  *out = (net_line){stats.loop.trace_hash, hash_bodies(hash_stats(1, &stats), r->scene),
                    stats.probes.steps};
  if (options->rig.player != NULL) {
    (void)hap_player_difference(options->rig.player, &difference, sizeof difference);
    if (difference.what != HAP_DIFFERENCE_NONE || status != HAP_END) {
      snprintf(detail->text, sizeof detail->text,
               "the replay is not the recording, from tick %" PRIu64, difference.tick);
      return HAP_ERROR_STATE;
    }
  }
  return status;
}

static hap_status run_once(const net_case *c, run_options *options, net_line *out,
                           hap_detail *detail)
{
  rig r;
  run_recording recording;
  hap_status status = run_recording_open(options, &recording, detail);
  if (status >= HAP_OK) {
    status = rig_create(&options->rig, &r, detail);
    if (status >= HAP_OK) {
      status = run_started(c, options, &r, out, detail);
      rig_destroy(&r);
    }
  }
  run_recording_close(&recording);
  return status;
}

/* As of a command line that begins with "what". */
static hap_status run_case(const net_case *c, const char *what, net_line *out, hap_detail *detail)
{
  char text[2 * NAME_MAX_LENGTH];
  char *arguments[ARGUMENTS_MAX + 1] = {0};
  run_options options;
  snprintf(text, sizeof text, "hapode-run %s %s", what, c->name);
  hap_status status =
      run_options_parse(arguments_split(text, arguments), arguments, &options, detail);
  return status >= HAP_OK ? run_once(c, &options, out, detail) : status;
}

static hap_status run_storm(const net_case *c, net_line *out, hap_detail *detail)
{
  storm_result r;
  storm_def def = {.drive = HAP_DRIVE_LOCKSTEP,
                   .model = c->model,
                   .seconds = c->seconds,
                   .physics_hz = c->physics_hz,
                   .seed = c->seed,
                   .posts = true,
                   .hands = STORM_SPOTS,
                   .churn = true,
                   .telling = STORM_TELLS};
  hap_status status = storm_run(&def, &r, detail);
  out->ticks = r.stats.loop.trace_hash;
  out->world = hash_word(hash_stats(1, &r.stats), r.edits);
  out->probe_steps = r.stats.probes.steps;
  return status;
}

static hap_status run_random(const net_case *c, net_line *out, hap_detail *detail)
{
  random_use_result r;
  random_use_def def = {.seed = c->seed, .ticks = (uint32_t)(1000.0 * c->seconds)};
  hap_status status = random_use_run(&def, &r, detail);
  if (status >= HAP_OK && r.unexpected > 0) {
    snprintf(detail->text, sizeof detail->text,
             "%" PRIu64 " bodies lost, %" PRIu64 " answers wrong", r.lost, r.unexpected);
    status = HAP_ERROR_STATE;
  }
  *out = (net_line){r.trace_hash, r.world_hash, r.probe_steps};
  return status;
}

/* ---- lines ---- */

/* The wanted line of a name; NULL: there is none. */
static const char *wanted_find(const net *n, const char *name)
{
  size_t length = strlen(name);
  for (const char *line = n->wanted; line != NULL && *line != '\0';) {
    size_t size = strcspn(line, "\n");
    if (size > length && memcmp(line + size - length, name, length) == 0 &&
        line[size - length - 1] == ' ' && line[size - length - 2] == ' ') {
      return line;
    }
    line += size + (line[size] == '\n');
  }
  return NULL;
}

static void line_show(net *n, const net_case *c, const char *what, const net_line *line)
{
  char name[NAME_MAX_LENGTH + 20];
  char text[NAME_MAX_LENGTH + 100];
  snprintf(name, sizeof name, "%s%s", what, c->name);
  snprintf(text, sizeof text, "%016" PRIx64 " %016" PRIx64 " %7" PRIu64 "  %s", line->ticks,
           line->world, line->probe_steps, name);
  if (n->compare == NULL) {
    puts(text);
    return;
  }
  const char *wanted = wanted_find(n, name);
  size_t length = wanted != NULL ? strcspn(wanted, "\n") : 0;
  if (wanted == NULL) {
    printf("? %s\n", text);
  } else if (strlen(text) != length || memcmp(wanted, text, length) != 0) {
    printf("- %.*s\n+ %s\n", (int)length, wanted, text);
    ++n->different;
  } else {
    ++n->same;
  }
}

static bool file_exists(const char *path)
{
  return access(path, F_OK) == 0;
}

/* In real time, where there is no such file yet. Then the replay is the run, or it is an error;
 * the line is of the replay, and worth something to those who keep the file for the next build. */
static hap_status run_recorded(const net *n, const net_case *c, net_line *out, hap_detail *detail)
{
  char file[300];
  char option[350];
  net_case play = {.kind = CASE_RECORDED, .name = "--seconds 1000"};
  net_line ignored;
  hap_status status = HAP_OK;
  uint64_t number = 0;
  for (const char *at = c->name; *at != '\0'; ++at) {
    number = hash_word(number, (unsigned char)*at);
  }
  if (n->recordings != NULL) {
    snprintf(file, sizeof file, "%s/%016" PRIx64 ".rec", n->recordings, number);
  } else {
    snprintf(file, sizeof file, "hapode-hashes.%ld.rec", (long)getpid());
  }
  if (n->recordings == NULL || !file_exists(file)) {
    snprintf(option, sizeof option, "--no-realtime --record %s", file);
    status = run_case(c, option, &ignored, detail);
  }
  if (status >= HAP_OK) {
    snprintf(option, sizeof option, "--play %s", file);
    status = run_case(&play, option, out, detail);
  }
  if (n->recordings == NULL) {
    unlink(file);
  }
  return status;
}

static hap_status case_run(net *n, const net_case *c, hap_detail *detail)
{
  net_line line = {0};
  hap_status status = HAP_OK;
  switch (c->kind) {
    case CASE_RUN:
    case CASE_MODELS:
      status = run_case(c, "--lockstep", &line, detail);
      break;
    case CASE_STORM:
      status = run_storm(c, &line, detail);
      break;
    case CASE_RANDOM:
      status = run_random(c, &line, detail);
      break;
    case CASE_RECORDED:
      status = run_recorded(n, c, &line, detail);
      break;
  }
  bool repeats = c->kind != CASE_RECORDED || n->recordings != NULL;
  if (status >= HAP_OK && repeats) {
    const char *what = c->kind == CASE_MODELS     ? "models "
                       : c->kind == CASE_RECORDED ? "played "
                                                  : "";
    line_show(n, c, what, &line);
  }
  return status;
}

enum case_result {
  RESULT_ALONE = 0, /* there was nothing to compare with */
  RESULT_SAME,
  RESULT_DIFFERENT,
  RESULT_FAILED
};

/* In a process of its own: ODE and the C library keep things from one run to the next. */
static void case_run_apart(net *n, const net_case *c)
{
  fflush(stdout);
  pid_t child = fork();
  if (child == 0) {
    hap_detail detail = {""};
    n->different = n->same = 0;
    if (n->heap >= 0) {
      heap_begin(n->heap);
    }
    dInitODE2(0);
    hap_status status = case_run(n, c, &detail);
    if (status < HAP_OK) {
      fprintf(stderr, "hapode-hashes: %s: %s\n", c->name, detail.text);
    }
    fflush(stdout);
    _exit(status < HAP_OK    ? RESULT_FAILED
          : n->different > 0 ? RESULT_DIFFERENT
          : n->same > 0      ? RESULT_SAME
                             : RESULT_ALONE);
  }
  int result = 0;
  if (child < 0 || waitpid(child, &result, 0) != child || !WIFEXITED(result)) {
    fprintf(stderr, "hapode-hashes: %s: the process ended\n", c->name);
    ++n->failed;
    return;
  }
  n->different += WEXITSTATUS(result) == RESULT_DIFFERENT;
  n->same += WEXITSTATUS(result) == RESULT_SAME;
  n->failed += WEXITSTATUS(result) == RESULT_FAILED;
}

/* ---- which runs ---- */

static net_case *case_add(net *n, case_kind kind)
{
  if (n->count == n->capacity) {
    n->capacity = 2 * n->capacity + 256;
    n->cases = realloc(n->cases, n->capacity * sizeof *n->cases);
    if (n->cases == NULL) {
      fprintf(stderr, "hapode-hashes: no memory\n");
      exit(1);
    }
  }
  net_case *c = &n->cases[n->count++];
  memset(c, 0, sizeof *c);
  c->kind = kind;
  return c;
}

static void scene_add(net *n, case_kind kind, const char *spec, double seconds, const char *more)
{
  net_case *c = case_add(n, kind);
  snprintf(c->name, sizeof c->name, "--scene %s --seconds %g %s", spec, seconds, more);
}

static double scene_seconds(const net *n, const char *name)
{
  double share = n->quick ? 0.3 : 1.0;
  bool dear = strncmp(name, "pile", 4) == 0 || strcmp(name, "tower") == 0 ||
              strcmp(name, "hold") == 0 || strcmp(name, "field") == 0;
  return share * (dear ? 0.5 : 1.2);
}

/* What every scene is run with. */
static const char *const usual[] = {
    "--model contact --physics-hz 20",
    "--model accelerance --physics-hz 20",
    "--model contact --physics-hz 60",
    "--model accelerance --physics-hz 60",
    "--model single",
    "--model impulse --physics-hz 20",
    "--model impulse --physics-hz 60 --impulse-pose held",
    "--model accelerance --physics-hz 20 --probe operating",
    "--model accelerance --physics-hz 20 --probe paper",
    "--model contact --physics-hz 20 --coupling proxy:1000",
    "--model contact --physics-hz 30 --lookback 0.1",
    "--model contact --physics-hz 20 --friction 0.5 --accuracy 0.2",
};
#define QUICK_USUAL 2

/* And some. */
static const char *const scenes_of_knobs[] = {"row10", "stack", "lightstand", "lever", "grasp"};
static const char *const knobs[] = {
    "--accuracy 0",
    "--accuracy 0.8",
    "--accuracy 1 --physics-hz 20",
    "--force-error 0.05 --physics-hz 20",
    "--coupling direct",
    "--coupling god-object:2000",
    "--coupling virtual:2000",
    "--friction 0.6 --finger-radius 0.01 --physics-hz 20",
    "--friction 0.6 --model accelerance",
    "--haptic-hz 2000 --contact-hz 100",
    "--range 1",
    "--sweeps 4 --iterations 5",
    "--model accelerance --reuse 0.001",
    "--model accelerance --lookback 0.2 --physics-hz 30",
    "--model impulse --model-age 0.01",
    "--effects testing=on,range=off",
    "--effects contacts=off",
    "--effects passes=off,shape=off",
    "--effects joints=off,friction=on,torque=on,gyro=on",
    "--effects restitution=off,proxy=off,observer=off",
    "--effects all=on --model accelerance",
    "--effects cross=on --model accelerance --physics-hz 20",
};

/* Hands beside the scene's own. */
#define HANDS                                                              \
  "--device virtual:path=0:-0.02/0/0.025;1:0.06/0/0.025,hand=tense "       \
  "--device virtual:path=0:0.3/0.01/0.025;1:0.2/0.01/0.025,hand=relaxed "  \
  "--device virtual:path=0:0.02/-0.04/0.025;1:0.02/0.02/0.025,hand=rigid " \
  "--device virtual:sine=0.01/0/0.02,hz=2"

static void scenes_add(net *n)
{
  size_t variants = n->quick ? QUICK_USUAL : sizeof usual / sizeof usual[0];
  for (size_t i = 0; scene_table_at(i) != NULL; ++i) {
    const char *name = scene_table_at(i)->name;
    const char *spec = strcmp(name, "pile") == 0 ? "pile:20" : name;
    for (size_t k = 0; k < variants; ++k) {
      scene_add(n, CASE_RUN, spec, scene_seconds(n, name), usual[k]);
    }
  }
}

static void knobs_add(net *n)
{
  size_t scenes = n->quick ? 1 : sizeof scenes_of_knobs / sizeof scenes_of_knobs[0];
  for (size_t i = 0; i < scenes; ++i) {
    const char *name = scenes_of_knobs[i];
    double seconds = n->quick ? 0.3 : 0.8;
    for (size_t k = 0; k < sizeof knobs / sizeof knobs[0]; ++k) {
      scene_add(n, CASE_RUN, name, seconds, knobs[k]);
    }
    scene_add(n, CASE_MODELS, name, 2.0 * seconds, "--physics-hz 60");
    scene_add(n, CASE_RECORDED, name, seconds, "--physics-hz 60");
    scene_add(n, CASE_RECORDED, name, seconds, "--model accelerance --physics-hz 20");
  }
  scene_add(n, CASE_RUN, "row10", n->quick ? 0.3 : 1.0, HANDS);
  scene_add(n, CASE_RUN, "row10", n->quick ? 0.3 : 1.0, "--model accelerance " HANDS);
  scene_add(n, CASE_RECORDED, "row10", n->quick ? 0.3 : 1.0, HANDS);
}

static void storms_add(net *n)
{
  static const double rates[] = {20.0, 60.0};
  for (int model = HAP_MODEL_SINGLE; model <= HAP_MODEL_CONTACT; ++model) {
    for (size_t i = 0; i < (n->quick ? 1u : 2u); ++i) {
      net_case *c = case_add(n, CASE_STORM);
      c->model = (hap_model)model;
      c->physics_hz = rates[1 - i];
      c->seconds = n->quick ? 0.3 : 1.5;
      c->seed = 12345 + i;
      snprintf(c->name, sizeof c->name, "storm %s %g Hz", hap_model_name(c->model), c->physics_hz);
    }
  }
}

static void randoms_add(net *n)
{
  for (uint64_t seed = n->first_seed; seed <= n->last_seed; ++seed) {
    net_case *c = case_add(n, CASE_RANDOM);
    c->seed = seed;
    c->seconds = 0.5;
    snprintf(c->name, sizeof c->name, "random %" PRIu64, seed);
  }
}

/* ---- the program ---- */

static void usage_print(FILE *to)
{
  fputs(
      "usage: hapode-hashes [--quick] [--only TEXT] [--seeds FIRST-LAST] [--heap N]\n"
      "                     [--compare FILE] [--list]\n"
      "Runs every scene, model and option in lockstep, storms of edits and random programs, and\n"
      "prints a line for each: hash of the ticks, hash of the world, testing simulations, name.\n"
      "  --quick      less of all, for tests\n"
      "  --only       runs whose name has TEXT in it\n"
      "  --seeds      of the random programs (default 1-200, quick 1-30)\n"
      "  --heap       addresses in another order for each N, which must change no line\n"
      "  --compare    prints the lines that are not as in FILE (?: it has none of this name);\n"
      "               exit 1 if there are any, or nothing was the same\n"
      "  --list       names alone\n",
      to);
}

static char *file_read(const char *path)
{
  const char *why = NULL;
  FILE *file = hapi_regular_open(path, &why);
  char *text = NULL;
  size_t size = 0;
  size_t got = 1;
  while (file != NULL && got > 0) {
    char *more = realloc(text, size + 65537);
    if (more == NULL) {
      break;
    }
    text = more;
    got = fread(text + size, 1, 65536, file);
    size += got;
    text[size] = '\0';
  }
  if (file != NULL) {
    fclose(file);
  }
  return text;
}

static bool seeds_read(const char *text, net *out)
{
  char after;
  return sscanf(text, "%" SCNu64 "-%" SCNu64 "%c", &out->first_seed, &out->last_seed, &after) ==
             2 &&
         out->first_seed <= out->last_seed;
}

static bool number_read(const char *text, int *out)
{
  char *end = NULL;
  long number = strtol(text, &end, 10);
  *out = (int)number;
  return end != text && *end == '\0' && number >= 0 && number <= 1000000;
}

static bool arguments_read(int count, char **arguments, net *n)
{
  for (int i = 1; i < count; ++i) {
    const char *value = i + 1 < count ? arguments[i + 1] : NULL;
    if (strcmp(arguments[i], "--quick") == 0) {
      n->quick = true;
      n->last_seed = n->last_seed == 200 ? 30 : n->last_seed;
    } else if (strcmp(arguments[i], "--list") == 0) {
      n->list = true;
    } else if (value != NULL && strcmp(arguments[i], "--only") == 0) {
      n->only = arguments[++i];
    } else if (value != NULL && strcmp(arguments[i], "--compare") == 0) {
      n->compare = arguments[++i];
    } else if (value != NULL && strcmp(arguments[i], "--recordings") == 0) {
      n->recordings = arguments[++i];
    } else if (value == NULL ||
               !(strcmp(arguments[i], "--seeds") == 0  ? seeds_read(value, n)
                 : strcmp(arguments[i], "--heap") == 0 ? number_read(value, &n->heap)
                                                       : false)) {
      fprintf(stderr, "hapode-hashes: \"%s\" is not understood\n", arguments[i]);
      return false;
    } else {
      ++i;
    }
  }
  return true;
}

int main(int argc, char **argv)
{
  net n = {.first_seed = 1, .last_seed = 200, .heap = -1};
  if (argc == 2 && strcmp(argv[1], "--help") == 0) {
    usage_print(stdout);
    return 0;
  }
  if (!arguments_read(argc, argv, &n)) {
    usage_print(stderr);
    return 2;
  }
  if (n.compare != NULL && (n.wanted = file_read(n.compare)) == NULL) {
    fprintf(stderr, "hapode-hashes: %s cannot be read\n", n.compare);
    return 2;
  }
  scenes_add(&n);
  knobs_add(&n);
  storms_add(&n);
  randoms_add(&n);
  for (size_t i = 0; i < n.count; ++i) {
    if (n.only != NULL && strstr(n.cases[i].name, n.only) == NULL) {
      continue;
    }
    if (n.list) {
      puts(n.cases[i].name);
    } else {
      case_run_apart(&n, &n.cases[i]);
    }
  }
  bool compared = n.compare == NULL || n.list || n.same > 0;
  if (n.compare != NULL) {
    printf("%d runs are the same, %d differ, %d failed\n", n.same, n.different, n.failed);
  }
  free(n.cases);
  free(n.wanted);
  return n.failed > 0 || n.different > 0 || !compared ? 1 : 0;
}
