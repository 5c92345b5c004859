/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* plugins/haply: the bytes are what a service sends. The first chooses the reader: JSON and
 * messages, frames behind the handshake (in pieces of a size by the second), or the answer to the
 * handshake. */

#include <math.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include "plugins/haply/handshake.h"
#include "plugins/haply/json.h"
#include "plugins/haply/message.h"
#include "plugins/haply/websocket.h"
#include "tests/fuzz/fuzz.h"

#define PIECES_MOST 100

static bool value_walk(hapi_json *json);

static char next_of(const hapi_json *json)
{
  const char *at = json->at;
  while (at < json->end && strchr(" \t\n\r", *at) != NULL && *at != '\0') {
    ++at;
  }
  return at < json->end ? *at : '\0';
}

/* Piece by piece, where hapi_json_skip goes over all at once. */
static bool inside_walk(hapi_json *json, char bracket)
{
  char key[8];
  bool good = hapi_json_enter(json, bracket);
  while (good &&
         (bracket == '{' ? hapi_json_member(json, key, sizeof key) : hapi_json_element(json))) {
    FUZZ_CHECK(bracket != '{' || strlen(key) < sizeof key);
    good = value_walk(json);
  }
  return good && !json->bad;
}

static bool value_walk(hapi_json *json)
{
  double number = 0.5;
  char text[16];
  bool truth;
  char c = next_of(json);
  switch (c) {
    case '{':
    case '[':
      return inside_walk(json, c);
    case '"':
      return hapi_json_string(json, text, sizeof text) && strlen(text) < sizeof text;
    case 't':
    case 'f':
      return hapi_json_boolean(json, &truth);
    case 'n':
      return hapi_json_skip(json);
    default:
      return hapi_json_number(json, &number) && isfinite(number);
  }
}

static void json_read(const char *text, size_t length)
{
  hapi_json whole;
  hapi_json pieces;
  hapi_json_begin(&whole, text, length);
  hapi_json_begin(&pieces, text, length);
  bool good = hapi_json_skip(&whole);
  FUZZ_CHECK(value_walk(&pieces) == good);
  if (good) {
    FUZZ_CHECK(whole.at == pieces.at && whole.depth == 0);
  }
  FUZZ_CHECK(hapi_json_end(&whole) == hapi_json_end(&pieces));
  FUZZ_CHECK(!hapi_json_skip(&whole) && whole.bad); /* behind the end there is nothing */
}

static void message_read(const char *text, size_t length)
{
  static const hapi_haply_wish wishes[] = {{"", ""}, {"A", "G"}};
  for (int i = 0; i < 2; ++i) {
    hapi_haply_state state;
    hapi_json json;
    if (!hapi_haply_read(text, length, &wishes[i], &state)) {
      continue;
    }
    hapi_json_begin(&json, text, length);
    FUZZ_CHECK(hapi_json_skip(&json) && hapi_json_end(&json));
    FUZZ_CHECK(!state.has_position || state.arms.count > 0);
    FUZZ_CHECK(!state.has_grip || state.grips.count > 0);
    FUZZ_CHECK(state.buttons < 8);
    for (int k = 0; k < 3; ++k) {
      FUZZ_CHECK(isfinite(state.position[k]) && isfinite(state.velocity[k]) &&
                 isfinite(state.quat_wxyz[k]));
    }
    for (int k = 0; k < state.arms.count && k < HAPI_HAPLY_NAMED; ++k) {
      char out[HAPI_HAPLY_TEXT];
      FUZZ_CHECK(hapi_haply_is_id(state.arms.id[k]));
      FUZZ_CHECK(hapi_haply_write_force(state.arms.id[k], state.position, out) == strlen(out));
      hapi_json_begin(&json, out, strlen(out));
      FUZZ_CHECK(hapi_json_skip(&json) && hapi_json_end(&json));
    }
  }
}

static void text_take(void *user, const char *text, size_t length)
{
  size_t *count = user;
  FUZZ_CHECK(length <= HAPI_WEBSOCKET_MESSAGE_MOST);
  json_read(text, length);
  ++*count;
}

static void frames_read(const uint8_t *data, size_t size, size_t piece)
{
  int ends[2];
  size_t count = 0;
  char dropped[512];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends) != 0) {
    return;
  }
  hapi_websocket *ws = hapi_websocket_adopt(ends[0]);
  hapi_websocket_state state = HAPI_WEBSOCKET_OPEN;
  for (size_t at = 0; ws != NULL && at < size && state == HAPI_WEBSOCKET_OPEN; at += piece) {
    size_t length = size - at < piece ? size - at : piece;
    FUZZ_CHECK(write(ends[1], data + at, length) == (ssize_t)length);
    state = hapi_websocket_receive(ws, text_take, &count);
    while (read(ends[1], dropped, sizeof dropped) > 0) {
    }
  }
  FUZZ_CHECK(count <= size / 2);
  if (ws != NULL && state == HAPI_WEBSOCKET_OPEN) {
    (void)hapi_websocket_send(ws, "{}", 2);
  }
  close(ends[1]);
  if (ws != NULL) {
    FUZZ_CHECK(hapi_websocket_receive(ws, text_take, &count) != HAPI_WEBSOCKET_OPEN);
  }
  hapi_websocket_close(ws);
}

void fuzz_one(const uint8_t *data, size_t size)
{
  static const char key[] = "dGhlIHNhbXBsZSBub25jZQ==";
  static const char accept[] = "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=";
  signal(SIGPIPE, SIG_IGN);
  if (size < 2) {
    return;
  }
  char *text = malloc(size); /* of just its size: a sanitizer sees who reads beyond */
  if (text == NULL) {
    return;
  }
  size_t length = size - 2;
  memcpy(text, data + 2, length);
  if (data[0] % 3 == 0) {
    json_read(text, length);
    message_read(text, length);
  } else if (data[0] % 3 == 1) {
    size_t piece = 1 + data[1];
    frames_read(data + 2, length, length / piece > PIECES_MOST ? length : piece);
  } else if (hapi_handshake_is_accepted(text, length, key)) {
    FUZZ_CHECK(memmem(text, length, accept, strlen(accept)) != NULL);
    FUZZ_CHECK(memcmp(text, "HTTP/1.1 101", 12) == 0);
  }
  free(text);
}
