/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Files of recordings that are not as they should be: damaged, cut, of somebody else, changed. */

#include "tests/tap.h"

#include "record/reader.h"
#include "record/recorder.h"
#include "tests/recorded_file.h"

/* The cell of that kind in the tick of that count; ticks of a replay are counted from 0. */
static hapi_cell *find_cell(file *f, uint64_t tick, hapi_cell_kind kind)
{
  uint64_t seen = 0;
  for (uint32_t i = 0; i < f->count; ++i) {
    const block *b = &f->blocks[i];
    for (uint32_t k = 0; b->head.type == HAPI_BLOCK_CELLS_OF && k < b->head.size / 64; ++k) {
      hapi_cell *cell = (hapi_cell *)(void *)b->bytes + k;
      seen += cell->kind == HAPI_CELL_TICK;
      if (seen == tick + 1 && cell->kind == (uint8_t)kind) {
        return cell;
      }
    }
  }
  return NULL;
}

/* ---- a file that was changed ---- */

static void check_ulp(hapi_cell_kind kind, int place)
{
  file f = file_fresh("row10", 600);
  hapi_cell *cell = find_cell(&f, 321, kind);
  REQUIRE(cell != NULL);
  cell->d[place] = nextafter(cell->d[place], 1e9);
  file_pack(&f);
  file_release(&f);
  replay again = recorded_play("row10", 0);
  printf("# %s\n", again.difference.text);
  CHECK(again.status == HAP_END && again.diverged_after == 322);
  CHECK(again.difference.tick == 321 && again.difference.what == HAP_DIFFERENCE_POINTER);
  CHECK(again.difference.number == ((1ull << 32) | 1));
}

TEST(a_position_off_by_one_bit_is_told_at_its_tick)
{
  check_ulp(HAPI_CELL_POSE, 0);
}

TEST(a_velocity_off_by_one_bit_is_told_at_its_tick)
{
  check_ulp(HAPI_CELL_TWIST, 0);
}

/* The first tick with a force on the hand. */
static uint64_t first_push(file *f)
{
  uint64_t tick = 0;
  const hapi_cell *force = find_cell(f, tick, HAPI_CELL_FORCE);
  while (force != NULL && !(fabs(force->d[0]) > 0.5)) {
    force = find_cell(f, ++tick, HAPI_CELL_FORCE);
  }
  return tick;
}

TEST(a_position_that_is_off_is_told_with_its_force)
{
  file f = file_fresh("row10", 900);
  uint64_t tick = first_push(&f);
  hapi_cell *cell = find_cell(&f, tick, HAPI_CELL_POSE);
  REQUIRE(cell != NULL);
  cell->d[0] += 3e-4; /* more would not be believed */
  file_pack(&f);
  file_release(&f);
  replay again = recorded_play("row10", 0);
  printf("# %s\n", again.difference.text);
  CHECK(again.difference.tick == tick && again.difference.shown == HAP_DIFFERENCE_POINTER);
  CHECK(again.difference.shown_tick == tick);
  CHECK(again.difference.distance > 0.15 && again.difference.distance < 3.0);
  double force = again.difference.recorded[0] - again.difference.replayed[0];
  CHECK(fabs(force) <= again.difference.distance && fabs(force) > 0.15);
  char says[40];
  snprintf(says, sizeof says, "from tick %llu (", (unsigned long long)tick);
  CHECK(strstr(again.difference.text, says) != NULL &&
        strstr(again.difference.text, "pointer 1") != NULL);
}

TEST(a_body_elsewhere_is_told_with_its_distance)
{
  file f = file_fresh("row10", 900);
  hapi_cell *cell = find_cell(&f, 444, HAPI_CELL_BODY);
  REQUIRE(cell != NULL);
  cell->d[1] += 2e-6;
  file_pack(&f);
  file_release(&f);
  replay again = recorded_play("row10", 0);
  printf("# %s\n", again.difference.text);
  CHECK(again.difference.what == HAP_DIFFERENCE_BODY && again.difference.tick == 444);
  CHECK_NEAR(again.difference.distance, 2e-6, 1e-12);
  CHECK(again.difference.traced < 10 && strstr(again.difference.text, "body b") != NULL);
}

static hapi_cell *find_physics(file *f, hapi_cell_kind kind, uint32_t number)
{
  for (uint32_t i = 0; i < f->count; ++i) {
    const block *b = &f->blocks[i];
    bool other = b->head.type != HAPI_BLOCK_CELLS_OF + HAPI_STREAM_PHYSICS &&
                 b->head.type != HAPI_BLOCK_CELLS_OF + HAPI_STREAM_CONTACT;
    for (uint32_t k = 0; !other && k < b->head.size / 64; ++k) {
      hapi_cell *cell = (hapi_cell *)(void *)b->bytes + k;
      if (cell->kind == (uint8_t)kind && number-- == 0) {
        return cell;
      }
    }
  }
  return NULL;
}

TEST(what_physics_and_passes_make_is_compared)
{
  static const hapi_cell_kind kinds[] = {HAPI_CELL_CYCLED, HAPI_CELL_PASS};
  static const int places[] = {HAPI_CYCLED_HASH, HAPI_PASS_HASH};
  static const hap_difference what[] = {HAP_DIFFERENCE_STEP, HAP_DIFFERENCE_PASS};
  for (int i = 0; i < 2; ++i) {
    file f = file_fresh("stack", 400);
    hapi_cell *cell = find_physics(&f, kinds[i], 9);
    REQUIRE(cell != NULL);
    cell->u[places[i]] ^= 1;
    file_pack(&f);
    file_release(&f);
    replay again = recorded_play("stack", 0);
    printf("# %s\n", again.difference.text);
    CHECK(again.status == HAP_END && again.difference.what == (uint32_t)what[i]);
    CHECK(again.difference.number == (i == 0 ? 11u : 10u)); /* the start made the first model */
    CHECK(again.difference.shown == HAP_DIFFERENCE_NONE);
  }
}

/* A pass that had another set of poses than in truth: taken at another time. */
TEST(a_message_taken_at_another_time_is_noticed)
{
  file f = file_fresh("row10", 900);
  hapi_cell *cell = find_physics(&f, HAPI_CELL_CYCLE, 30);
  REQUIRE(cell != NULL && cell->u[HAPI_CYCLE_STATE] > 1);
  --cell->u[HAPI_CYCLE_STATE];
  file_pack(&f);
  file_release(&f);
  replay again = recorded_play("row10", 0);
  printf("# %s\n", again.difference.text);
  CHECK(again.difference.what == HAP_DIFFERENCE_STEP && again.difference.number == 32);
}

/* ---- a file that contradicts itself ---- */

typedef void (*spoil_fn)(file *f);

static void later_model(file *f)
{
  find_cell(f, 20, HAPI_CELL_TICK)->u[HAPI_TICK_MODEL] = 1000000;
}

static void later_state(file *f)
{
  for (uint32_t i = 3; find_physics(f, HAPI_CELL_CYCLE, i) != NULL; ++i) {
    find_physics(f, HAPI_CELL_CYCLE, i)->u[HAPI_CYCLE_STATE] = 100000 + i;
  }
}

static void later_poses(file *f)
{
  for (uint32_t i = 10; find_physics(f, HAPI_CELL_PASS, i) != NULL; ++i) {
    find_physics(f, HAPI_CELL_PASS, i)->u[HAPI_PASS_POSES] = 1000000;
  }
}

static void other_pointer(file *f)
{
  find_cell(f, 20, HAPI_CELL_POSE)->index = 2;
}

static void fault_of_the_future(file *f)
{
  find_cell(f, 20, HAPI_CELL_TICK)->index = 77;
}

static void no_pointer(file *f)
{
  hapi_cell *begin = (hapi_cell *)(void *)f->blocks[f->blocks[1].head.type == 2 ? 1 : 2].bytes;
  for (uint32_t i = 1; i < f->count; ++i) {
    begin = f->blocks[i].head.type == 2 ? (hapi_cell *)(void *)f->blocks[i].bytes : begin;
    if (f->blocks[i].head.type == 2) {
      break;
    }
  }
  for (int i = 0; i < 10; ++i) {
    if (begin[i].kind == HAPI_CELL_JOIN) {
      begin[i].d[1] = (double)NAN;
      begin[i].d[2] = (double)NAN;
    }
  }
}

static void check_contradiction(spoil_fn spoil, bool may_end)
{
  file f = file_fresh("stack", 300);
  REQUIRE(find_cell(&f, 20, HAPI_CELL_TICK) != NULL);
  spoil(&f);
  file_pack(&f);
  file_release(&f);
  replay again = recorded_play("stack", 0);
  bool ended = may_end && again.status == HAP_END && again.stats.loop.ticks < 100;
  CHECK(again.status == HAP_ERROR_FORMAT || ended);
  CHECK(ended || strstr(again.detail.text, "the recording contradicts itself") != NULL);
  printf("# %s\n", again.detail.text);
}

TEST(a_recording_that_contradicts_itself_is_an_error)
{
  check_contradiction(later_model, true); /* the step may be lost behind the end */
  check_contradiction(later_state, true);
  check_contradiction(later_poses, true);
  check_contradiction(other_pointer, false);
  check_contradiction(fault_of_the_future, false);
  check_contradiction(no_pointer, false);
}

static void other_body(file *f)
{
  find_cell(f, 20, HAPI_CELL_BODY)->index = 3;
}

TEST(a_recording_whose_bodies_are_out_of_order_ends)
{
  check_contradiction(other_body, false);
}

/* Marsaglia's xorshift of 32 bits. */
static uint32_t next_random(uint32_t *state)
{
  *state ^= *state << 13;
  *state ^= *state >> 17;
  *state ^= *state << 5;
  return *state;
}

/* Any byte of any cell may be wrong under a right sum. Playback ends, with a reason or at its end,
 * and neither hangs nor reads beyond its tables. */
TEST(playback_ends_whatever_a_cell_says)
{
  const int times = strcmp(tap_argument, "long") == 0 ? 20000 : 150;
  file f = file_fresh("stack", 60);
  uint32_t random = 20261123;
  int refused = 0;
  for (int i = 0; i < times; ++i) {
    block *b = &f.blocks[1 + next_random(&random) % (f.count - 1)];
    if (b->head.type < HAPI_BLOCK_CELLS_OF || b->head.size < sizeof(hapi_cell)) {
      continue;
    }
    char *byte = b->bytes + next_random(&random) % b->head.size;
    char kept = *byte;
    *byte = (char)next_random(&random);
    file_pack(&f);
    replay again = recorded_play("stack", 0);
    CHECK(again.status == HAP_END || again.status == HAP_DIVERGED || again.detail.text[0] != '\0');
    refused += again.status < HAP_OK;
    *byte = kept;
  }
  CHECK(refused > 0 && refused < times);
  file_release(&f);
}

/* ---- damage ---- */

static hap_status try_open(uint32_t flags, hap_detail *detail)
{
  hap_player *player = NULL;
  detail->text[0] = '\0';
  hap_status status = hap_player_open(recorded_path, flags, &player, detail);
  CHECK((player != NULL) == (status >= HAP_OK));
  CHECK(status >= HAP_OK || detail->text[0] != '\0');
  hap_player_close(player);
  return status;
}

TEST(cut_at_every_100th_byte)
{
  hap_detail detail;
  file f = file_fresh("row10", 300);
  file_release(&f);
  size_t playable = 0;
  for (size_t size = 0; size < raw_size; size += 100) {
    write_raw(size);
    CHECK(try_open(0, &detail) == HAP_ERROR_FORMAT);
    CHECK(strstr(detail.text, size < 32 ? "no recording" : "breaks off") != NULL);
    hap_status status = try_open(HAP_PLAY_INCOMPLETE, &detail);
    CHECK(status == HAP_OK || status == HAP_ERROR_FORMAT);
    playable += status == HAP_OK;
  }
  CHECK(playable > raw_size / 200);
  write_raw(raw_size - 1);
  CHECK(try_open(0, &detail) == HAP_ERROR_FORMAT);
  replay again = recorded_play("row10", HAP_PLAY_INCOMPLETE);
  CHECK(again.status == HAP_END && again.difference.what == HAP_DIFFERENCE_NONE);
  CHECK(again.stats.loop.ticks > 250);
  write_raw(raw_size);
  CHECK(try_open(0, &detail) == HAP_OK);
}

TEST(every_changed_byte_is_noticed)
{
  hap_detail detail;
  file f = file_fresh("fig5", 200);
  file_release(&f);
  for (size_t at = 0; at < raw_size; at += at < 500 ? 1 : 97) {
    raw[at] = (char)(raw[at] ^ 0x10);
    write_raw(raw_size);
    hap_status status = try_open(0, &detail);
    CHECK(status == HAP_ERROR_FORMAT || status == HAP_ERROR_UNSUPPORTED);
    raw[at] = (char)(raw[at] ^ 0x10);
  }
  raw[raw_size] = 'x';
  write_raw(raw_size + 1);
  CHECK(try_open(0, &detail) == HAP_ERROR_FORMAT && strstr(detail.text, "follows") != NULL);
}

TEST(blocks_in_another_order_are_noticed)
{
  hap_detail detail;
  file f = file_fresh("fig5", 600);
  block kept = f.blocks[2];
  f.blocks[2] = f.blocks[3];
  f.blocks[3] = kept;
  file_pack(&f);
  CHECK(try_open(0, &detail) == HAP_ERROR_FORMAT &&
        strstr(detail.text, "missing or twice") != NULL);
  file_release(&f);
}

/* ---- the recorder by itself ---- */

/* 3000 ticks of nothing; what the file came to. */
static hapi_recorder_state record_ticks(uint64_t max_bytes)
{
  hapi_recorder *recorder = NULL;
  hapi_recorder_state state = {0};
  hap_detail detail;
  hapi_recorder_config config = {
      .path = recorded_path, .max_bytes = max_bytes, .cells = {4096, 64, 64}};
  hapi_file_describe(&config.info);
  snprintf(config.info.build.ode, sizeof config.info.build.ode, "%s", dGetConfiguration());
  if (hapi_recorder_create(&config, &recorder, &detail) != HAP_OK) {
    return state;
  }
  hapi_tape *tape = hapi_recorder_tape(recorder, HAPI_STREAM_HAPTIC);
  for (int i = 0; i <= 3000; ++i) {
    hapi_tape_open(tape);
    hapi_cell *cell = hapi_tape_put(tape, i == 0 ? HAPI_CELL_BEGIN : HAPI_CELL_TICK, 0);
    cell->i[HAPI_TICK_WINDOW] = i;
    cell->i[HAPI_TICK_TIME] = i;
    hapi_tape_commit(tape);
  }
  CHECK(hapi_recorder_start(recorder) == HAP_OK);
  hapi_recorder_stop(recorder);
  state = hapi_recorder_look(recorder);
  hapi_recorder_destroy(recorder);
  return state;
}

TEST(no_file_is_larger_than_its_limit)
{
  hap_detail detail;
  hapi_recorder_state whole = record_ticks(1 << 20);
  CHECK(whole.end == HAPI_RECORD_STOPPED && whole.ticks == 3000);
  CHECK(try_open(0, &detail) == HAP_OK && read_raw() && raw_size == whole.bytes);
  hapi_recorder_state exact = record_ticks(whole.bytes);
  CHECK(exact.end == HAPI_RECORD_STOPPED && exact.bytes == whole.bytes);
  for (uint64_t less = 1; less < 200; less += 11) {
    hapi_recorder_state cut = record_ticks(whole.bytes - less);
    CHECK(cut.end == HAPI_RECORD_LIMIT && cut.bytes <= whole.bytes - less && cut.ticks < 3000);
    CHECK(try_open(0, &detail) == HAP_OK);
  }
}

TEST(a_ring_that_is_full_ends_the_recording)
{
  _Atomic int ended = 0;
  hapi_tape tape;
  hapi_cell cells[64];
  REQUIRE(hapi_tape_create(&tape, 64, &ended) == HAP_OK);
  for (int i = 0; i < 10; ++i) { /* packets of seven: nine have room */
    hapi_tape_open(&tape);
    for (int k = 0; k < 7; ++k) {
      hapi_tape_put(&tape, HAPI_CELL_TICK, 0)->i[0] = 7 * i + k;
    }
    hapi_tape_commit(&tape);
  }
  CHECK(atomic_load(&ended) == HAPI_RECORD_OVERFLOW && atomic_load(&tape.lost) == 1);
  CHECK(hapi_tape_take(&tape, cells, 64) == 63); /* and none of the tenth */
  for (int i = 0; i < 63; ++i) {
    CHECK(cells[i].i[0] == i);
  }
  hapi_tape_open(&tape); /* there is room now, but a gap before it */
  (void)hapi_tape_put(&tape, HAPI_CELL_TICK, 0);
  hapi_tape_commit(&tape);
  CHECK(hapi_tape_take(&tape, cells, 64) == 0 && atomic_load(&tape.lost) == 2);
  hapi_tape_finish(&tape);
}

/* ---- of somebody else ---- */

static hap_status open_changed(file *f, const char *says)
{
  hap_detail detail;
  file_pack(f);
  hap_status status = try_open(0, &detail);
  if (strstr(detail.text, says) == NULL) {
    printf("# \"%s\" does not say \"%s\"\n", detail.text, says);
    CHECK(!"the text");
  }
  return status;
}

TEST(another_machine_version_or_library_is_told)
{
  file f = file_fresh("fig5", 100);
  hapi_file_info *info = (hapi_file_info *)(void *)f.blocks[0].bytes;
  f.head.byte_order = 0x04030201u;
  CHECK(open_changed(&f, "other byte order") == HAP_ERROR_UNSUPPORTED);
  f.head.byte_order = HAPI_FILE_BYTE_ORDER;
  f.head.version = 3;
  CHECK(open_changed(&f, "of version 3 of the file format") == HAP_ERROR_UNSUPPORTED);
  f.head.version = 2;
  char kept = info->build.machine[0];
  info->build.machine[0] = 'Z';
  CHECK(open_changed(&f, "a machine of type \"Z") == HAP_ERROR_UNSUPPORTED);
  info->build.machine[0] = kept;
  info->build.library[0] = '7';
  CHECK(open_changed(&f, "the library's version \"7") == HAP_ERROR_UNSUPPORTED);
  info->build.library[0] = '0';
  info->build.ode[0] = '?';
  CHECK(open_changed(&f, "an ODE of configuration") == HAP_ERROR_UNSUPPORTED);
  memset(info->build.ode, 'x', sizeof info->build.ode);
  CHECK(open_changed(&f, "in a form that there is not") == HAP_ERROR_FORMAT);
  file_release(&f);
}

/* What it has not is as it was before there was a choice. */
TEST(a_file_of_before_plays)
{
  file f = file_fresh("row10", 300);
  block *b = &f.blocks[0];
  uint32_t more = (uint32_t)(sizeof(hapi_file_info) - HAPI_FILE_INFO_LEAST);
  b->head.size -= more;
  char *bytes = (char *)b->bytes;
  memmove(bytes + HAPI_FILE_INFO_LEAST, bytes + sizeof(hapi_file_info),
          b->head.size - HAPI_FILE_INFO_LEAST);
  file_pack(&f);
  replay again = recorded_play("row10", 0);
  hap_player *player = NULL;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  session_defs_init(&def, &expert, &research);
  CHECK(again.status == HAP_END && again.difference.what == HAP_DIFFERENCE_NONE);
  REQUIRE(hap_player_open(recorded_path, HAP_PLAY_WHOLE, &player, NULL) == HAP_OK);
  CHECK(hap_player_get_def(player, &def, &expert, &research) == HAP_OK);
  CHECK(expert.max_sweeps == 0 && expert.range_hops == HAP_RANGE_ALL && expert.reuse == 0.0);
  hap_player_close(player);
  b->head.size = HAPI_FILE_INFO_LEAST - 4;
  CHECK(open_changed(&f, "what was recorded") == HAP_ERROR_FORMAT);
  file_release(&f);
}

TEST(another_scene_is_told)
{
  file f = file_fresh("row10", 200);
  file_release(&f);
  replay again = recorded_play("stack", 0);
  CHECK(again.status == HAP_ERROR_WORLD && again.stats.loop.ticks == 0);
  CHECK(strstr(again.detail.text, "it had 10 bodies with 11 geoms") != NULL);
  again = recorded_play("row10:9", 0);
  CHECK(again.status == HAP_ERROR_WORLD);
  f = file_fresh("fig5", 200);
  file_release(&f);
  again = recorded_play("fig6", 0); /* one cube as well */
  CHECK(again.status == HAP_ERROR_WORLD);
}

TEST(no_file_and_no_recording)
{
  hap_detail detail;
  snprintf(raw, sizeof raw, "t,x,y,z\n0,0,0,0\n1,1,1,1\nand more than thirty-two bytes\n");
  write_raw(strlen(raw));
  CHECK(try_open(0, &detail) == HAP_ERROR_FORMAT && strstr(detail.text, "no recording") != NULL);
  unlink(recorded_path);
  CHECK(try_open(0, &detail) == HAP_ERROR_IO && strstr(detail.text, "cannot be opened") != NULL);
  hap_player *player = NULL;
  CHECK(hap_player_open(recorded_path, 2, &player, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(hap_player_open("/", HAP_PLAY_WHOLE, &player, &detail) == HAP_ERROR_IO);
}

SET_UP
{
  return recorded_init();
}
