/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/haply/json.h"

#include <string.h>

#include "base/number.h"

#define NUMBER_MOST 64 /* characters: doubles need 24 */

static bool json_fail(hapi_json *json)
{
  json->bad = true;
  json->at = json->end;
  return false;
}

/* The next character that is no blank; 0: none, or a mistake came before. */
static char json_look(hapi_json *json)
{
  while (json->at < json->end &&
         (*json->at == ' ' || *json->at == '\t' || *json->at == '\n' || *json->at == '\r')) {
    ++json->at;
  }
  if (json->bad || json->at >= json->end) {
    return '\0';
  }
  return *json->at;
}

static bool json_take(hapi_json *json, char c)
{
  if (json_look(json) != c) {
    return json_fail(json);
  }
  ++json->at;
  return true;
}

void hapi_json_begin(hapi_json *json, const char *text, size_t length)
{
  memset(json, 0, sizeof *json);
  json->at = text != NULL ? text : ""; /* of a message without bytes */
  json->end = json->at + length;
}

/* ---- objects and arrays ---- */

bool hapi_json_enter(hapi_json *json, char bracket)
{
  if (json->depth >= HAPI_JSON_DEPTH) {
    return json_fail(json);
  }
  if (!json_take(json, bracket)) {
    return false;
  }
  json->open[json->depth] = bracket;
  json->begun[json->depth] = false;
  ++json->depth;
  return true;
}

/* To the next of what is in the brackets; false: they close here. */
static bool json_next(hapi_json *json, char bracket, char closing)
{
  int top = json->depth - 1;
  if (top < 0 || json->open[top] != bracket) {
    return json_fail(json);
  }
  if (json_look(json) == closing) {
    ++json->at;
    --json->depth;
    return false;
  }
  if (json->begun[top] && !json_take(json, ',')) {
    return false;
  }
  json->begun[top] = true;
  return json_look(json) != '\0' || json_fail(json);
}

bool hapi_json_member(hapi_json *json, char *out_key, size_t size)
{
  return json_next(json, '{', '}') && hapi_json_string(json, out_key, size) && json_take(json, ':');
}

bool hapi_json_element(hapi_json *json)
{
  return json_next(json, '[', ']');
}

/* ---- strings ---- */

typedef struct json_text {
  char *out;
  size_t size;
  size_t used;
} json_text;

static void text_put(json_text *text, unsigned byte)
{
  if (text->used + 1 < text->size) {
    text->out[text->used++] = (char)byte;
  }
}

/* Halves of a pair, as of an emoji, become a question mark each: no text of ours has them. */
static void text_put_point(json_text *text, unsigned point)
{
  if (point >= 0xd800 && point < 0xe000) {
    text_put(text, '?');
  } else if (point < 0x80) {
    text_put(text, point != 0 ? point : '?');
  } else if (point < 0x800) {
    text_put(text, 0xc0 | point >> 6);
    text_put(text, 0x80 | (point & 0x3f));
  } else {
    text_put(text, 0xe0 | point >> 12);
    text_put(text, 0x80 | (point >> 6 & 0x3f));
    text_put(text, 0x80 | (point & 0x3f));
  }
}

static int hex_digit(char c)
{
  if (c >= '0' && c <= '9') {
    return c - '0';
  }
  if (c >= 'a' && c <= 'f') {
    return c - 'a' + 10;
  }
  return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

static bool string_hex(hapi_json *json, json_text *text)
{
  unsigned point = 0;
  for (int i = 0; i < 4; ++i, ++json->at) {
    int digit = json->at < json->end ? hex_digit(*json->at) : -1;
    if (digit < 0) {
      return json_fail(json);
    }
    point = point << 4 | (unsigned)digit;
  }
  text_put_point(text, point);
  return true;
}

/* Behind the backslash. */
static bool string_escape(hapi_json *json, json_text *text)
{
  static const char names[] = "\"\\/bfnrt";
  static const char meant[] = "\"\\/\b\f\n\r\t";
  if (json->at >= json->end || *json->at == '\0') {
    return json_fail(json);
  }
  const char *name = strchr(names, *json->at);
  if (*json->at == 'u') {
    ++json->at;
    return string_hex(json, text);
  }
  if (name == NULL) {
    return json_fail(json);
  }
  ++json->at;
  text_put(text, (unsigned char)meant[name - names]);
  return true;
}

bool hapi_json_string(hapi_json *json, char *out, size_t size)
{
  json_text text = {out, size, 0};
  if (!json_take(json, '"')) {
    return false;
  }
  while (json->at < json->end && *json->at != '"') {
    unsigned char c = (unsigned char)*json->at++;
    if (c < 0x20) {
      return json_fail(json);
    }
    if (c != '\\') {
      text_put(&text, c);
    } else if (!string_escape(json, &text)) {
      return false;
    }
  }
  if (size > 0) {
    out[text.used] = '\0';
  }
  return json_take(json, '"');
}

/* ---- numbers and words ---- */

static bool is_digit(char c)
{
  return c >= '0' && c <= '9';
}

static const char *digits_end(const char *at, const char *end)
{
  while (at < end && is_digit(*at)) {
    ++at;
  }
  return at;
}

/* NULL: no number as JSON has them, which begin with no plus, no point and no useless zero. */
static const char *number_end(const char *at, const char *end)
{
  at += at < end && *at == '-';
  const char *whole = digits_end(at, end);
  if (whole == at || (*at == '0' && whole > at + 1)) {
    return NULL;
  }
  at = whole;
  if (at < end && *at == '.') {
    const char *fraction = digits_end(at + 1, end);
    if (fraction == at + 1) {
      return NULL;
    }
    at = fraction;
  }
  if (at < end && (*at == 'e' || *at == 'E')) {
    ++at;
    at += at < end && (*at == '+' || *at == '-');
    const char *exponent = digits_end(at, end);
    return exponent > at ? exponent : NULL;
  }
  return at;
}

bool hapi_json_number(hapi_json *json, double *out)
{
  char text[NUMBER_MOST + 1];
  (void)json_look(json);
  const char *end = json->bad ? NULL : number_end(json->at, json->end);
  size_t length = end != NULL ? (size_t)(end - json->at) : 0;
  if (length == 0 || length > NUMBER_MOST) {
    return json_fail(json);
  }
  memcpy(text, json->at, length);
  text[length] = '\0';
  if (hapi_number_read(text, out) != text + length) {
    return json_fail(json);
  }
  json->at = end;
  return true;
}

static bool word_take(hapi_json *json, const char *word)
{
  size_t length = strlen(word);
  if ((size_t)(json->end - json->at) < length || memcmp(json->at, word, length) != 0) {
    return false;
  }
  json->at += length;
  return true;
}

bool hapi_json_boolean(hapi_json *json, bool *out)
{
  (void)json_look(json);
  *out = !json->bad && word_take(json, "true");
  return *out || (!json->bad && word_take(json, "false")) || json_fail(json);
}

/* ---- any value ---- */

static bool scalar_skip(hapi_json *json)
{
  double number;
  char none[1];
  switch (json_look(json)) {
    case '"':
      return hapi_json_string(json, none, sizeof none);
    case 't':
      return word_take(json, "true") || json_fail(json);
    case 'f':
      return word_take(json, "false") || json_fail(json);
    case 'n':
      return word_take(json, "null") || json_fail(json);
    default:
      return hapi_json_number(json, &number);
  }
}

/* Without recursion: what is open is in the reader. */
bool hapi_json_skip(hapi_json *json)
{
  int depth = json->depth;
  char none[1];
  do {
    char c = json_look(json);
    if (c == '{' || c == '[') {
      (void)hapi_json_enter(json, c);
    } else {
      (void)scalar_skip(json);
    }
    /* To the next value in what is open, out of what closes. */
    while (!json->bad && json->depth > depth &&
           !(json->open[json->depth - 1] == '{' ? hapi_json_member(json, none, sizeof none)
                                                : hapi_json_element(json))) {
    }
  } while (!json->bad && json->depth > depth);
  return !json->bad;
}

bool hapi_json_end(hapi_json *json)
{
  (void)json_look(json);
  if (json->depth != 0 || json->at != json->end) {
    return json_fail(json);
  }
  return !json->bad;
}
