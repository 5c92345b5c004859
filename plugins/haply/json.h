/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_HAPLY_JSON_H
#define HAPODE_PLUGINS_HAPLY_JSON_H

/* A strict reader of JSON text (RFC 8259): walks through it once, allocates nothing, and refuses
 * whatever the grammar does not have, such as NaN or a decimal comma. After the first mistake every
 * call fails, and bad stays set.
 *
 *   hapi_json_enter(&json, '{');
 *   while (hapi_json_member(&json, key, sizeof key)) {
 *     strcmp(key, "x") == 0 ? hapi_json_number(&json, &x) : hapi_json_skip(&json);
 *   }
 *   good = hapi_json_end(&json);
 *
 * [any], as all of a reader belongs to its caller. */

#include <stdbool.h>
#include <stddef.h>

#define HAPI_JSON_DEPTH 32 /* of values in values */

typedef struct hapi_json {
  const char *at;
  const char *end;
  bool bad;
  int depth;
  char open[HAPI_JSON_DEPTH];  /* brackets that are open */
  bool begun[HAPI_JSON_DEPTH]; /* a value came in them */
} hapi_json;

/* text need not end with a zero byte, and stays until the reader is not used any more. */
void hapi_json_begin(hapi_json *json, const char *text, size_t length);

/* The next value is an object '{' or an array '['. */
bool hapi_json_enter(hapi_json *json, char bracket);
/* To the value of the next member; its key, cut to size. False: the object has ended, or bad. */
bool hapi_json_member(hapi_json *json, char *out_key, size_t size);
/* To the next value of the array, likewise. */
bool hapi_json_element(hapi_json *json);

/* The value; false, and bad, when it is of another kind. */
bool hapi_json_number(hapi_json *json, double *out);
bool hapi_json_boolean(hapi_json *json, bool *out);
bool hapi_json_string(hapi_json *json, char *out, size_t size); /* UTF-8, cut to size */
/* Any value. */
bool hapi_json_skip(hapi_json *json);

/* True: the whole text was one good value. */
bool hapi_json_end(hapi_json *json);

#endif
