/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_REPLAY_CSV_H
#define HAPODE_PLUGINS_REPLAY_CSV_H

/* Reads a recording line by line: header "t,x,y,z" or "t,x,y,z,qw,qx,qy,qz", then numbers. Lines
 * end with LF or CRLF; a byte order mark, blanks around fields and blank lines at the end are
 * allowed. Every error is HAP_ERROR_IO or HAP_ERROR_FORMAT with "FILE, line N: what". */

#include <stdbool.h>
#include <stdio.h>

#include <hapode/status.h>

#define HAPI_CSV_COLUMNS_MAX 8

typedef struct hapi_csv {
  const char *path; /* borrowed */
  FILE *file;
  unsigned long line; /* of text, from 1 */
  int columns;        /* 4 or 8 */
  char text[512];     /* fixed: a file without line ends must not fill the memory */
} hapi_csv;

/* Opens and reads the header. Close it also after an error. detail is never NULL here. */
HAP_NODISCARD hap_status hapi_csv_open(hapi_csv *csv, const char *path, hap_detail *detail);
void hapi_csv_close(hapi_csv *csv);

/* The next row's columns, finite; HAP_END behind the last one. */
HAP_NODISCARD hap_status hapi_csv_next(hapi_csv *csv, double row[HAPI_CSV_COLUMNS_MAX],
                                       hap_detail *detail);

/* "FILE, line N: text", N the newest line. */
hap_status hapi_csv_fail(const hapi_csv *csv, hap_status status, const char *text,
                         hap_detail *detail);

#endif
