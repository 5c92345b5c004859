/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "record/reader.h"

#include <errno.h>
#include <stdio.h>
#include <zlib.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/log.h"
#include "base/regular.h"
#include "record/grammar.h"

/* Of one stream, read while the cells of another one are sought. In what a recorder writes they
 * stand before. */
#define QUEUE_MAX (1u << 20)
/* Cells of the loop in which those of another thread are seen if they belong to its first ticks:
 * some times more than are written at a time. */
#define GLANCE (8u * HAPI_BLOCK_CELLS)

typedef struct cell_queue {
  hapi_cell *cells;
  uint32_t capacity;
  uint32_t first;
  uint32_t count;
} cell_queue;

struct hapi_reader {
  FILE *file;
  char path[256]; /* its end, for texts */
  hapi_file_info info;
  char note[HAPI_NOTE_MAX + 1];
  hapi_file_end end;
  hapi_grammar grammar;
  hapi_grammar whole; /* after all cells */
  long cells_at;      /* offset of the first block of cells */
  uint64_t offset;
  uint32_t blocks;
  bool incomplete;
  bool over; /* the END has been read, or the file breaks off and may */
  hapi_block_head head;
  char *stored;     /* HAPI_BLOCK_BYTES */
  hapi_cell *bytes; /* HAPI_BLOCK_BYTES */
  z_stream inflater;
  bool inflates;
  cell_queue queues[HAPI_STREAMS];
};

/* ---- what is wrong ---- */

static hap_status block_refuse(const hapi_reader *reader, const char *what, hap_detail *detail)
{
  return hapi_fail(detail, HAP_ERROR_FORMAT,
                   "%s: block %u at byte %llu: %s; the file is damaged and cannot be replayed",
                   reader->path, reader->blocks, (unsigned long long)reader->offset, what);
}

static hap_status broken_off(hapi_reader *reader, hap_detail *detail)
{
  if (ferror(reader->file)) {
    return hapi_fail(detail, HAP_ERROR_IO, "%s: cannot be read: %s", reader->path, strerror(errno));
  }
  if (reader->incomplete) {
    reader->over = true;
    return HAP_END;
  }
  return hapi_fail(detail, HAP_ERROR_FORMAT,
                   "%s: breaks off in block %u, which begins at byte %llu: the recording was not "
                   "ended, or the file was cut; HAP_PLAY_INCOMPLETE (hapode-run "
                   "--play-incomplete) plays what is there",
                   reader->path, reader->blocks, (unsigned long long)reader->offset);
}

static hap_status reader_starve(const hapi_reader *reader, hap_detail *detail)
{
  return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for reading %s", reader->path);
}

/* ---- blocks ---- */

static hap_status inflate_block(hapi_reader *reader, hap_detail *detail)
{
  HAPI_ASSERT(reader->inflates && reader->head.size <= HAPI_BLOCK_BYTES);
  z_stream *z = &reader->inflater;
  if (inflateReset(z) != Z_OK) {
    return reader_starve(reader, detail);
  }
  z->next_in = (Bytef *)reader->stored;
  z->avail_in = reader->head.stored;
  z->next_out = (Bytef *)reader->bytes;
  z->avail_out = reader->head.size;
  int answer = inflate(z, Z_FINISH);
  if (answer == Z_MEM_ERROR) {
    return reader_starve(reader, detail);
  }
  if (answer != Z_STREAM_END || z->total_out != reader->head.size) {
    return block_refuse(reader, "its bytes cannot be unpacked", detail);
  }
  return HAP_OK;
}

static const char *wrong_head(const hapi_reader *reader)
{
  const hapi_block_head *h = &reader->head;
  if (h->mark != HAPI_BLOCK_MARK) {
    return "no block begins here";
  }
  if (h->number != reader->blocks) {
    return "it has another number: a block is missing or twice there";
  }
  if (h->type < HAPI_BLOCK_INFO || h->type > HAPI_BLOCK_END || h->size > HAPI_BLOCK_BYTES ||
      h->stored > h->size || h->size == 0) {
    return "it is of a kind or size that there is not";
  }
  return NULL;
}

/* Its bytes are in reader->bytes then. */
static hap_status read_block(hapi_reader *reader, hap_detail *detail)
{
  hapi_block_head *head = &reader->head;
  if (fread(head, sizeof *head, 1, reader->file) != 1) {
    return broken_off(reader, detail);
  }
  const char *wrong = wrong_head(reader);
  if (wrong != NULL) {
    return block_refuse(reader, wrong, detail);
  }
  bool packed = head->stored < head->size;
  void *at = packed ? (void *)reader->stored : (void *)reader->bytes;
  if (head->stored > 0 && fread(at, head->stored, 1, reader->file) != 1) {
    return broken_off(reader, detail);
  }
  if (hapi_file_crc_block(head, at) != head->crc) {
    return block_refuse(reader, "its checksum is wrong", detail);
  }
  HAPI_TRY(packed ? inflate_block(reader, detail) : HAP_OK);
  reader->offset += sizeof *head + head->stored;
  ++reader->blocks;
  return HAP_OK;
}

static hap_status read_end(hapi_reader *reader, hap_detail *detail)
{
  const hapi_grammar *g = &reader->grammar;
  if (reader->head.size != sizeof reader->end) {
    return block_refuse(reader, "an end of another size", detail);
  }
  memcpy(&reader->end, reader->bytes, sizeof reader->end);
  bool totals = reader->end.ticks == g->ticks &&
                memcmp(reader->end.cells, g->cells, sizeof reader->end.cells) == 0;
  bool why = reader->end.end >= HAPI_RECORD_STOPPED && reader->end.end <= HAPI_RECORD_OVERFLOW;
  if (!totals || !why) {
    return block_refuse(reader, "its totals are not those of the blocks before", detail);
  }
  if (getc(reader->file) != EOF) {
    return block_refuse(reader, "something follows the end of the recording", detail);
  }
  reader->over = true;
  return HAP_END;
}

/* Reads a block of cells: *out_stream, *out_count in reader->bytes. HAP_END at the end. */
static hap_status read_cells(hapi_reader *reader, hapi_stream *out_stream, uint32_t *out_count,
                             hap_detail *detail)
{
  const hapi_block_head *head = &reader->head;
  HAPI_TRY(read_block(reader, detail));
  if (head->type == HAPI_BLOCK_END) {
    return read_end(reader, detail);
  }
  if (head->type < HAPI_BLOCK_CELLS_OF || head->size % sizeof(hapi_cell) != 0) {
    return block_refuse(reader, "it does not hold whole cells", detail);
  }
  *out_stream = (hapi_stream)(head->type - HAPI_BLOCK_CELLS_OF);
  *out_count = head->size / (uint32_t)sizeof(hapi_cell);
  for (uint32_t i = 0; i < *out_count; ++i) {
    const char *wrong = hapi_grammar_take(&reader->grammar, *out_stream, &reader->bytes[i]);
    if (wrong != NULL) {
      return block_refuse(reader, wrong, detail);
    }
  }
  return HAP_OK;
}

/* ---- head and info ---- */

static hap_status read_head(hapi_reader *reader, hap_detail *detail)
{
  hapi_file_head head;
  size_t got = fread(&head, 1, sizeof head, reader->file);
  if (ferror(reader->file)) {
    return hapi_fail(detail, HAP_ERROR_IO, "%s: cannot be read: %s", reader->path, strerror(errno));
  }
  if (got < sizeof head || memcmp(head.magic, HAPI_FILE_MAGIC, sizeof head.magic) != 0) {
    return hapi_fail(detail, HAP_ERROR_FORMAT,
                     "%s: is no recording of a session: it does not begin as one%s", reader->path,
                     got == 0 ? ", it is empty" : "");
  }
  if (head.byte_order != HAPI_FILE_BYTE_ORDER) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "%s: was recorded on a machine with the other byte order; replay it there",
                     reader->path);
  }
  if (head.crc != hapi_file_crc_head(&head)) {
    return block_refuse(reader, "the checksum of the file's head is wrong", detail);
  }
  if (head.version != HAPI_FILE_VERSION || head.cell_size != sizeof(hapi_cell)) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "%s: is of version %u of the file format, this library reads version %u; "
                     "replay it with the library that recorded it",
                     reader->path, head.version, HAPI_FILE_VERSION);
  }
  reader->offset = sizeof head;
  return HAP_OK;
}

static hap_status other_build(const hapi_reader *reader, const char *what, const char *there,
                              const char *here, hap_detail *detail)
{
  return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                   "%s: was recorded with %s \"%.100s\", this is \"%.100s\": bit for bit it "
                   "replays only there",
                   reader->path, what, there, here);
}

static hap_status check_build(const hapi_reader *reader, const char *ode, hap_detail *detail)
{
  const hapi_file_info *info = &reader->info;
  hapi_file_info here;
  memset(&here, 0, sizeof here);
  hapi_file_describe(&here);
  if (strcmp(info->build.machine, here.build.machine) != 0) {
    return other_build(reader, "a machine of type", info->build.machine, here.build.machine,
                       detail);
  }
  if (strcmp(info->build.library, here.build.library) != 0 ||
      info->joined_size != here.joined_size) {
    return other_build(reader, "the library's version", info->build.library, here.build.library,
                       detail);
  }
  if (ode != NULL && strncmp(info->build.ode, ode, sizeof info->build.ode - 1) != 0) {
    return other_build(reader, "an ODE of configuration", info->build.ode, ode, detail);
  }
  return HAP_OK;
}

static hap_status read_info(hapi_reader *reader, const char *ode, hap_detail *detail)
{
  hapi_file_info *info = &reader->info;
  hap_status status = read_block(reader, detail);
  if (status != HAP_OK) {
    reader->incomplete = false; /* there is nothing to play */
    return status == HAP_END ? broken_off(reader, detail) : status;
  }
  if (reader->head.type != HAPI_BLOCK_INFO || reader->head.size < HAPI_FILE_INFO_LEAST) {
    return block_refuse(reader, "it should tell what was recorded, and does not", detail);
  }
  memset(info, 0, sizeof *info);
  memcpy(info, reader->bytes, HAPI_FILE_INFO_LEAST);
  const hapi_file_build *build = &info->build;
  size_t size = reader->head.size - (size_t)info->note_size; /* wraps where the note is too long */
  if (info->note_size > HAPI_NOTE_MAX || size < HAPI_FILE_INFO_LEAST || size > sizeof *info ||
      memchr(build->library, '\0', sizeof build->library) == NULL ||
      memchr(build->machine, '\0', sizeof build->machine) == NULL ||
      memchr(build->system, '\0', sizeof build->system) == NULL ||
      memchr(build->ode, '\0', sizeof build->ode) == NULL) {
    return block_refuse(reader, "it tells what was recorded in a form that there is not", detail);
  }
  memcpy(info, reader->bytes, size);
  memcpy(reader->note, (const char *)reader->bytes + size, info->note_size);
  return check_build(reader, ode, detail);
}

/* ---- life ---- */

/* Looks at all of it, and comes back to the first cells. */
static hap_status look_through(hapi_reader *reader, hap_detail *detail)
{
  uint64_t offset = reader->offset;
  uint32_t blocks = reader->blocks;
  hap_status status = HAP_OK;
  reader->cells_at = ftell(reader->file);
  while (status == HAP_OK) {
    hapi_stream stream;
    uint32_t count;
    status = read_cells(reader, &stream, &count, detail);
  }
  if (status < HAP_OK) {
    return status;
  }
  reader->whole = reader->grammar;
  memset(&reader->grammar, 0, sizeof reader->grammar);
  reader->over = false;
  reader->offset = offset;
  reader->blocks = blocks;
  clearerr(reader->file);
  if (reader->cells_at < 0 || fseek(reader->file, reader->cells_at, SEEK_SET) != 0) {
    return hapi_fail(detail, HAP_ERROR_IO, "%s: cannot be read twice: %s", reader->path,
                     strerror(errno));
  }
  return HAP_OK;
}

static hap_status reader_prepare(hapi_reader *reader, const char *path, const char *ode,
                                 hap_detail *detail)
{
  size_t length = strlen(path);
  size_t skip = length >= 200 ? length - 199 : 0; /* the end of a long path tells more */
  snprintf(reader->path, sizeof reader->path, "%s", path + skip);
  reader->stored = hapi_alloc(HAPI_BLOCK_BYTES);
  reader->bytes = hapi_alloc(HAPI_BLOCK_BYTES);
  reader->inflater.zalloc = hapi_file_zlib_allocate;
  reader->inflater.zfree = hapi_file_zlib_release;
  reader->inflates = inflateInit(&reader->inflater) == Z_OK;
  if (reader->stored == NULL || reader->bytes == NULL || !reader->inflates) {
    return reader_starve(reader, detail);
  }
  const char *why = NULL;
  reader->file = hapi_regular_open(path, &why);
  if (reader->file == NULL) {
    return hapi_fail(detail, HAP_ERROR_IO, "%s: cannot be opened: %s", reader->path, why);
  }
  HAPI_TRY(read_head(reader, detail));
  HAPI_TRY(read_info(reader, ode, detail));
  return look_through(reader, detail);
}

hap_status hapi_reader_open(const char *path, bool incomplete, const char *ode, hapi_reader **out,
                            hap_detail *detail)
{
  *out = NULL;
  hapi_reader *reader = hapi_alloc(sizeof *reader);
  if (reader == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for reading a recording");
  }
  reader->incomplete = incomplete;
  hap_status status = reader_prepare(reader, path, ode, detail);
  if (status < HAP_OK) {
    hapi_reader_close(reader);
    return status;
  }
  *out = reader;
  return HAP_OK;
}

void hapi_reader_close(hapi_reader *reader)
{
  if (reader == NULL) {
    return;
  }
  if (reader->file != NULL) {
    fclose(reader->file);
  }
  if (reader->inflates) {
    inflateEnd(&reader->inflater);
  }
  for (int i = 0; i < HAPI_STREAMS; ++i) {
    hapi_free(reader->queues[i].cells);
  }
  hapi_free(reader->stored);
  hapi_free(reader->bytes);
  hapi_free(reader);
}

const hapi_file_info *hapi_reader_info(const hapi_reader *reader)
{
  return &reader->info;
}

const char *hapi_reader_note(const hapi_reader *reader)
{
  return reader->note;
}

const hapi_file_end *hapi_reader_end(const hapi_reader *reader)
{
  return &reader->end;
}

const hapi_grammar *hapi_reader_whole(const hapi_reader *reader)
{
  return &reader->whole;
}

/* ---- packets ---- */

/* Behind the last cell: by moving them when as many places are free before them, otherwise by
 * growing, so that no cell is moved often. */
static bool make_room(cell_queue *q, uint32_t count)
{
  HAPI_ASSERT(q->first + q->count <= q->capacity);
  if (q->first + q->count + count <= q->capacity) {
    return true;
  }
  if (q->first >= q->count + count) {
    memcpy(q->cells, q->cells + q->first, q->count * sizeof *q->cells);
    q->first = 0;
    return true;
  }
  uint32_t capacity = 3 * (q->count + count);
  hapi_cell *cells = hapi_alloc_array(capacity, sizeof *cells);
  if (cells == NULL) {
    return false;
  }
  if (q->count > 0) {
    memcpy(cells, q->cells + q->first, q->count * sizeof *cells);
  }
  hapi_free(q->cells);
  q->cells = cells;
  q->capacity = capacity;
  q->first = 0;
  return true;
}

/* More than there are, if the last one of those that tell is not there. */
static uint32_t packet_with_verdicts(const hapi_cell *cells, uint32_t count)
{
  uint32_t size = cells->kind == HAPI_CELL_CYCLE ? 2 : 1;
  if (count >= size && cells[size - 1].index == 1) {
    return count > size ? size + 1 + cells[size].word : size + 1;
  }
  return size;
}

/* Cells of the packet at the front; 0: nothing is there. */
static uint32_t packet_size(const hapi_reader *reader, hapi_stream stream)
{
  HAPI_ASSERT_INDEX(stream, HAPI_STREAMS);
  const cell_queue *q = &reader->queues[stream];
  if (q->count == 0) {
    return 0;
  }
  const hapi_cell *head = &q->cells[q->first];
  return stream == HAPI_STREAM_HAPTIC ? 1 + head->word : packet_with_verdicts(head, q->count);
}

static bool whole_packet(const hapi_reader *reader, hapi_stream stream)
{
  uint32_t size = packet_size(reader, stream);
  return size > 0 && size <= reader->queues[stream].count;
}

/* The next block of cells, behind those of its stream. */
static hap_status read_on(hapi_reader *reader, hap_detail *detail)
{
  hapi_stream stream = HAPI_STREAM_HAPTIC;
  uint32_t count = 0;
  HAPI_TRY(reader->over ? HAP_END : read_cells(reader, &stream, &count, detail));
  HAPI_ASSERT_INDEX(stream, HAPI_STREAMS);
  HAPI_ASSERT(count <= HAPI_BLOCK_CELLS);
  cell_queue *q = &reader->queues[stream];
  if (q->count + count > QUEUE_MAX) {
    return block_refuse(reader, "one thread is far ahead of the others", detail);
  }
  if (!make_room(q, count)) {
    return reader_starve(reader, detail);
  }
  HAPI_ASSERT(q->first + q->count + count <= q->capacity);
  memcpy(q->cells + q->first + q->count, reader->bytes, count * sizeof *q->cells);
  q->count += count;
  return HAP_OK;
}

hap_status hapi_reader_peek(hapi_reader *reader, hapi_stream stream, const hapi_cell **out,
                            uint32_t *out_count, hap_detail *detail)
{
  *out = NULL;
  *out_count = 0;
  while (!whole_packet(reader, stream)) {
    HAPI_TRY(read_on(reader, detail));
  }
  *out = reader->queues[stream].cells + reader->queues[stream].first;
  *out_count = packet_size(reader, stream);
  return HAP_OK;
}

hap_status hapi_reader_glance(hapi_reader *reader, hapi_stream stream, const hapi_cell **out,
                              uint32_t *out_count, hap_detail *detail)
{
  const cell_queue *q = &reader->queues[stream];
  hap_status status = HAP_OK;
  while (status == HAP_OK && !whole_packet(reader, stream) &&
         reader->queues[HAPI_STREAM_HAPTIC].count < GLANCE) {
    status = read_on(reader, detail);
  }
  *out = q->count > 0 ? q->cells + q->first : NULL;
  *out_count = whole_packet(reader, stream) ? packet_size(reader, stream) : 0;
  return status < HAP_OK ? status : HAP_OK;
}

void hapi_reader_pop(hapi_reader *reader, hapi_stream stream)
{
  if (whole_packet(reader, stream)) {
    cell_queue *q = &reader->queues[stream];
    uint32_t size = packet_size(reader, stream);
    HAPI_ASSERT(q->first + size <= q->capacity && size <= q->count);
    q->first += size;
    q->count -= size;
  }
}
