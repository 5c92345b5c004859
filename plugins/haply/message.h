/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_HAPLY_MESSAGE_H
#define HAPODE_PLUGINS_HAPLY_MESSAGE_H

/* The texts of Haply's service. Metres, metres a second, newtons. */

#include <stdbool.h>
#include <stddef.h>

#define HAPI_HAPLY_ID 40    /* bytes of a device's name, with its end */
#define HAPI_HAPLY_NAMED 4  /* devices that a list keeps the names of */
#define HAPI_HAPLY_TEXT 320 /* bytes that a command has room in */

typedef struct hapi_haply_list {
  int count; /* of the message, maybe more than are named */
  char id[HAPI_HAPLY_NAMED][HAPI_HAPLY_ID];
} hapi_haply_list;

/* Which devices a reader wants; "": the first. */
typedef struct hapi_haply_wish {
  char arm[HAPI_HAPLY_ID];
  char grip[HAPI_HAPLY_ID];
} hapi_haply_wish;

typedef struct hapi_haply_state {
  bool has_arms; /* the message has the list inverse3 */
  hapi_haply_list arms;
  hapi_haply_list grips;
  bool has_position; /* and velocity, of the wanted arm */
  bool has_grip;     /* orientation of the wanted grip */
  unsigned buttons;  /* a, b, c from bit 0 on */
  double position[3];
  double velocity[3];
  double quat_wxyz[4];
} hapi_haply_state;

/* [any] False: no JSON, or not as the service writes it: numbers where numbers are, names of
 * letters, digits and "-_.:". What is not known is skipped. out is then not to be used. */
bool hapi_haply_read(const char *text, size_t length, const hapi_haply_wish *wish,
                     hapi_haply_state *out);

/* [any] The command for a force on an arm; its length. Numbers have a point whatever the locale. */
size_t hapi_haply_write_force(const char *id, const double force[3], char out[HAPI_HAPLY_TEXT]);

/* [any] Whether id is a name as above. */
bool hapi_haply_is_id(const char *id);

#endif
