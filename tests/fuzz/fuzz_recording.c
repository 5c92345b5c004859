/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* lib/record/reader.c: the bytes are the file. The last one says how it is read, and whether the
 * checksums are put right before, without which hardly an input would come beyond them. */

#include <unistd.h>

#include "record/reader.h"
#include "tests/fuzz/fuzz.h"

enum {
  INCOMPLETE = 1,
  REPAIRED = 2,
  OWN_BUILD = 4 /* and the machine and the library are this one's */
};

static void recording_repair(uint8_t *data, size_t size, bool own_build)
{
  hapi_file_head head;
  size_t at = sizeof head;
  if (size < sizeof head) {
    return;
  }
  memcpy(&head, data, sizeof head);
  head.crc = hapi_file_crc_head(&head);
  memcpy(data, &head, sizeof head);
  for (bool first = true; size - at >= sizeof(hapi_block_head); first = false) {
    hapi_block_head block;
    memcpy(&block, data + at, sizeof block);
    uint8_t *bytes = data + at + sizeof block;
    if (block.stored > size - at - sizeof block) {
      return;
    }
    if (first && own_build && block.stored >= HAPI_FILE_INFO_LEAST) {
      hapi_file_info info;
      memcpy(&info, bytes, HAPI_FILE_INFO_LEAST);
      hapi_file_describe(&info);
      memcpy(bytes, &info, HAPI_FILE_INFO_LEAST);
    }
    block.crc = hapi_file_crc_block(&block, bytes);
    memcpy(data + at, &block, sizeof block);
    at += sizeof block + block.stored;
  }
}

static void check_packet(hapi_stream stream, const hapi_cell *cells, uint32_t count)
{
  FUZZ_CHECK(cells != NULL && count > 0 && count <= HAPI_PACKET_MAX);
  if (stream == HAPI_STREAM_HAPTIC) {
    FUZZ_CHECK(cells->kind == HAPI_CELL_BEGIN || cells->kind == HAPI_CELL_TICK);
    FUZZ_CHECK(count == 1 + cells->word);
  }
  for (uint32_t i = 0; i < count; ++i) {
    FUZZ_CHECK(stream != HAPI_STREAM_HAPTIC || i == 0 || cells[i].index < 16);
  }
}

/* Every packet of every stream, one of each in turn. */
static void read_all(hapi_reader *reader, bool incomplete)
{
  const hapi_grammar *whole = hapi_reader_whole(reader);
  uint64_t seen[HAPI_STREAMS] = {0};
  hap_status status = HAP_OK;
  for (bool any = true; any && status >= HAP_OK;) {
    any = false;
    for (int i = 0; i < HAPI_STREAMS && status >= HAP_OK; ++i) {
      const hapi_cell *cells = NULL;
      uint32_t count = 0;
      hap_detail detail;
      status = hapi_reader_glance(reader, (hapi_stream)i, &cells, &count, &detail);
      if (status >= HAP_OK) {
        status = hapi_reader_peek(reader, (hapi_stream)i, &cells, &count, &detail);
      }
      if (status == HAP_OK) {
        check_packet((hapi_stream)i, cells, count);
        seen[i] += count;
        hapi_reader_pop(reader, (hapi_stream)i);
        any = true;
      }
    }
  }
  FUZZ_CHECK(status >= HAP_OK || fuzz_starved());
  for (int i = 0; i < HAPI_STREAMS; ++i) { /* the last packet may lack cells */
    FUZZ_CHECK(status < HAP_OK || seen[i] <= whole->cells[i]);
    FUZZ_CHECK(status < HAP_OK || incomplete ||
               whole->cells[i] < seen[i] + HAPI_PACKET_MAX + HAPI_VERDICTS_MOST);
  }
}

void fuzz_one(const uint8_t *data, size_t size)
{
  char path[64];
  hapi_reader *reader = NULL;
  hap_detail detail;
  uint8_t how = size > 0 ? data[size - 1] : 0;
  uint8_t *bytes = malloc(size + 1);
  FUZZ_CHECK(bytes != NULL);
  if (size > 0) {
    memcpy(bytes, data, size - 1);
  }
  if ((how & REPAIRED) != 0) {
    recording_repair(bytes, size - 1, (how & OWN_BUILD) != 0);
  }
  int descriptor = fuzz_file(bytes, size > 0 ? size - 1 : 0, path, sizeof path);
  bool incomplete = (how & INCOMPLETE) != 0;
  fuzz_detail_spoil(&detail);
  hap_status status = hapi_reader_open(path, incomplete, NULL, &reader, &detail);
  fuzz_check_answer(status, reader, &detail);
  if (status >= HAP_OK) {
    FUZZ_CHECK(strlen(hapi_reader_note(reader)) <= hapi_reader_info(reader)->note_size);
    FUZZ_CHECK(incomplete || hapi_reader_end(reader)->end != HAPI_RECORD_GOES_ON);
    read_all(reader, incomplete);
  } else {
    FUZZ_CHECK(status == HAP_ERROR_FORMAT || status == HAP_ERROR_UNSUPPORTED ||
               status == HAP_ERROR_MEMORY);
  }
  hapi_reader_close(reader);
  close(descriptor);
  free(bytes);
}
