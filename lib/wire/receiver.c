/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "wire/receiver.h"

#include <stdarg.h>
#include <stdio.h>

#include "base/alloc.h"
#include "base/assert.h"

#define FRAMES (HAPI_WIRE_KEPT + 1)

bool hapi_wire_receiver_create(hapi_wire_receiver *receiver, uint32_t channel, uint32_t first,
                               uint32_t end, const hapi_capacity *capacity)
{
  memset(receiver, 0, sizeof *receiver);
  receiver->channel = channel;
  hapi_wire_shape_init(&receiver->shape, first, end, capacity);
  const hapi_wire_shape *shape = &receiver->shape;
  bool good = true;
  receiver->directory_size = HAPI_CODE_MOST;
  for (uint32_t i = first; i < end; ++i) {
    receiver->records_most += shape->most[i];
    receiver->directory_size += 2 * HAPI_CODE_MOST * ((size_t)shape->most[i] + 1);
    if (hapi_wire_records[i].known) {
      receiver->known[i] = hapi_alloc_late(shape->labels[i], shape->cells[i] * sizeof(uint64_t));
      receiver->serials[i] = hapi_alloc_array(shape->labels[i], sizeof(uint64_t));
      good = good && receiver->known[i] != NULL && receiver->serials[i] != NULL;
    }
  }
  for (uint32_t i = 0; i < FRAMES; ++i) {
    good = good && hapi_wire_frame_create(&receiver->frames[i], shape);
  }
  receiver->gatherings = hapi_alloc_late(HAPI_WIRE_GATHERINGS, sizeof *receiver->gatherings);
  receiver->directory = hapi_alloc(receiver->directory_size);
  receiver->lost = hapi_alloc_late(receiver->records_most, sizeof *receiver->lost);
  return good && receiver->gatherings != NULL && receiver->directory != NULL &&
         receiver->lost != NULL;
}

void hapi_wire_receiver_finish(hapi_wire_receiver *receiver)
{
  for (uint32_t i = 0; i < HAPI_WIRE_KINDS; ++i) {
    hapi_free(receiver->known[i]);
    hapi_free(receiver->serials[i]);
  }
  for (uint32_t i = 0; i < FRAMES; ++i) {
    hapi_wire_frame_finish(&receiver->frames[i]);
  }
  hapi_free(receiver->gatherings);
  hapi_free(receiver->directory);
  hapi_free(receiver->lost);
  memset(receiver, 0, sizeof *receiver);
}

static hap_status receiver_refuse(hapi_wire_receiver *receiver, hap_detail *detail,
                                  const char *format, ...) HAP_PRINTF(3, 4);
static hap_status receiver_refuse(hapi_wire_receiver *receiver, hap_detail *detail,
                                  const char *format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  (void)vsnprintf(detail->text, sizeof detail->text, format, arguments);
  va_end(arguments);
  ++receiver->refused;
  return HAP_ERROR_FORMAT;
}

/* ---- descriptions ---- */

/* The records of a reliable message; tell: they are taken over. NULL: they are good. */
static const char *learn_records(const hapi_wire_receiver *receiver, hapi_code_reader r,
                                 uint64_t serial, bool tell, uint64_t *out_next)
{
  const hapi_wire_shape *shape = &receiver->shape;
  while (r.at != r.end) {
    uint64_t cells[HAPI_WIRE_CELLS_MOST] = {0};
    uint32_t kind = hapi_code_take_most(&r, HAPI_WIRE_KINDS - 1);
    if (r.bad || kind < shape->first || kind >= shape->end || !hapi_wire_records[kind].known) {
      return "of a kind that is not described";
    }
    uint32_t label = hapi_code_take_most(&r, UINT32_MAX);
    if (r.bad || label >= shape->labels[kind]) {
      return "with a label beyond the capacity";
    }
    hapi_wire_delta_take(&r, shape->by_xor[kind], shape->cells[kind], cells);
    if (r.bad) {
      return "cut off, or with too many cells";
    }
    const char *bad = hapi_wire_check((hapi_wire_kind)kind, cells);
    if (bad != NULL) {
      return bad;
    }
    if (tell) {
      memcpy(receiver->known[kind] + (size_t)label * shape->cells[kind], cells,
             shape->cells[kind] * sizeof *cells);
      receiver->serials[kind][label] = serial;
    }
    ++serial;
  }
  *out_next = serial;
  return NULL;
}

static hap_status gathering_try(hapi_wire_receiver *receiver, hapi_wire_gathering *g, bool lacking,
                                hap_detail *detail);
static bool gathering_is_whole(const hapi_wire_gathering *g);

hap_status hapi_wire_receiver_learn(hapi_wire_receiver *receiver, const uint8_t *data,
                                    uint32_t bytes, hap_detail *detail)
{
  hapi_code_reader r = {data, data + bytes, false};
  uint8_t version = hapi_code_take_byte(&r);
  uint8_t channel = hapi_code_take_byte(&r);
  uint64_t serial = hapi_code_take(&r);
  if (r.bad || version != HAPI_WIRE_VERSION) {
    return receiver_refuse(receiver, detail,
                           "description of version %u, this end reads version %u: both ends need "
                           "the same release of hapode",
                           version, HAPI_WIRE_VERSION);
  }
  if (channel != HAPI_WIRE_CHANNEL_KNOWN || serial == 0 || r.at == r.end) {
    return receiver_refuse(receiver, detail, "a message of %u bytes that is no description", bytes);
  }
  if (serial <= receiver->serial) {
    ++receiver->late;
    return HAP_OK;
  }
  if (serial != receiver->serial + 1) {
    return receiver_refuse(receiver, detail,
                           "descriptions from number %llu on, where number %llu comes next: the "
                           "link has lost some",
                           (unsigned long long)serial, (unsigned long long)receiver->serial + 1);
  }
  uint64_t next = serial;
  const char *bad = learn_records(receiver, r, serial, false, &next);
  if (bad != NULL) {
    return receiver_refuse(receiver, detail, "a description is refused: %s", bad);
  }
  (void)learn_records(receiver, r, serial, true, &next);
  receiver->serial = next - 1;
  for (uint32_t i = 0; i < HAPI_WIRE_GATHERINGS; ++i) { /* some may have waited for it */
    hapi_wire_gathering *g = &receiver->gatherings[i];
    if (g->number != 0 && !g->done && gathering_is_whole(g)) {
      hap_status status = gathering_try(receiver, g, false, detail);
      if (status < HAP_OK) {
        return status;
      }
    }
  }
  return HAP_OK;
}

/* ---- a datagram ---- */

typedef struct datagram {
  uint8_t flags;
  uint8_t part;
  uint64_t number;
  uint64_t base;
  uint64_t serial;
  uint64_t ack;
  uint32_t directory;
  uint32_t chunk;
  uint64_t from;
  uint32_t count;
  const uint8_t *chunk_at;
  hapi_code_reader records;
} datagram;

static bool datagram_read(const hapi_wire_receiver *receiver, const uint8_t *data, uint32_t bytes,
                          datagram *out)
{
  hapi_code_reader r = {data, data + bytes, false};
  (void)hapi_code_take_byte(&r);
  (void)hapi_code_take_byte(&r);
  out->flags = hapi_code_take_byte(&r);
  out->part = hapi_code_take_byte(&r);
  out->number = hapi_code_take(&r);
  uint64_t back = hapi_code_take(&r);
  out->base = back != 0 ? out->number - back : 0;
  out->serial = hapi_code_take(&r);
  out->ack = hapi_code_take(&r);
  out->directory = hapi_code_take_most(&r, (uint32_t)receiver->directory_size);
  out->chunk = hapi_code_take_most(&r, HAPI_WIRE_DATAGRAM);
  out->from = hapi_code_take(&r);
  out->count = hapi_code_take_most(&r, HAPI_WIRE_DATAGRAM);
  if (r.bad || (out->flags & ~(HAPI_WIRE_KEEP | HAPI_WIRE_LAST)) != 0 || out->number == 0 ||
      (back != 0 && back >= out->number) || out->chunk > (size_t)(r.end - r.at) ||
      out->chunk > out->directory || out->from > receiver->records_most) {
    return false;
  }
  out->chunk_at = r.at;
  r.at += out->chunk;
  out->records = r;
  return true;
}

static bool gathering_is_whole(const hapi_wire_gathering *g)
{
  return g->last != 0 && g->parts == g->last;
}

/* ---- a frame of datagrams ---- */

static hapi_wire_frame *receiver_frame(hapi_wire_receiver *receiver, uint64_t number)
{
  for (uint32_t i = 0; i < FRAMES; ++i) {
    if (receiver->kept[i] && receiver->frames[i].number == number) {
      return &receiver->frames[i];
    }
  }
  return NULL;
}

/* One that is not kept and not the last accepted one; else the oldest that may go. */
static uint32_t receiver_free_frame(const hapi_wire_receiver *receiver, uint64_t base)
{
  uint32_t oldest = FRAMES;
  for (uint32_t i = 0; i < FRAMES; ++i) {
    const hapi_wire_frame *frame = &receiver->frames[i];
    if (frame == receiver->last || (receiver->kept[i] && frame->number == base)) {
      continue;
    }
    if (!receiver->kept[i]) {
      return i;
    }
    if (oldest == FRAMES || frame->number < receiver->frames[oldest].number) {
      oldest = i;
    }
  }
  HAPI_ASSERT(oldest < FRAMES);
  return oldest;
}

/* The directory, as far as its pieces follow each other. */
static bool directory_join(const hapi_wire_receiver *receiver, const hapi_wire_gathering *g,
                           hapi_code_reader *out)
{
  size_t at = 0;
  for (uint32_t i = 0; i < HAPI_WIRE_PARTS && at < g->directory && g->sizes[i] != 0; ++i) {
    datagram d;
    if (!datagram_read(receiver, g->bytes[i], g->sizes[i], &d) || d.chunk > g->directory - at) {
      return false;
    }
    memcpy(receiver->directory + at, d.chunk_at, d.chunk);
    at += d.chunk;
  }
  *out = (hapi_code_reader){receiver->directory, receiver->directory + at, false};
  return at == g->directory;
}

static bool list_add(const hapi_wire_receiver *receiver, hapi_wire_frame *frame,
                     hapi_wire_kind kind, uint64_t label)
{
  if (label >= receiver->shape.labels[kind] ||
      hapi_wire_place(frame, kind, (uint32_t)label) != HAPI_WIRE_NOWHERE) {
    return false;
  }
  (void)hapi_wire_frame_add(frame, &receiver->shape, kind, (uint32_t)label);
  return true;
}

static bool list_take(const hapi_wire_receiver *receiver, hapi_code_reader *r,
                      const hapi_wire_frame *base, hapi_wire_kind kind, hapi_wire_frame *frame)
{
  uint32_t count = hapi_code_take_most(r, receiver->shape.most[kind]);
  uint64_t last = 0;
  while (!r->bad && frame->counts[kind] < count) {
    uint64_t code = hapi_code_take(r);
    if ((code & 1u) == 0) {
      uint64_t label = last + hapi_code_unfold(code >> 1);
      if (r->bad || !list_add(receiver, frame, kind, label)) {
        return false;
      }
    } else {
      uint64_t run = code >> 1;
      uint64_t from = hapi_code_take(r);
      if (r->bad || base == NULL || run == 0 || run > count - frame->counts[kind] ||
          from > base->counts[kind] || run > base->counts[kind] - from) {
        return false;
      }
      for (uint64_t i = 0; i < run; ++i) {
        if (!list_add(receiver, frame, kind, base->labels[kind][from + i])) {
          return false;
        }
      }
    }
    last = (uint64_t)frame->labels[kind][frame->counts[kind] - 1] + 1;
  }
  return !r->bad;
}

static bool lists_take(const hapi_wire_receiver *receiver, hapi_code_reader r,
                       const hapi_wire_frame *base, hapi_wire_frame *frame)
{
  const hapi_wire_shape *shape = &receiver->shape;
  uint64_t changed = hapi_code_take(&r);
  hapi_wire_frame_clear(frame);
  if (r.bad || changed >> (shape->end - shape->first) != 0) {
    return false;
  }
  for (uint32_t i = shape->first; i < shape->end; ++i) {
    hapi_wire_kind kind = (hapi_wire_kind)i;
    if ((changed >> (i - shape->first) & 1u) != 0) {
      if (!list_take(receiver, &r, base, kind, frame)) {
        return false;
      }
    } else if (base != NULL) {
      for (uint32_t k = 0; k < base->counts[kind]; ++k) {
        (void)hapi_wire_frame_add(frame, shape, kind, base->labels[kind][k]);
      }
    }
  }
  return r.at == r.end;
}

/* What a record is told against, as in sender.c. NULL: its description has been replaced, the
 * datagram is too old. */
static const uint64_t *record_before(const hapi_wire_receiver *receiver,
                                     const hapi_wire_frame *base, hapi_wire_kind kind,
                                     uint32_t label, uint64_t serial)
{
  uint32_t place = base != NULL ? hapi_wire_place(base, kind, label) : HAPI_WIRE_NOWHERE;
  if (place != HAPI_WIRE_NOWHERE) {
    return hapi_wire_cells_at(base, &receiver->shape, kind, place);
  }
  if (receiver->known[kind] == NULL) {
    return hapi_wire_zeros;
  }
  uint64_t described = receiver->serials[kind][label];
  return described != 0 && described <= serial
             ? receiver->known[kind] + (size_t)label * receiver->shape.cells[kind]
             : NULL;
}

/* Why a frame is not given. */
typedef enum outcome {
  OUTCOME_GOOD,
  OUTCOME_WAIT, /* something may come */
  OUTCOME_DROP, /* nothing will make it of use */
  OUTCOME_BAD   /* malformed */
} outcome;

static outcome frame_begin(const hapi_wire_receiver *receiver, const hapi_wire_gathering *g,
                           const hapi_wire_frame *base, hapi_wire_frame *frame)
{
  const hapi_wire_shape *shape = &receiver->shape;
  for (uint32_t i = shape->first; i < shape->end; ++i) {
    hapi_wire_kind kind = (hapi_wire_kind)i;
    for (uint32_t k = 0; k < frame->counts[kind]; ++k) {
      const uint64_t *before =
          record_before(receiver, base, kind, frame->labels[kind][k], g->serial);
      if (before == NULL) {
        return OUTCOME_DROP;
      }
      memcpy(hapi_wire_cells_at(frame, shape, kind, k), before,
             shape->cells[kind] * sizeof *before);
    }
  }
  return OUTCOME_GOOD;
}

/* Cells of a record by its number in the frame; the reader is bad where there is none. */
static uint64_t *frame_record(const hapi_wire_receiver *receiver, const hapi_wire_frame *frame,
                              uint64_t index, hapi_wire_kind *out_kind)
{
  for (uint32_t i = receiver->shape.first; i < receiver->shape.end; ++i) {
    if (index < frame->counts[i]) {
      *out_kind = (hapi_wire_kind)i;
      return hapi_wire_cells_at(frame, &receiver->shape, *out_kind, (uint32_t)index);
    }
    index -= frame->counts[i];
  }
  return NULL;
}

static uint64_t frame_size(const hapi_wire_receiver *receiver, const hapi_wire_frame *frame)
{
  uint64_t count = 0;
  for (uint32_t i = receiver->shape.first; i < receiver->shape.end; ++i) {
    count += frame->counts[i];
  }
  return count;
}

/* Reads the records of a part. *io_next: the first record that no part has spoken of yet. */
static const char *part_take(const hapi_wire_receiver *receiver, const datagram *d,
                             const hapi_wire_frame *frame, uint64_t *io_next)
{
  hapi_code_reader r = d->records;
  uint64_t next = d->from;
  if (next < *io_next) {
    return "the parts overlap";
  }
  for (uint32_t i = 0; i < d->count; ++i) {
    hapi_wire_kind kind;
    uint64_t gap = hapi_code_take(&r);
    uint64_t *cells = r.bad || gap > receiver->records_most
                          ? NULL
                          : frame_record(receiver, frame, next + gap, &kind);
    if (cells == NULL) {
      return "there is no such record";
    }
    hapi_wire_delta_take(&r, receiver->shape.by_xor[kind], receiver->shape.cells[kind], cells);
    if (r.bad) {
      return "a record is cut off, or has too many cells";
    }
    const char *bad = hapi_wire_check(kind, cells);
    if (bad != NULL) {
      return bad;
    }
    next += gap + 1;
  }
  *io_next = next;
  return r.at == r.end ? NULL : "bytes follow its records";
}

static const char *parts_take(const hapi_wire_receiver *receiver, const hapi_wire_gathering *g,
                              const hapi_wire_frame *frame)
{
  uint64_t next = 0;
  uint64_t size = frame_size(receiver, frame);
  bool gap = false;
  memset(receiver->lost, 0, size * sizeof *receiver->lost);
  for (uint32_t i = 0; i < (g->last != 0 ? g->last : HAPI_WIRE_PARTS); ++i) {
    datagram d;
    if (g->sizes[i] == 0) {
      gap = true;
      continue;
    }
    if (!datagram_read(receiver, g->bytes[i], g->sizes[i], &d) || d.from > size) {
      return "there is no such record";
    }
    for (uint64_t k = next; gap && k < d.from; ++k) {
      receiver->lost[k] = true;
    }
    gap = false;
    const char *bad = part_take(receiver, &d, frame, &next);
    if (bad != NULL) {
      return bad;
    }
  }
  for (uint64_t k = next; gap && k < size; ++k) {
    receiver->lost[k] = true;
  }
  return NULL;
}

/* What a message is nothing without: heads, hands, and what bodies answer by. */
static bool kind_is_needed(hapi_wire_kind kind)
{
  return kind == HAPI_WIRE_MODEL || kind == HAPI_WIRE_NEAR || kind == HAPI_WIRE_RESPONSE ||
         kind == HAPI_WIRE_MEASURED || kind == HAPI_WIRE_STATE || kind == HAPI_WIRE_POINTER;
}

/* Where a record of a lost datagram is known from. NULL: from nowhere. */
static const uint64_t *record_known(const hapi_wire_receiver *receiver, const hapi_wire_frame *base,
                                    const hapi_wire_frame *frame, hapi_wire_kind kind,
                                    uint32_t place)
{
  const hapi_wire_frame *last = receiver->last;
  uint32_t label = frame->labels[kind][place];
  uint32_t in_last = last != NULL ? hapi_wire_place(last, kind, label) : HAPI_WIRE_NOWHERE;
  if (in_last != HAPI_WIRE_NOWHERE) {
    return hapi_wire_cells_at(last, &receiver->shape, kind, in_last);
  }
  bool begun = receiver->known[kind] != NULL ||
               (base != NULL && hapi_wire_place(base, kind, label) != HAPI_WIRE_NOWHERE);
  return begun ? hapi_wire_cells_at(frame, &receiver->shape, kind, place) : NULL;
}

/* Records of lost datagrams are as they were known last; those of which nothing is known are left
 * out. False: the frame is nothing without one. */
static bool list_mend(const hapi_wire_receiver *receiver, const hapi_wire_frame *base,
                      hapi_wire_frame *frame, hapi_wire_kind kind, const bool *lost)
{
  size_t size = receiver->shape.cells[kind] * sizeof(uint64_t);
  uint32_t count = frame->counts[kind];
  uint32_t to = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const uint64_t *from = lost[i] ? record_known(receiver, base, frame, kind, i)
                                   : hapi_wire_cells_at(frame, &receiver->shape, kind, i);
    if (from == NULL && kind_is_needed(kind)) {
      return false;
    }
    if (from != NULL) {
      memmove(hapi_wire_cells_at(frame, &receiver->shape, kind, to), from, size);
      frame->labels[kind][to] = frame->labels[kind][i];
      frame->places[kind][frame->labels[kind][i]] = to++;
    }
  }
  frame->counts[kind] = to;
  return true;
}

static outcome frame_mend(const hapi_wire_receiver *receiver, const hapi_wire_frame *base,
                          hapi_wire_frame *frame)
{
  const bool *lost = receiver->lost;
  bool good = !lost[0]; /* the head is new, or there is no message */
  for (uint32_t i = receiver->shape.first; i < receiver->shape.end && good; ++i) {
    uint32_t count = frame->counts[i];
    good = list_mend(receiver, base, frame, (hapi_wire_kind)i, lost);
    lost += count;
  }
  return good ? OUTCOME_GOOD : OUTCOME_WAIT;
}

/* Records that were not changed are those of the base or of descriptions, which were checked. Those
 * that begin with zeros and were not told were not. */
static const char *frame_check(const hapi_wire_receiver *receiver, const hapi_wire_frame *base,
                               const hapi_wire_frame *frame)
{
  const hapi_wire_shape *shape = &receiver->shape;
  for (uint32_t i = shape->first; i < shape->end; ++i) {
    hapi_wire_kind kind = (hapi_wire_kind)i;
    for (uint32_t k = 0; receiver->known[kind] == NULL && k < frame->counts[kind]; ++k) {
      if (base == NULL ||
          hapi_wire_place(base, kind, frame->labels[kind][k]) == HAPI_WIRE_NOWHERE) {
        const char *bad = hapi_wire_check(kind, hapi_wire_cells_at(frame, shape, kind, k));
        if (bad != NULL) {
          return bad;
        }
      }
    }
  }
  return NULL;
}

static outcome frame_build(hapi_wire_receiver *receiver, const hapi_wire_gathering *g, bool lacking,
                           const hapi_wire_frame *base, hapi_wire_frame *frame,
                           const char **out_bad)
{
  hapi_code_reader r;
  *out_bad = NULL;
  if (!directory_join(receiver, g, &r)) {
    *out_bad = "its directory is not whole";
    return lacking ? OUTCOME_WAIT : OUTCOME_BAD;
  }
  if (!lists_take(receiver, r, base, frame)) {
    *out_bad = "its directory is malformed, or has more than there is room for";
    return OUTCOME_BAD;
  }
  if (frame_begin(receiver, g, base, frame) != OUTCOME_GOOD) {
    return OUTCOME_DROP;
  }
  *out_bad = parts_take(receiver, g, frame);
  if (*out_bad != NULL) {
    return OUTCOME_BAD;
  }
  if (lacking && frame_mend(receiver, base, frame) != OUTCOME_GOOD) {
    return OUTCOME_WAIT;
  }
  *out_bad = frame_check(receiver, base, frame);
  return *out_bad == NULL ? OUTCOME_GOOD : OUTCOME_BAD;
}

/* Frames before the base are needed no more. */
static void receiver_forget(hapi_wire_receiver *receiver, uint64_t base)
{
  receiver->base = base > receiver->base ? base : receiver->base;
  for (uint32_t i = 0; i < FRAMES; ++i) {
    receiver->kept[i] = receiver->kept[i] && receiver->frames[i].number >= receiver->base;
  }
}

static void frame_take_over(hapi_wire_receiver *receiver, const hapi_wire_gathering *g,
                            uint32_t place, bool lacking)
{
  receiver->frames[place].number = g->number;
  receiver->kept[place] = g->keep && !lacking;
  if (receiver->kept[place] && g->number > receiver->acked) {
    receiver->acked = g->number;
  }
  if (g->number > receiver->given) {
    receiver->given = g->number;
    receiver->last = &receiver->frames[place];
    ++receiver->frames_given;
    receiver->lacking += lacking;
  }
  receiver_forget(receiver, g->base);
}

static hap_status gathering_try(hapi_wire_receiver *receiver, hapi_wire_gathering *g, bool lacking,
                                hap_detail *detail)
{
  const hapi_wire_frame *base = g->base != 0 ? receiver_frame(receiver, g->base) : NULL;
  const char *bad = NULL;
  if (g->serial > receiver->serial) {
    return HAP_OK; /* its descriptions are on their way */
  }
  if ((g->base != 0 && base == NULL) || (g->number <= receiver->given && !g->keep)) {
    g->done = true;
    ++receiver->late;
    return HAP_OK;
  }
  uint32_t place = receiver_free_frame(receiver, g->base);
  receiver->kept[place] = false;
  outcome what = frame_build(receiver, g, lacking, base, &receiver->frames[place], &bad);
  if (what == OUTCOME_GOOD && g->number > receiver->given) {
    bad = receiver->accept(receiver->of, &receiver->frames[place]);
    /* With lost datagrams it need not fit together, and is no fault of the sender. */
    what = bad == NULL ? OUTCOME_GOOD : lacking ? OUTCOME_WAIT : OUTCOME_BAD;
  }
  g->done = what != OUTCOME_WAIT && !(lacking && what == OUTCOME_GOOD); /* it can be kept yet */
  switch (what) {
    case OUTCOME_GOOD:
      frame_take_over(receiver, g, place, lacking);
      return HAP_OK;
    case OUTCOME_BAD:
      return receiver_refuse(receiver, detail, "message %llu is refused: %s",
                             (unsigned long long)g->number, bad);
    case OUTCOME_DROP:
      ++receiver->late;
      return HAP_OK;
    case OUTCOME_WAIT:
      break;
  }
  return HAP_OK;
}

/* ---- what comes in ---- */

/* Where the datagrams of a frame are gathered. NULL: it is too old. */
static hapi_wire_gathering *gathering_of(hapi_wire_receiver *receiver, uint64_t number)
{
  hapi_wire_gathering *oldest = &receiver->gatherings[0];
  for (uint32_t i = 0; i < HAPI_WIRE_GATHERINGS; ++i) {
    hapi_wire_gathering *g = &receiver->gatherings[i];
    if (g->number == number) {
      return g;
    }
    oldest = g->number < oldest->number ? g : oldest;
  }
  if (number < oldest->number) {
    return NULL;
  }
  memset(oldest, 0, offsetof(hapi_wire_gathering, bytes));
  return oldest;
}

/* A newer frame begins to come: the one before is given with what there is of it. */
static void receiver_give_lacking(hapi_wire_receiver *receiver, uint64_t number)
{
  hap_detail detail;
  for (uint32_t i = 0; i < HAPI_WIRE_GATHERINGS; ++i) {
    hapi_wire_gathering *g = &receiver->gatherings[i];
    if (g->number == receiver->heard && g->number < number && g->number > receiver->given &&
        !g->done && !gathering_is_whole(g)) {
      (void)gathering_try(receiver, g, true, &detail); /* counted; it may be mended yet */
    }
  }
}

static hap_status datagram_gather(hapi_wire_receiver *receiver, const datagram *d,
                                  const uint8_t *data, uint32_t bytes, hap_detail *detail)
{
  if (d->number > receiver->heard) {
    receiver_give_lacking(receiver, d->number);
    receiver->heard = d->number;
  }
  hapi_wire_gathering *g = gathering_of(receiver, d->number);
  if (g == NULL || g->done || g->sizes[d->part] != 0) {
    ++receiver->late;
    return HAP_OK;
  }
  bool keep = (d->flags & HAPI_WIRE_KEEP) != 0;
  bool last = (d->flags & HAPI_WIRE_LAST) != 0;
  if (g->number == 0) {
    g->number = d->number;
    g->base = d->base;
    g->serial = d->serial;
    g->directory = d->directory;
    g->keep = keep;
  }
  if (g->base != d->base || g->serial != d->serial || g->directory != d->directory ||
      g->keep != keep || (last && (g->last != 0 || g->above > d->part + 1u)) ||
      (g->last != 0 && d->part >= g->last)) {
    return receiver_refuse(receiver, detail, "the parts of message %llu contradict each other",
                           (unsigned long long)d->number);
  }
  g->last = last ? d->part + 1u : g->last;
  g->above = d->part >= g->above ? d->part + 1u : g->above;
  g->sizes[d->part] = (uint16_t)bytes;
  memcpy(g->bytes[d->part], data, bytes);
  ++g->parts;
  return gathering_is_whole(g) ? gathering_try(receiver, g, false, detail) : HAP_OK;
}

hap_status hapi_wire_receiver_take(hapi_wire_receiver *receiver, const uint8_t *data,
                                   uint32_t bytes, hapi_wire_sender *back, hap_detail *detail)
{
  datagram d;
  if (bytes < 4 || bytes > HAPI_WIRE_DATAGRAM || data[1] != receiver->channel) {
    return receiver_refuse(receiver, detail, "a datagram of %u bytes that is not of channel %u",
                           bytes, receiver->channel);
  }
  if (data[0] != HAPI_WIRE_VERSION) {
    return receiver_refuse(receiver, detail,
                           "a datagram of version %u, this end reads version %u: both ends need "
                           "the same release of hapode",
                           data[0], HAPI_WIRE_VERSION);
  }
  if (!datagram_read(receiver, data, bytes, &d)) {
    return receiver_refuse(receiver, detail, "a datagram of %u bytes with a malformed head", bytes);
  }
  if (d.number > receiver->heard + HAPI_WIRE_AHEAD_MOST) {
    return receiver_refuse(receiver, detail, "message %llu, where the newest was %llu",
                           (unsigned long long)d.number, (unsigned long long)receiver->heard);
  }
  if (!hapi_wire_sender_acknowledge(back, d.ack)) {
    return receiver_refuse(
        receiver, detail, "message %llu acknowledges number %llu, and this end has sent %llu",
        (unsigned long long)d.number, (unsigned long long)d.ack, (unsigned long long)back->number);
  }
  return datagram_gather(receiver, &d, data, bytes, detail);
}
