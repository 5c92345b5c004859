/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_HAPLY_HANDSHAKE_H
#define HAPODE_PLUGINS_HAPLY_HANDSHAKE_H

/* The begin of a WebSocket connection, RFC 6455 section 4, as a client. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define HAPI_HANDSHAKE_KEY 25    /* 16 bytes in base64, with the end */
#define HAPI_HANDSHAKE_ACCEPT 29 /* 20 bytes likewise */

/* [any] The key of 16 random bytes. */
void hapi_handshake_key(const uint8_t nonce[16], char out[HAPI_HANDSHAKE_KEY]);

/* [any] What a server has to answer to the key: SHA-1 and base64. */
void hapi_handshake_accept(const char *key, char out[HAPI_HANDSHAKE_ACCEPT]);

/* [any] Whether an answer, up to its empty line, accepts a connection with that key. Names of
 * header lines have any case. */
bool hapi_handshake_is_accepted(const char *answer, size_t length, const char *key);

#endif
