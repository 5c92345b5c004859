/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_STATE_H
#define HAPODE_WIRE_STATE_H

/* A state as a frame, and back. */

#include "wire/sender.h"

/* At the client: a new frame of sender. Errors as of hapi_wire_client_send. */
hap_status hapi_wire_state_pack(hapi_wire_sender *sender, hapi_state *state, hap_detail *detail);

/* At the server: the newest that was accepted. */
typedef struct hapi_wire_state_in {
  const hapi_wire_shape *shape;
  hapi_capacity capacity;
  hapi_state *state; /* with its arrays in one block */
  bool fresh;        /* not given yet */
} hapi_wire_state_in;

bool hapi_wire_state_in_create(hapi_wire_state_in *state, const hapi_wire_shape *shape,
                               const hapi_capacity *capacity);
void hapi_wire_state_in_finish(hapi_wire_state_in *state); /* also of a zeroed one */

const char *hapi_wire_state_accept(void *of, const hapi_wire_frame *frame);
bool hapi_wire_state_give(hapi_wire_state_in *state, hapi_state *out);

#endif
