/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_WORLD_H
#define HAPODE_WIRE_WORLD_H

/* A model and its near message as a frame, and back. */

#include "wire/sender.h"
#include "wire/tags.h"

/* At the server. */
typedef struct hapi_wire_world_out {
  hapi_wire_tags tags;
  uint64_t *vertex_keys; /* by point of the near message */
  uint32_t *bodies;      /* by slot: 1 + index in the model; 0: none */
  hapi_capacity capacity;
} hapi_wire_world_out;

bool hapi_wire_world_out_create(hapi_wire_world_out *world, const hapi_capacity *capacity);
void hapi_wire_world_out_finish(hapi_wire_world_out *world); /* also of a zeroed one */

/* A new frame of sender. Errors as of hapi_wire_server_send. */
hap_status hapi_wire_world_pack(hapi_wire_world_out *world, hapi_wire_sender *sender,
                                hapi_model *model, hapi_near *near, hap_detail *detail);

/* At the client: the newest that was accepted. */
typedef struct hapi_wire_world_in {
  const hapi_wire_shape *shape;
  hapi_capacity capacity;
  hapi_model *model; /* each with its arrays in one block */
  hapi_near *near;
  uint32_t *bodies; /* by slot: 1 + index in the model; 0: none */
  uint8_t *seen;    /* by slot of a joint or contact */
  bool fresh;       /* not given yet */
} hapi_wire_world_in;

bool hapi_wire_world_in_create(hapi_wire_world_in *world, const hapi_wire_shape *shape,
                               const hapi_capacity *capacity);
void hapi_wire_world_in_finish(hapi_wire_world_in *world); /* also of a zeroed one */

const char *hapi_wire_world_accept(void *of, const hapi_wire_frame *frame);
bool hapi_wire_world_give(hapi_wire_world_in *world, hapi_model *out_model, hapi_near *out_near);

#endif
