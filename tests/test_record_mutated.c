/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Recordings that were changed with knowledge of their form are played: right sums and counts, but
 * packets lost, doubled, exchanged or elsewhere, fields of extreme or borrowed values, blocks in
 * parts. A replay ends, with a reason or at its end, within seconds; SIGALRM ends this program
 * otherwise. Argument: long. */

#include "tests/tap.h"

#include <signal.h>
#include <unistd.h>

#include "tests/recorded_file.h"

#define PLAY_S 60 /* a replay takes about 0.1 s; a sanitizer and a busy machine are slower */
#define CHANGES_MOST 4

typedef struct cells {
  hapi_cell *of;
  uint32_t count;
  uint32_t room;
  hapi_stream stream;
} cells;

typedef struct mutator {
  file f;
  cells streams[HAPI_STREAMS];
  uint32_t random; /* Marsaglia's xorshift of 32 bits */
} mutator;

static uint32_t random_below(mutator *m, uint32_t sides)
{
  m->random ^= m->random << 13;
  m->random ^= m->random >> 17;
  m->random ^= m->random << 5;
  return m->random % sides;
}

/* ---- cells, stream by stream ---- */

static void streams_gather(mutator *m)
{
  for (int s = 0; s < HAPI_STREAMS; ++s) {
    cells *c = &m->streams[s];
    c->stream = (hapi_stream)s;
    c->count = 0;
    for (uint32_t i = 0; i < m->f.count; ++i) {
      const block *b = &m->f.blocks[i];
      c->room += b->head.type == HAPI_BLOCK_CELLS_OF + (uint32_t)s ? b->head.size / 64 + 64 : 0;
    }
    c->of = calloc(c->room + 64, sizeof *c->of);
    for (uint32_t i = 0; i < m->f.count; ++i) {
      const block *b = &m->f.blocks[i];
      if (b->head.type == HAPI_BLOCK_CELLS_OF + (uint32_t)s) {
        memcpy(c->of + c->count, b->bytes, b->head.size);
        c->count += b->head.size / 64;
      }
    }
  }
}

/* The cells that a packet has: its first one says how many follow, or it stands alone. */
static uint32_t packet_length(const cells *c, uint32_t at)
{
  bool leads = c->of[at].kind == HAPI_CELL_BEGIN || c->of[at].kind == HAPI_CELL_TICK;
  uint32_t length = leads && c->of[at].word < c->count ? 1 + c->of[at].word : 1;
  return at + length <= c->count ? length : c->count - at;
}

static uint32_t packet_any(mutator *m, const cells *c)
{
  uint32_t wanted = random_below(m, c->count);
  uint32_t at = 0;
  while (at + packet_length(c, at) <= wanted) {
    at += packet_length(c, at);
  }
  return at;
}

static void cells_remove(cells *c, uint32_t at, uint32_t count)
{
  memmove(c->of + at, c->of + at + count, (c->count - at - count) * sizeof *c->of);
  c->count -= count;
}

static void cells_insert(cells *c, uint32_t at, const hapi_cell *some, uint32_t count)
{
  if (c->count + count > c->room) {
    return;
  }
  memmove(c->of + at + count, c->of + at, (c->count - at) * sizeof *c->of);
  memcpy(c->of + at, some, count * sizeof *c->of);
  c->count += count;
}

/* ---- changes ---- */

static void field_change(mutator *m, hapi_cell *cell, const hapi_cell *other)
{
  static const uint64_t extremes[] = {0,
                                      1,
                                      2,
                                      0x7fffffffffffffff,
                                      0x8000000000000000,
                                      ~0ull,
                                      0x7ff0000000000000 /* infinity */,
                                      0x7ff8000000000000 /* NaN */,
                                      0x7fe0000000000000 /* 9e307 */,
                                      0x0000000000000001, /* denormal */
                                      0xffffffff,
                                      0x100000000,
                                      1000000,
                                      0x4059000000000000};
  uint32_t place = random_below(m, 7);
  switch (random_below(m, 7)) {
    case 0:
      cell->u[place] = other->u[place];
      break;
    case 1:
      cell->u[place] += random_below(m, 2) != 0 ? 1 : (uint64_t)-1;
      break;
    case 2:
      cell->u[place] ^= 1ull << random_below(m, 64);
      break;
    case 3:
      cell->word =
          random_below(m, 2) != 0 ? random_below(m, 70) : (uint32_t)extremes[random_below(m, 14)];
      break;
    case 4:
      cell->index = (uint8_t)(random_below(m, 2) != 0 ? random_below(m, 3) : random_below(m, 256));
      break;
    case 5:
      cell->flags =
          (uint16_t)(random_below(m, 2) != 0 ? random_below(m, 4) : random_below(m, 65536));
      break;
    default:
      cell->u[place] = extremes[random_below(m, 14)];
      break;
  }
}

static void packet_change(mutator *m, cells *c)
{
  hapi_cell kept[600];
  uint32_t at = packet_any(m, c);
  uint32_t length = packet_length(c, at);
  if (length > 600) {
    return;
  }
  memcpy(kept, c->of + at, length * sizeof *kept);
  switch (random_below(m, 4)) {
    case 0: /* lost */
      cells_remove(c, at, length);
      break;
    case 1: /* doubled */
      cells_insert(c, at, kept, length);
      break;
    case 2: /* exchanged with the next one */
      if (at + length < c->count) {
        uint32_t next = packet_length(c, at + length);
        memmove(c->of + at, c->of + at + length, next * sizeof *kept);
        memcpy(c->of + at + next, kept, length * sizeof *kept);
      }
      break;
    default: /* elsewhere */
      cells_remove(c, at, length);
      cells_insert(c, c->count > 0 ? packet_any(m, c) : 0, kept, length);
      break;
  }
}

/* Of one cell in a packet, whose count is right afterwards. */
static void part_change(mutator *m, cells *c)
{
  uint32_t at = packet_any(m, c);
  uint32_t length = packet_length(c, at);
  if (length < 2) {
    return;
  }
  uint32_t part = at + 1 + random_below(m, length - 1);
  hapi_cell kept = c->of[part];
  switch (random_below(m, 4)) {
    case 0:
      cells_remove(c, part, 1);
      --c->of[at].word;
      break;
    case 1:
      ++c->of[at].word;
      cells_insert(c, part, &kept, 1);
      break;
    case 2: {
      uint32_t other = at + 1 + random_below(m, length - 1);
      c->of[part] = c->of[other];
      c->of[other] = kept;
      break;
    }
    default:
      c->of[part].kind =
          (uint8_t)(random_below(m, 2) != 0 ? 1 + random_below(m, 10) : random_below(m, 256));
      break;
  }
}

static void cells_change(mutator *m)
{
  cells *c =
      &m->streams[random_below(m, 4) == 0 ? random_below(m, HAPI_STREAMS) : HAPI_STREAM_HAPTIC];
  if (c->count < 4) {
    return;
  }
  uint32_t way = random_below(m, 10);
  if (way < 5) {
    field_change(m, &c->of[random_below(m, c->count)], &c->of[random_below(m, c->count)]);
  } else if (way < 7) {
    packet_change(m, c);
  } else if (way < 9) {
    part_change(m, c);
  } else {
    c->count -= 1 + random_below(m, c->count / 2); /* it ends early */
  }
}

/* ---- the file again ---- */

/* Blocks of the lengths that they had, the last one of a stream of what is left; counts at the end
 * as they are now, but for one file in eight. */
static void streams_scatter(mutator *m)
{
  uint32_t taken[HAPI_STREAMS] = {0, 0, 0};
  uint32_t last[HAPI_STREAMS] = {0, 0, 0};
  for (uint32_t i = 0; i < m->f.count; ++i) {
    uint32_t stream = m->f.blocks[i].head.type - HAPI_BLOCK_CELLS_OF;
    if (stream < HAPI_STREAMS) {
      last[stream] = i;
    }
  }
  for (uint32_t i = 0; i < m->f.count; ++i) {
    block *b = &m->f.blocks[i];
    uint32_t s = b->head.type - HAPI_BLOCK_CELLS_OF;
    if (s < HAPI_STREAMS) {
      uint32_t left = m->streams[s].count - taken[s];
      uint32_t most = i == last[s] ? HAPI_BLOCK_CELLS : b->head.size / 64;
      uint32_t count = left < most ? left : most;
      b->head.size = count * 64;
      b->bytes = realloc(b->bytes, b->head.size + 1);
      memcpy(b->bytes, m->streams[s].of + taken[s], b->head.size);
      taken[s] += count;
    }
    if (b->head.type == HAPI_BLOCK_END && random_below(m, 8) != 0) {
      hapi_file_end *end = (hapi_file_end *)(void *)b->bytes;
      end->ticks = 0;
      for (uint32_t k = 0; k < m->streams[HAPI_STREAM_HAPTIC].count; ++k) {
        end->ticks += m->streams[HAPI_STREAM_HAPTIC].of[k].kind == HAPI_CELL_TICK;
      }
      for (int k = 0; k < HAPI_STREAMS; ++k) {
        end->cells[k] = m->streams[k].count;
      }
    }
  }
}

static void mutator_release(mutator *m)
{
  for (int s = 0; s < HAPI_STREAMS; ++s) {
    free(m->streams[s].of);
  }
  file_release(&m->f);
}

/* ---- plays ---- */

typedef struct tally {
  int refused; /* when opened */
  int ended;
  int diverged;
  int failed; /* while played */
} tally;

static void play_mutated(const char *scene_name, uint32_t seed, tally *t)
{
  static mutator m; /* large */
  memset(&m, 0, sizeof m);
  m.random = 2654435761u * (seed + 1) | 1u;
  REQUIRE(read_raw() && file_unpack(&m.f));
  streams_gather(&m);
  uint32_t changes = 1 + random_below(&m, CHANGES_MOST);
  for (uint32_t i = 0; i < changes; ++i) {
    cells_change(&m);
  }
  streams_scatter(&m);
  file_pack(&m.f);
  (void)alarm(PLAY_S);
  replay again =
      recorded_play(scene_name, random_below(&m, 2) != 0 ? HAP_PLAY_INCOMPLETE : HAP_PLAY_WHOLE);
  (void)alarm(0);
  bool told = again.status == HAP_END || again.status == HAP_DIVERGED ||
              (again.status < HAP_OK && again.detail.text[0] != '\0');
  CHECK_SAY(told, "%s, seed %u: %s", scene_name, seed, hap_status_name(again.status));
  bool opened = again.info.size > 0;
  t->refused += !opened;
  t->ended += again.status == HAP_END && again.difference.what == HAP_DIFFERENCE_NONE;
  t->diverged += opened && again.difference.what != HAP_DIFFERENCE_NONE;
  t->failed += opened && again.status < HAP_OK;
  mutator_release(&m);
}

TEST(a_replay_ends_whatever_its_packets_are)
{
  static const char *const scenes[] = {"stack", "row10", "lever", "grasp"};
  bool is_long = strcmp(tap_argument, "long") == 0;
  const uint32_t times = is_long ? 2000 : 30;
  tally t = {0, 0, 0, 0};
  for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; ++i) {
    file f = file_fresh(scenes[i], 120);
    file_release(&f);
    size_t size = raw_size;
    char *kept = malloc(size);
    REQUIRE(kept != NULL);
    memcpy(kept, raw, size);
    for (uint32_t seed = 0; seed < times; ++seed) {
      memcpy(raw, kept, size);
      write_raw(size);
      play_mutated(scenes[i], seed, &t);
    }
    free(kept);
  }
  printf("# %d refused, %d play as before, %d diverge, %d fail while played\n", t.refused, t.ended,
         t.diverged, t.failed);
  CHECK(t.refused > 0 && t.diverged > 0);
  CHECK(t.refused < 4 * (int)times * 9 / 10); /* what is refused at once tests little */
}
SET_UP
{
  return recorded_init();
}
