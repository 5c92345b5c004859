/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RECORD_FILE_H
#define HAPODE_RECORD_FILE_H

/* The file of a recording: a head, then blocks. A block is a head and its bytes, deflated where
 * that makes them fewer, under a CRC-32 over both. The first block is INFO, the last one END.
 * Numbers are those of the machine that wrote it: only the same kind of machine can replay it
 * anyway. */

#include <assert.h>
#include <stddef.h>
#include <stdint.h>

#include <hapode/session.h>

#include "record/cell.h"

#define HAPI_FILE_MAGIC "HAPODREC"
#define HAPI_FILE_BYTE_ORDER 0x01020304u
#define HAPI_FILE_VERSION 2u
#define HAPI_BLOCK_MARK 0x4b4c4248u /* "HBLK" */
#define HAPI_BLOCK_CELLS 1024u      /* at most in a block */
#define HAPI_BLOCK_BYTES (HAPI_BLOCK_CELLS * 64u)
#define HAPI_NOTE_MAX 4096u

typedef struct hapi_file_head {
  char magic[8];
  uint32_t byte_order;
  uint32_t version;
  uint32_t cell_size;
  uint32_t crc; /* of the head, with 0 here */
  uint64_t reserved;
} hapi_file_head;

typedef enum hapi_block_type {
  HAPI_BLOCK_INFO = 1,     /* hapi_file_info and the note */
  HAPI_BLOCK_CELLS_OF = 2, /* + hapi_stream: cells */
  HAPI_BLOCK_END = 5       /* hapi_file_end */
} hapi_block_type;

typedef struct hapi_block_head {
  uint32_t mark;
  uint32_t type;
  uint32_t number; /* 0, 1, 2 ... */
  uint32_t size;   /* of its bytes */
  uint32_t stored; /* in the file; less than size: deflated */
  uint32_t crc;    /* of head, with 0 here, and bytes as stored */
} hapi_block_head;

/* What wrote the recording. */
typedef struct hapi_file_build {
  char library[16]; /* version */
  char machine[24]; /* processor, word size, operating system */
  char system[40];  /* C library: its mathematics may differ in the last digit */
  char ode[160];    /* dGetConfiguration */
} hapi_file_build;

typedef struct hapi_file_info {
  hapi_file_build build;
  double physics_hz;
  double contact_hz;
  double haptic_hz;
  int32_t drive;
  int32_t model;
  int32_t max_bodies;
  int32_t max_contacts;
  int32_t max_pointers;
  int32_t impulse_pose;
  int32_t probe;
  int32_t unused[2]; /* 0 */
  int32_t max_hull_points;
  int32_t guard;
  uint32_t joined_size; /* of hapi_joined */
  uint32_t note_size;
  uint32_t effects;     /* wishes at the start, as in base/wishes.h */
  int32_t max_sweeps;   /* files of before end before it; what a file lacks is 0 */
  int32_t range_hops_1; /* hap_expert_def.range_hops + 1 */
  double accuracy;
  int32_t iterations;
  int32_t more_substeps; /* hap_expert_def.substeps - 1 */
  double reuse;
  double look_ahead;
} hapi_file_info;

#define HAPI_FILE_INFO_LEAST offsetof(hapi_file_info, max_sweeps)

typedef struct hapi_file_end {
  uint32_t end; /* hapi_record_end */
  uint32_t reserved;
  uint64_t ticks;
  uint64_t lost; /* ticks that were not recorded after an overflow, as far as known */
  uint64_t cells[HAPI_STREAMS];
} hapi_file_end;

static_assert(sizeof(hapi_file_head) == 32 && sizeof(hapi_block_head) == 24, "the file's");

/* Fills build but for ode, and joined_size, as this library is. */
void hapi_file_describe(hapi_file_info *out);

/* For zalloc and zfree of zlib: memory of the hooks. */
void *hapi_file_zlib_allocate(void *user, unsigned count, unsigned size);
void hapi_file_zlib_release(void *user, void *memory);

uint32_t hapi_file_crc_head(const hapi_file_head *head);
uint32_t hapi_file_crc_block(const hapi_block_head *head, const void *stored);

#endif
