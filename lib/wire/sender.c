/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "wire/sender.h"

#include <stdio.h>

#include "base/alloc.h"
#include "base/assert.h"

#define HEADER_MOST 88u  /* bytes of a datagram before directory and records */
#define APART_MOST 16u   /* frames: six times that is 1.6 s at 60 Hz */
#define SILENT_LEAST 12u /* frames: of how many an answer may be late or lost */
#define ROOM (HAPI_WIRE_DATAGRAM - HEADER_MOST)

bool hapi_wire_sender_create(hapi_wire_sender *sender, uint32_t channel, uint32_t first,
                             uint32_t end, const hapi_capacity *capacity)
{
  memset(sender, 0, sizeof *sender);
  sender->channel = channel;
  hapi_wire_shape_init(&sender->shape, first, end, capacity);
  bool good = true;
  size_t most = HEADER_MOST;
  for (uint32_t i = first; i < end; ++i) {
    const hapi_wire_shape *shape = &sender->shape;
    good = good && hapi_wire_labels_create(&sender->labels[i], shape->labels[i]);
    most += HAPI_CODE_MOST * ((size_t)shape->most[i] + 1);
    if (hapi_wire_records[i].known && shape->most[i] > 0) {
      sender->known[i] = hapi_alloc_late(shape->labels[i], shape->cells[i] * sizeof(uint64_t));
      good = good && sender->known[i] != NULL;
    }
  }
  for (uint32_t i = 0; i < HAPI_WIRE_KEPT; ++i) {
    good = good && hapi_wire_frame_create(&sender->frames[i], &sender->shape);
  }
  sender->directory = hapi_alloc(most);
  sender->directory_size = most;
  return good && sender->directory != NULL;
}

void hapi_wire_sender_finish(hapi_wire_sender *sender)
{
  for (uint32_t i = 0; i < HAPI_WIRE_KINDS; ++i) {
    hapi_wire_labels_finish(&sender->labels[i]);
    hapi_free(sender->known[i]);
    sender->known[i] = NULL;
  }
  for (uint32_t i = 0; i < HAPI_WIRE_KEPT; ++i) {
    hapi_wire_frame_finish(&sender->frames[i]);
  }
  hapi_free(sender->directory);
  sender->directory = NULL;
}

/* ---- frames ---- */

static hapi_wire_frame *sender_frame(hapi_wire_sender *sender, uint64_t number)
{
  for (uint32_t i = 0; i < HAPI_WIRE_KEPT; ++i) {
    if (number != 0 && sender->frames[i].number == number) {
      return &sender->frames[i];
    }
  }
  return NULL;
}

/* NULL: all are kept. */
static hapi_wire_frame *sender_free_frame(hapi_wire_sender *sender)
{
  for (uint32_t i = 0; i < HAPI_WIRE_KEPT; ++i) {
    if (sender->frames[i].number == 0) {
      return &sender->frames[i];
    }
  }
  return NULL;
}

/* The oldest that is not the base is the most likely to be lost. */
static void sender_drop_oldest(hapi_wire_sender *sender)
{
  hapi_wire_frame *oldest = NULL;
  for (uint32_t i = 0; i < HAPI_WIRE_KEPT; ++i) {
    hapi_wire_frame *frame = &sender->frames[i];
    if (frame->number != 0 && frame->number != sender->base &&
        (oldest == NULL || frame->number < oldest->number)) {
      oldest = frame;
    }
  }
  if (oldest != NULL) {
    oldest->number = 0;
  }
}

void hapi_wire_sender_begin(hapi_wire_sender *sender)
{
  if (sender->now != NULL) {
    sender->now->number = 0;
  }
  sender->now = sender_free_frame(sender);
  hapi_wire_frame_clear(sender->now);
  ++sender->number;
}

uint64_t *hapi_wire_sender_add(hapi_wire_sender *sender, hapi_wire_kind kind, uint64_t key)
{
  if (sender->now->counts[kind] == sender->shape.most[kind]) {
    return NULL;
  }
  uint32_t label = hapi_wire_label_of(&sender->labels[kind], key, sender->number);
  return hapi_wire_frame_add(sender->now, &sender->shape, kind, label);
}

bool hapi_wire_sender_add_alike(hapi_wire_sender *sender, hapi_wire_kind kind, uint64_t key,
                                const uint64_t *cells)
{
  uint64_t *to = hapi_wire_sender_add(sender, kind, key);
  if (to == NULL) {
    return false;
  }
  uint32_t count = sender->shape.cells[kind];
  uint32_t label = sender->now->labels[kind][sender->now->counts[kind] - 1];
  bool described = sender->labels[kind].serial[label] != 0;
  memcpy(to, described ? sender->known[kind] + (size_t)label * count : cells, count * sizeof *to);
  return true;
}

bool hapi_wire_sender_acknowledge(hapi_wire_sender *sender, uint64_t number)
{
  if (number > sender->number) {
    return false;
  }
  if (number > sender->base && sender_frame(sender, number) != NULL) {
    sender->base = number;
    sender->answer = sender->number - number;
    for (uint32_t i = 0; i < HAPI_WIRE_KEPT; ++i) {
      if (sender->frames[i].number < number) {
        sender->frames[i].number = 0;
      }
    }
  }
  return true;
}

/* ---- descriptions ---- */

static void known_begin(const hapi_wire_sender *sender, uint64_t serial, hapi_code_writer *w)
{
  w->at = (uint8_t *)sender->bulk;
  w->end = w->at + HAPI_WIRE_RELIABLE;
  w->full = false;
  hapi_code_byte(w, HAPI_WIRE_VERSION);
  hapi_code_byte(w, HAPI_WIRE_CHANNEL_KNOWN);
  hapi_code_put(w, serial + 1);
}

/* Whatever was not sent is to be described by the next frame. */
static void known_settle(hapi_wire_sender *sender, uint64_t sent)
{
  const hapi_wire_frame *now = sender->now;
  for (uint32_t kind = sender->shape.first; kind < sender->shape.end; ++kind) {
    uint64_t *serial = sender->labels[kind].serial;
    for (uint32_t i = 0; hapi_wire_records[kind].known && i < now->counts[kind]; ++i) {
      uint32_t label = now->labels[kind][i];
      serial[label] = serial[label] > sent ? 0 : serial[label];
    }
  }
  sender->serial = sent;
}

static void known_put(const hapi_wire_sender *sender, uint32_t kind, uint32_t label,
                      const uint64_t *cells, hapi_code_writer *w)
{
  hapi_code_put(w, kind);
  hapi_code_put(w, label);
  hapi_wire_delta_put(w, sender->shape.by_xor[kind], sender->shape.cells[kind], hapi_wire_zeros,
                      cells);
}

static hap_status known_flush(hapi_wire_sender *sender, uint64_t serial, const uint8_t *end,
                              const hapi_wire_out *out)
{
  if (serial == sender->serial) {
    return HAP_OK;
  }
  hap_status status = out->send(out->of, HAPI_WIRE_CHANNEL_KNOWN, 0, true, sender->bulk,
                                (uint32_t)(end - sender->bulk));
  known_settle(sender, status < HAP_OK ? sender->serial : serial);
  return status;
}

static hap_status sender_describe(hapi_wire_sender *sender, const hapi_wire_out *out)
{
  const hapi_wire_shape *shape = &sender->shape;
  const hapi_wire_frame *now = sender->now;
  hapi_code_writer w;
  uint64_t serial = sender->serial;
  known_begin(sender, serial, &w);
  for (uint32_t kind = shape->first; kind < shape->end; ++kind) {
    for (uint32_t i = 0; hapi_wire_records[kind].known && i < now->counts[kind]; ++i) {
      uint32_t label = now->labels[kind][i];
      const uint64_t *cells = hapi_wire_cells_at(now, shape, (hapi_wire_kind)kind, i);
      if (sender->labels[kind].serial[label] != 0) {
        continue;
      }
      const uint8_t *end = w.at;
      known_put(sender, kind, label, cells, &w);
      if (w.full) {
        hap_status status = known_flush(sender, serial, end, out);
        if (status < HAP_OK) {
          return status;
        }
        known_begin(sender, serial, &w);
        known_put(sender, kind, label, cells, &w);
      }
      sender->labels[kind].serial[label] = ++serial;
      memcpy(sender->known[kind] + (size_t)label * shape->cells[kind], cells,
             shape->cells[kind] * sizeof *cells);
    }
  }
  return known_flush(sender, serial, w.at, out);
}

/* ---- the directory: the lists of labels ---- */

static bool list_is_same(const hapi_wire_frame *now, const hapi_wire_frame *base, uint32_t kind)
{
  uint32_t count = base != NULL ? base->counts[kind] : 0;
  return now->counts[kind] == count &&
         (count == 0 ||
          memcmp(now->labels[kind], base->labels[kind], count * sizeof *now->labels[kind]) == 0);
}

/* Runs of the base's list, and single labels. */
static void list_put(hapi_code_writer *w, const hapi_wire_frame *now, const hapi_wire_frame *base,
                     hapi_wire_kind kind)
{
  uint32_t count = now->counts[kind];
  const uint32_t *labels = now->labels[kind];
  uint32_t last = 0;
  hapi_code_put(w, count);
  for (uint32_t i = 0; i < count;) {
    uint32_t from = base != NULL ? hapi_wire_place(base, kind, labels[i]) : HAPI_WIRE_NOWHERE;
    uint32_t run = 0;
    while (from != HAPI_WIRE_NOWHERE && i + run < count && from + run < base->counts[kind] &&
           base->labels[kind][from + run] == labels[i + run]) {
      ++run;
    }
    if (run > 1) {
      hapi_code_put(w, (uint64_t)run << 1 | 1);
      hapi_code_put(w, from);
      i += run;
    } else {
      hapi_code_put(w, hapi_code_fold((uint64_t)labels[i] - last) << 1);
      ++i;
    }
    last = labels[i - 1] + 1;
  }
}

static size_t directory_write(const hapi_wire_sender *sender, const hapi_wire_frame *base)
{
  hapi_code_writer w = {sender->directory, sender->directory + sender->directory_size, false};
  uint64_t changed = 0;
  for (uint32_t kind = sender->shape.first; kind < sender->shape.end; ++kind) {
    if (!list_is_same(sender->now, base, kind)) {
      changed |= UINT64_C(1) << (kind - sender->shape.first);
    }
  }
  hapi_code_put(&w, changed);
  for (uint32_t kind = sender->shape.first; kind < sender->shape.end; ++kind) {
    if ((changed >> (kind - sender->shape.first) & 1u) != 0) {
      list_put(&w, sender->now, base, (hapi_wire_kind)kind);
    }
  }
  HAPI_ASSERT(!w.full);
  return (size_t)(w.at - sender->directory);
}

/* ---- datagrams ---- */

typedef struct parcel {
  const hapi_wire_sender *sender;
  const hapi_wire_out *out;
  uint64_t ack;
  uint64_t base;
  bool keep;
  size_t directory; /* bytes of it */
  size_t told;      /* those of them in earlier datagrams */
  size_t chunk;     /* and in this one */
  uint32_t part;
  uint32_t count;           /* of records in this datagram */
  uint64_t from;            /* first record that the datagram speaks of */
  uint64_t next;            /* the one behind the last that it has told */
  hapi_code_writer records; /* into bytes */
  uint8_t bytes[ROOM];
} parcel;

static void parcel_open(parcel *p)
{
  size_t left = p->directory - p->told;
  p->chunk = left < ROOM ? left : ROOM;
  p->from = p->next;
  p->count = 0;
  p->records = (hapi_code_writer){p->bytes, p->bytes + (ROOM - p->chunk), false};
}

static hap_status parcel_send(parcel *p, bool last)
{
  uint8_t bytes[HAPI_WIRE_DATAGRAM];
  hapi_code_writer w = {bytes, bytes + sizeof bytes, false};
  if (p->part == HAPI_WIRE_PARTS) {
    return HAP_ERROR_CAPACITY;
  }
  hapi_code_byte(&w, HAPI_WIRE_VERSION);
  hapi_code_byte(&w, (uint8_t)p->sender->channel);
  hapi_code_byte(&w, (uint8_t)((p->keep ? HAPI_WIRE_KEEP : 0) | (last ? HAPI_WIRE_LAST : 0)));
  hapi_code_byte(&w, (uint8_t)p->part);
  hapi_code_put(&w, p->sender->number);
  hapi_code_put(&w, p->base != 0 ? p->sender->number - p->base : 0);
  hapi_code_put(&w, p->sender->serial);
  hapi_code_put(&w, p->ack);
  hapi_code_put(&w, p->directory);
  hapi_code_put(&w, p->chunk);
  hapi_code_put(&w, p->from);
  hapi_code_put(&w, p->count);
  HAPI_ASSERT((size_t)(w.at - bytes) <= HEADER_MOST);
  hapi_code_copy(&w, p->sender->directory + p->told, p->chunk);
  hapi_code_copy(&w, p->bytes, (size_t)(p->records.at - p->bytes));
  HAPI_ASSERT(!w.full);
  hap_status status =
      p->out->send(p->out->of, p->sender->channel, p->part, false, bytes, (uint32_t)(w.at - bytes));
  p->told += p->chunk;
  ++p->part;
  return status;
}

/* What a record is told against; the receiver does the same. */
static const uint64_t *record_before(const hapi_wire_sender *sender, const hapi_wire_frame *base,
                                     hapi_wire_kind kind, uint32_t label)
{
  uint32_t place = base != NULL ? hapi_wire_place(base, kind, label) : HAPI_WIRE_NOWHERE;
  if (place != HAPI_WIRE_NOWHERE) {
    return hapi_wire_cells_at(base, &sender->shape, kind, place);
  }
  return sender->known[kind] != NULL
             ? sender->known[kind] + (size_t)label * sender->shape.cells[kind]
             : hapi_wire_zeros;
}

static hap_status parcel_put(parcel *p, hapi_wire_kind kind, uint64_t index, const uint64_t *before,
                             const uint64_t *now)
{
  const hapi_wire_shape *shape = &p->sender->shape;
  uint8_t *begin = p->records.at;
  for (int attempt = 0; attempt < 3; ++attempt) {
    hapi_code_put(&p->records, index - p->next);
    hapi_wire_delta_put(&p->records, shape->by_xor[kind], shape->cells[kind], before, now);
    if (!p->records.full) {
      p->next = index + 1;
      ++p->count;
      return HAP_OK;
    }
    p->records.at = begin; /* into the next datagram */
    hap_status status = parcel_send(p, false);
    if (status < HAP_OK) {
      return status;
    }
    parcel_open(p);
    begin = p->records.at;
    while (p->chunk == ROOM) { /* the directory alone fills it */
      status = parcel_send(p, false);
      if (status < HAP_OK) {
        return status;
      }
      parcel_open(p);
      begin = p->records.at;
    }
  }
  return HAP_ERROR_CAPACITY;
}

static hap_status parcel_put_all(parcel *p, const hapi_wire_frame *base)
{
  const hapi_wire_sender *sender = p->sender;
  const hapi_wire_frame *now = sender->now;
  uint64_t first = 0;
  for (uint32_t i = sender->shape.first; i < sender->shape.end; ++i) {
    hapi_wire_kind kind = (hapi_wire_kind)i;
    size_t size = sender->shape.cells[kind] * sizeof(uint64_t);
    for (uint32_t k = 0; k < now->counts[kind]; ++k) {
      const uint64_t *before = record_before(sender, base, kind, now->labels[kind][k]);
      const uint64_t *cells = hapi_wire_cells_at(now, &sender->shape, kind, k);
      hap_status status =
          memcmp(before, cells, size) == 0 ? HAP_OK : parcel_put(p, kind, first + k, before, cells);
      if (status < HAP_OK) {
        return status;
      }
    }
    first += now->counts[kind];
  }
  return HAP_OK;
}

/* Frames are kept so far apart that one of them is still there when its answer comes, after a round
 * trip of any length. When no answer comes for long, farther and farther. */
static bool sender_keeps(const hapi_wire_sender *sender)
{
  uint64_t silent = sender->number - sender->base;
  uint64_t apart = silent <= 3 * sender->answer + SILENT_LEAST
                       ? 1 + sender->answer / (HAPI_WIRE_KEPT - 4)
                       : 1 + silent / (HAPI_WIRE_KEPT - 2);
  return sender->kept <= sender->base ||
         sender->number - sender->kept >= (apart < APART_MOST ? apart : APART_MOST);
}

static void sender_keep(hapi_wire_sender *sender)
{
  sender->now->number = sender->kept = sender->number;
  sender->now = NULL;
  if (sender_free_frame(sender) == NULL) {
    sender_drop_oldest(sender);
  }
}

hap_status hapi_wire_sender_send(hapi_wire_sender *sender, uint64_t ack, const hapi_wire_out *out,
                                 hap_detail *detail)
{
  const hapi_wire_frame *base = sender_frame(sender, sender->base);
  parcel p = {.sender = sender, .out = out, .ack = ack, .base = base != NULL ? base->number : 0};
  hap_status status = sender_describe(sender, out);
  if (status < HAP_OK) {
    snprintf(detail->text, sizeof detail->text,
             "descriptions could not be sent (%s); the next message tries again",
             hap_status_name(status));
    return status;
  }
  p.keep = sender_keeps(sender);
  p.directory = directory_write(sender, base);
  parcel_open(&p);
  status = parcel_put_all(&p, base);
  while (status >= HAP_OK && p.told + p.chunk < p.directory) {
    status = parcel_send(&p, false);
    parcel_open(&p);
  }
  status = status >= HAP_OK ? parcel_send(&p, true) : status;
  if (status < HAP_OK) {
    snprintf(detail->text, sizeof detail->text,
             "message %llu could not be sent whole (%s): it has more than %u datagrams, or the "
             "link refused one",
             (unsigned long long)sender->number, hap_status_name(status), HAPI_WIRE_PARTS);
    return status;
  }
  if (p.keep) {
    sender_keep(sender);
  }
  return HAP_OK;
}
