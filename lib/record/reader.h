/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RECORD_READER_H
#define HAPODE_RECORD_READER_H

/* Reads a recording. Open looks at the whole file once: head, machine, version, every block's sum
 * and every cell's form. Only then are its cells handed out, block by block, and looked at
 * again. */

#include "record/file.h"
#include "record/grammar.h"
#include "record/tape.h"

typedef struct hapi_reader hapi_reader;

/* incomplete: a file that breaks off, in a block or between two, is taken up to there; its end is
 * then HAPI_RECORD_GOES_ON. HAP_ERROR_IO; HAP_ERROR_FORMAT, with the place; HAP_ERROR_UNSUPPORTED
 * for another machine, version or ode (the configuration of ODE in use; NULL: any). */
hap_status hapi_reader_open(const char *path, bool incomplete, const char *ode, hapi_reader **out,
                            hap_detail *detail);
void hapi_reader_close(hapi_reader *reader); /* NULL allowed */

const hapi_file_info *hapi_reader_info(const hapi_reader *reader);
const char *hapi_reader_note(const hapi_reader *reader); /* info.note_size bytes, and a 0 */
const hapi_file_end *hapi_reader_end(const hapi_reader *reader);
const hapi_grammar *hapi_reader_whole(const hapi_reader *reader); /* after all of its cells */

/* The next packet of a stream, valid until the next call. HAP_END: there is none; errors as of open
 * where the file has changed since. pop goes on to the packet after it. */
hap_status hapi_reader_peek(hapi_reader *reader, hapi_stream stream, const hapi_cell **out,
                            uint32_t *out_count, hap_detail *detail);
/* The same, but reads on only until the loop's cells pile up. *out is NULL when no packet was
 * found; *out_count is 0 when only its begin was found. */
hap_status hapi_reader_glance(hapi_reader *reader, hapi_stream stream, const hapi_cell **out,
                              uint32_t *out_count, hap_detail *detail);
void hapi_reader_pop(hapi_reader *reader, hapi_stream stream);

#endif
