/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/haply/handshake.h"

#include <string.h>
#include <strings.h>

#define MAGIC "258EAFA5-E914-47DA-95CA-C5AB0DC85B11" /* RFC 6455, 1.3 */
#define BLOCK 64
#define PADDING 64 /* base64: place of its sign */

/* ---- SHA-1, RFC 3174: the protocol asks for it, as a check and not for secrecy ---- */

static uint32_t rotate_left(uint32_t x, int bits)
{
  return x << bits | x >> (32 - bits);
}

static void sha1_block(uint32_t state[5], const uint8_t block[BLOCK])
{
  uint32_t w[80];
  uint32_t a = state[0];
  uint32_t b = state[1];
  uint32_t c = state[2];
  uint32_t d = state[3];
  uint32_t e = state[4];
  for (int t = 0; t < 16; ++t) {
    w[t] = (uint32_t)block[4 * t] << 24 | (uint32_t)block[4 * t + 1] << 16 |
           (uint32_t)block[4 * t + 2] << 8 | block[4 * t + 3];
  }
  for (int t = 16; t < 80; ++t) {
    w[t] = rotate_left(w[t - 3] ^ w[t - 8] ^ w[t - 14] ^ w[t - 16], 1);
  }
  for (int t = 0; t < 80; ++t) {
    uint32_t f = t < 20   ? ((b & c) | (~b & d)) + 0x5a827999u
                 : t < 40 ? (b ^ c ^ d) + 0x6ed9eba1u
                 : t < 60 ? ((b & c) | (b & d) | (c & d)) + 0x8f1bbcdcu
                          : (b ^ c ^ d) + 0xca62c1d6u;
    uint32_t next = rotate_left(a, 5) + f + e + w[t];
    e = d;
    d = c;
    c = rotate_left(b, 30);
    b = a;
    a = next;
  }
  state[0] += a;
  state[1] += b;
  state[2] += c;
  state[3] += d;
  state[4] += e;
}

/* Of at most two blocks: length < 120. */
static void sha1_short(const uint8_t *text, size_t length, uint8_t out[20])
{
  uint32_t state[5] = {0x67452301u, 0xefcdab89u, 0x98badcfeu, 0x10325476u, 0xc3d2e1f0u};
  uint8_t padded[2 * BLOCK] = {0};
  size_t blocks = length + 9 <= BLOCK ? 1 : 2;
  memcpy(padded, text, length);
  padded[length] = 0x80;
  padded[blocks * BLOCK - 2] = (uint8_t)(8 * length >> 8);
  padded[blocks * BLOCK - 1] = (uint8_t)(8 * length);
  for (size_t i = 0; i < blocks; ++i) {
    sha1_block(state, padded + BLOCK * i);
  }
  for (int i = 0; i < 20; ++i) {
    out[i] = (uint8_t)(state[i / 4] >> (24 - 8 * (i % 4)));
  }
}

/* ---- base64, RFC 4648 ---- */

static void base64_write(const uint8_t *bytes, size_t count, char *out)
{
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/=";
  for (size_t i = 0; i < count; i += 3) {
    size_t left = count - i;
    uint32_t group = (uint32_t)bytes[i] << 16 | (left > 1 ? (uint32_t)bytes[i + 1] << 8 : 0) |
                     (left > 2 ? bytes[i + 2] : 0u);
    *out++ = digits[group >> 18];
    *out++ = digits[group >> 12 & 63];
    *out++ = digits[left > 1 ? group >> 6 & 63 : PADDING];
    *out++ = digits[left > 2 ? group & 63 : PADDING];
  }
  *out = '\0';
}

void hapi_handshake_key(const uint8_t nonce[16], char out[HAPI_HANDSHAKE_KEY])
{
  base64_write(nonce, 16, out);
}

void hapi_handshake_accept(const char *key, char out[HAPI_HANDSHAKE_ACCEPT])
{
  uint8_t text[HAPI_HANDSHAKE_KEY + sizeof MAGIC];
  uint8_t digest[20];
  size_t length = strnlen(key, HAPI_HANDSHAKE_KEY - 1);
  memcpy(text, key, length);
  memcpy(text + length, MAGIC, sizeof MAGIC - 1);
  sha1_short(text, length + sizeof MAGIC - 1, digest);
  base64_write(digest, sizeof digest, out);
}

/* ---- the answer ---- */

/* The value of a header line; its length, or 0: there is none. */
static size_t header_find(const char *answer, size_t length, const char *name, const char **out)
{
  const char *end = answer + length;
  const char *line = memchr(answer, '\n', length);
  size_t name_length = strlen(name);
  for (; line != NULL; line = memchr(line, '\n', (size_t)(end - line))) {
    ++line;
    const char *stop = memchr(line, '\r', (size_t)(end - line));
    const char *value = line + name_length + 1;
    if (stop == NULL || value > stop || strncasecmp(line, name, name_length) != 0 ||
        line[name_length] != ':') {
      continue;
    }
    while (value < stop && *value == ' ') {
      ++value;
    }
    while (stop > value && stop[-1] == ' ') {
      --stop;
    }
    *out = value;
    return (size_t)(stop - value);
  }
  return 0;
}

bool hapi_handshake_is_accepted(const char *answer, size_t length, const char *key)
{
  static const char status[] = "HTTP/1.1 101";
  char wanted[HAPI_HANDSHAKE_ACCEPT];
  const char *upgrade = "";
  const char *accept = "";
  hapi_handshake_accept(key, wanted);
  return length > sizeof status && memcmp(answer, status, sizeof status - 1) == 0 &&
         header_find(answer, length, "Upgrade", &upgrade) == strlen("websocket") &&
         strncasecmp(upgrade, "websocket", strlen("websocket")) == 0 &&
         header_find(answer, length, "Sec-WebSocket-Accept", &accept) == strlen(wanted) &&
         memcmp(accept, wanted, strlen(wanted)) == 0;
}
