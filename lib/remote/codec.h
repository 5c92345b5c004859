/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_CODEC_H
#define HAPODE_REMOTE_CODEC_H

/* What turns messages of an exchange into messages of a link and back, for one peer. The one of the
 * library is lib/wire; tests have another one as a witness. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/link.h>

/* Where what is encoded goes. */
typedef struct hapi_codec_out {
  void *of;
  hap_status (*send)(void *of, const hap_link_parcel *parcel); /* peer: not set */
} hapi_codec_out;

/* The messages of a sync: a world's end sends { model, near } and gives { state, NULL }, a loop's
 * end sends { state, NULL } and gives { model, near }. */
typedef struct hapi_codec {
  void *self;
  hap_status (*send)(void *self, void *const messages[2], const hapi_codec_out *out,
                     hap_detail *detail);
  /* HAP_ERROR_FORMAT: it is not what the other end's codec sends; nothing has changed. */
  hap_status (*take)(void *self, const hap_link_event *event, hap_detail *detail);
  /* Fills in a whole sync that is newer than the last one given; false: there is none. */
  bool (*give)(void *self, void *const messages[2]);
  void (*reset)(void *self); /* another peer: nothing is known of it */
} hapi_codec;

#endif
