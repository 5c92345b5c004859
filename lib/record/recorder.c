/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "record/recorder.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <unistd.h>
#define ZLIB_CONST
#include <zlib.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/regular.h"
#include "base/thread.h"

#define PAUSE_NS 10000000  /* between two looks at the rings */
#define FLUSH_NS 250000000 /* what a program that dies loses */
#define END_BYTES (sizeof(hapi_block_head) + sizeof(hapi_file_end))
#define DEFLATE_LEVEL 1

struct hapi_recorder {
  hapi_tape tapes[HAPI_STREAMS];
  _Atomic int ended; /* hapi_record_end */
  _Atomic int error;
  _Atomic uint64_t bytes;
  _Atomic uint64_t ticks;
  uint64_t max_bytes;
  int file; /* -1: closed */
  uint32_t blocks;
  hapi_file_end totals;
  hapi_cell *cells[HAPI_STREAMS]; /* of the next blocks, HAPI_BLOCK_CELLS each */
  uint32_t counts[HAPI_STREAMS];
  char *stored; /* HAPI_BLOCK_BYTES */
  z_stream deflater;
  bool deflates;
  hapi_thread thread;
  _Atomic int stop;
};

/* ---- bytes ---- */

static bool goes_on(const hapi_recorder *recorder)
{
  return atomic_load(&recorder->ended) == HAPI_RECORD_GOES_ON;
}

static void recorder_end(hapi_recorder *recorder, hapi_record_end why)
{
  int expected = HAPI_RECORD_GOES_ON;
  (void)atomic_compare_exchange_strong(&recorder->ended, &expected, (int)why);
}

/* No more goes to the file, whatever the recording had ended by before. */
static void recorder_fail(hapi_recorder *recorder, int error)
{
  atomic_store(&recorder->error, error);
  atomic_store(&recorder->ended, HAPI_RECORD_FAILED);
}

static void write_bytes(hapi_recorder *recorder, const void *bytes, size_t size)
{
  const char *at = bytes;
  while (size > 0 && atomic_load(&recorder->error) == 0) {
    ssize_t written = write(recorder->file, at, size);
    if (written > 0) {
      at += written;
      size -= (size_t)written;
      atomic_fetch_add(&recorder->bytes, (uint64_t)written);
    } else if (written < 0 && errno != EINTR) {
      recorder_fail(recorder, errno);
    } else if (written == 0) {
      recorder_fail(recorder, ENOSPC);
    }
  }
}

/* Bytes in recorder->stored; 0: they would not be fewer. */
static uint32_t deflate_bytes(hapi_recorder *recorder, const void *bytes, uint32_t size)
{
  HAPI_ASSERT(size <= HAPI_BLOCK_BYTES);
  z_stream *z = &recorder->deflater;
  if (!recorder->deflates || deflateReset(z) != Z_OK) {
    return 0;
  }
  z->next_in = bytes;
  z->avail_in = size;
  z->next_out = (Bytef *)recorder->stored;
  z->avail_out = size > 0 ? size - 1 : 0;
  return deflate(z, Z_FINISH) == Z_STREAM_END ? (uint32_t)z->total_out : 0;
}

/* False: it does not fit below the limit, or cannot be written. */
static bool write_block(hapi_recorder *recorder, uint32_t type, const void *bytes, uint32_t size)
{
  HAPI_ASSERT(recorder->file >= 0 && size <= HAPI_BLOCK_BYTES);
  hapi_block_head head = {HAPI_BLOCK_MARK, type, recorder->blocks, size, size, 0};
  bool cells = type != HAPI_BLOCK_INFO && type != HAPI_BLOCK_END;
  uint32_t fewer = cells ? deflate_bytes(recorder, bytes, size) : 0;
  const void *stored = fewer > 0 ? recorder->stored : bytes;
  head.stored = fewer > 0 ? fewer : size;
  head.crc = hapi_file_crc_block(&head, stored);
  uint64_t after = atomic_load(&recorder->bytes) + sizeof head + head.stored;
  if (cells && after + END_BYTES > recorder->max_bytes) {
    recorder_end(recorder, HAPI_RECORD_LIMIT);
    return false;
  }
  write_bytes(recorder, &head, sizeof head);
  write_bytes(recorder, stored, head.stored);
  ++recorder->blocks;
  return atomic_load(&recorder->error) == 0;
}

/* ---- cells ---- */

static bool block_flush(hapi_recorder *recorder, hapi_stream stream)
{
  HAPI_ASSERT_INDEX(stream, HAPI_STREAMS);
  HAPI_ASSERT(recorder->counts[stream] <= HAPI_BLOCK_CELLS);
  uint32_t count = recorder->counts[stream];
  recorder->counts[stream] = 0;
  if (count == 0) {
    return true;
  }
  if (!write_block(recorder, HAPI_BLOCK_CELLS_OF + stream, recorder->cells[stream],
                   count * (uint32_t)sizeof(hapi_cell))) {
    return false;
  }
  for (uint32_t i = 0; i < count && stream == HAPI_STREAM_HAPTIC; ++i) {
    recorder->totals.ticks += recorder->cells[stream][i].kind == HAPI_CELL_TICK;
  }
  atomic_store(&recorder->ticks, recorder->totals.ticks);
  recorder->totals.cells[stream] += count;
  return true;
}

static size_t cells_take(hapi_recorder *recorder, hapi_stream stream)
{
  HAPI_ASSERT(hapi_thread_is_mine(&recorder->thread));
  uint32_t *count = &recorder->counts[stream];
  size_t got = hapi_tape_take(&recorder->tapes[stream], recorder->cells[stream] + *count,
                              HAPI_BLOCK_CELLS - *count);
  *count += (uint32_t)got;
  return got;
}

/* Takes what is there of a stream, and writes it out. */
static bool drain_whole(hapi_recorder *recorder, hapi_stream stream)
{
  bool good = true;
  while (good && cells_take(recorder, stream) > 0) {
    good = recorder->counts[stream] < HAPI_BLOCK_CELLS || block_flush(recorder, stream);
  }
  return good && block_flush(recorder, stream);
}

/* The loop's cells are taken first and written last, after all that the other threads had put by
 * then. So every message that a tick took stands before the tick, and a file that breaks off can be
 * replayed up to there. */
static bool streams_drain(hapi_recorder *recorder, bool flushes)
{
  bool good = true;
  for (size_t got = 1; got > 0 && good;) {
    got = cells_take(recorder, HAPI_STREAM_HAPTIC);
    if (recorder->counts[HAPI_STREAM_HAPTIC] == HAPI_BLOCK_CELLS || (flushes && got == 0)) {
      good = drain_whole(recorder, HAPI_STREAM_PHYSICS) &&
             drain_whole(recorder, HAPI_STREAM_CONTACT) &&
             block_flush(recorder, HAPI_STREAM_HAPTIC);
    }
  }
  return good;
}

static void end_file(hapi_recorder *recorder)
{
  int why = atomic_load(&recorder->ended);
  if (why != HAPI_RECORD_FAILED) {
    recorder->totals.end = (uint32_t)why;
    recorder->totals.lost = atomic_load(&recorder->tapes[HAPI_STREAM_HAPTIC].lost);
    (void)write_block(recorder, HAPI_BLOCK_END, &recorder->totals, sizeof recorder->totals);
  }
  if (close(recorder->file) != 0 && atomic_load(&recorder->error) == 0) {
    recorder_fail(recorder, errno);
  }
  recorder->file = -1;
}

static void *recorder_main(void *arg)
{
  hapi_recorder *recorder = arg;
  hapi_thread_claim(&recorder->thread);
  sigset_t all;
  sigfillset(&all); /* a file that may grow no further is an error to be told, and no signal that
                       ends the process */
  pthread_sigmask(SIG_BLOCK, &all, NULL);
  int64_t next_flush = hapi_clock_now() + FLUSH_NS;
  while (goes_on(recorder) && atomic_load_explicit(&recorder->stop, memory_order_acquire) == 0) {
    int64_t now = hapi_clock_now();
    bool flushes = now >= next_flush;
    next_flush = flushes ? now + FLUSH_NS : next_flush;
    (void)streams_drain(recorder, flushes);
    hapi_clock_sleep_until(now + PAUSE_NS);
  }
  int why = atomic_load(&recorder->ended);
  if (why == HAPI_RECORD_GOES_ON || why == HAPI_RECORD_OVERFLOW) {
    (void)streams_drain(recorder, true); /* what was complete by then */
  }
  recorder_end(recorder, HAPI_RECORD_STOPPED);
  end_file(recorder);
  return NULL;
}

/* ---- life ---- */

static bool recorder_prepare(hapi_recorder *recorder, const hapi_recorder_config *config)
{
  bool good = true;
  for (int i = 0; i < HAPI_STREAMS; ++i) {
    good =
        hapi_tape_create(&recorder->tapes[i], config->cells[i], &recorder->ended) >= HAP_OK && good;
    recorder->cells[i] = hapi_alloc_array(HAPI_BLOCK_CELLS, sizeof(hapi_cell));
    good = good && recorder->cells[i] != NULL;
  }
  recorder->stored = hapi_alloc(HAPI_BLOCK_BYTES);
  recorder->deflater.zalloc = hapi_file_zlib_allocate;
  recorder->deflater.zfree = hapi_file_zlib_release;
  recorder->deflates = good && deflateInit(&recorder->deflater, DEFLATE_LEVEL) == Z_OK;
  return good && recorder->stored != NULL && recorder->deflates;
}

static void file_begin(hapi_recorder *recorder, const hapi_recorder_config *config)
{
  char *info = (char *)recorder->cells[0];
  HAPI_ASSERT(config->info.note_size <= HAPI_NOTE_MAX);
  hapi_file_head head = {
      HAPI_FILE_MAGIC, HAPI_FILE_BYTE_ORDER, HAPI_FILE_VERSION, sizeof(hapi_cell), 0, 0};
  head.crc = hapi_file_crc_head(&head);
  write_bytes(recorder, &head, sizeof head);
  memcpy(info, &config->info, sizeof config->info);
  if (config->info.note_size > 0) {
    memcpy(info + sizeof config->info, config->note, config->info.note_size);
  }
  (void)write_block(recorder, HAPI_BLOCK_INFO, info,
                    (uint32_t)sizeof config->info + config->info.note_size);
}

hap_status hapi_recorder_create(const hapi_recorder_config *config, hapi_recorder **out,
                                hap_detail *detail)
{
  *out = NULL;
  hapi_recorder *recorder = hapi_alloc(sizeof *recorder);
  if (recorder == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a recording");
  }
  recorder->file = -1;
  recorder->max_bytes = config->max_bytes;
  if (!recorder_prepare(recorder, config)) {
    hapi_recorder_destroy(recorder);
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a recording");
  }
  const char *why;
  recorder->file = hapi_regular_create(config->path, O_TRUNC, &why);
  if (recorder->file >= 0) {
    file_begin(recorder, config);
    int error = atomic_load(&recorder->error);
    why = error != 0 ? strerror(error) : NULL;
  }
  if (why != NULL) {
    hapi_recorder_destroy(recorder);
    return hapi_fail(detail, HAP_ERROR_IO, "%.300s: cannot be written: %s", config->path, why);
  }
  *out = recorder;
  return HAP_OK;
}

void hapi_recorder_destroy(hapi_recorder *recorder)
{
  if (recorder == NULL) {
    return;
  }
  hapi_recorder_stop(recorder);
  for (int i = 0; i < HAPI_STREAMS; ++i) {
    hapi_tape_finish(&recorder->tapes[i]);
    hapi_free(recorder->cells[i]);
  }
  if (recorder->deflates) {
    deflateEnd(&recorder->deflater);
  }
  hapi_free(recorder->stored);
  hapi_free(recorder);
}

hapi_tape *hapi_recorder_tape(hapi_recorder *recorder, hapi_stream stream)
{
  HAPI_ASSERT_INDEX(stream, HAPI_STREAMS);
  return &recorder->tapes[stream];
}

hap_status hapi_recorder_start(hapi_recorder *recorder)
{
  atomic_store(&recorder->stop, 0);
  return hapi_thread_start(&recorder->thread, recorder_main, recorder, "hapode-record", 0);
}

void hapi_recorder_stop(hapi_recorder *recorder)
{
  atomic_store(&recorder->stop, 1);
  hapi_thread_join(&recorder->thread);
  if (recorder->file >= 0) { /* its session never ran */
    recorder_end(recorder, HAPI_RECORD_STOPPED);
    end_file(recorder);
  }
}

hapi_recorder_state hapi_recorder_look(const hapi_recorder *recorder)
{
  return (hapi_recorder_state){
      .end = (hapi_record_end)atomic_load(&recorder->ended),
      .ticks = atomic_load(&recorder->ticks),
      .lost = atomic_load(&recorder->tapes[HAPI_STREAM_HAPTIC].lost),
      .bytes = atomic_load(&recorder->bytes),
      .error = atomic_load(&recorder->error),
  };
}
