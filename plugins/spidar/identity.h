/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_IDENTITY_H
#define HAPODE_PLUGINS_SPIDAR_IDENTITY_H

/* Which USB adapter a serial port is, as sysfs says. Nothing is sent to a port for it. The name
 * alone does not tell: /dev/ttyUSB0 is whoever was plugged in first. */

#include <stdbool.h>

#define HAPI_SPIDAR_SYSFS "/sys"

/* Empty texts: not known. */
typedef struct hapi_spidar_identity {
  bool usb;          /* false: no USB adapter, nothing else is filled in */
  char product[16];  /* "0403:6001" */
  char interface[8]; /* "00": an adapter may have several ports */
  char serial[64];   /* of the maker */
  char place[32];    /* "1-2.4": the socket */
  char about[64];    /* for people: the product's name */
} hapi_spidar_identity;

/* [any, also a signal handler] Of a port by its name, such as "ttyUSB0". sysfs:
 * HAPI_SPIDAR_SYSFS, or another folder in tests. */
void hapi_spidar_identity_of(const char *sysfs, const char *name, hapi_spidar_identity *out);

/* [control] Of a path, such as "/dev/serial/by-id/...". */
void hapi_spidar_identity_at(const char *sysfs, const char *path, hapi_spidar_identity *out);

/* [any, also a signal handler] The ports of USB adapters, one after the other: *at begins with 0.
 * False: no more. */
bool hapi_spidar_identity_next(const char *sysfs, int *at, char *out_path, unsigned size,
                               hapi_spidar_identity *out);

/* [any, also a signal handler] The path of the port that the adapter has now, in size bytes. The
 * one in the same socket comes first. Elsewhere it is known by its serial number, unless two have
 * the same. False: it is not there, or cannot be told. */
bool hapi_spidar_identity_find(const char *sysfs, const hapi_spidar_identity *identity, char *out,
                               unsigned size);

#endif
