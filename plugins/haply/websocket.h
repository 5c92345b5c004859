/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_HAPLY_WEBSOCKET_H
#define HAPODE_PLUGINS_HAPLY_WEBSOCKET_H

/* A client's end of a WebSocket connection (RFC 6455); frames by libwslay. Pings and the close of
 * the other side are answered by it. One thread at a time has a connection. */

#include <stdbool.h>
#include <stddef.h>

#include <hapode/status.h>

#define HAPI_WEBSOCKET_MESSAGE_MOST 65536 /* bytes; a larger message ends the connection */

typedef struct hapi_websocket hapi_websocket;

typedef enum hapi_websocket_state {
  HAPI_WEBSOCKET_OPEN = 0,
  HAPI_WEBSOCKET_GONE,   /* the other side closed it or has gone */
  HAPI_WEBSOCKET_BROKEN, /* its bytes are no WebSocket, or a message is too large */
} hapi_websocket_state;

typedef struct hapi_websocket_place {
  const char *host;
  unsigned port;
  const char *device; /* for texts */
} hapi_websocket_place;

/* [control] Connects, within seconds. HAP_ERROR_UNSUPPORTED: built without libwslay;
 * HAP_ERROR_NOT_FOUND: nobody answers there; HAP_ERROR_FORMAT: what answers is no WebSocket. detail
 * says so, without what to do about it. */
HAP_NODISCARD hap_status hapi_websocket_open(const hapi_websocket_place *place, double seconds,
                                             hapi_websocket **out, hap_detail *detail);

/* [control] Around a connected socket behind the handshake, which it then owns; NULL: no memory, or
 * built without libwslay. */
hapi_websocket *hapi_websocket_adopt(int fd);

/* Sends a close and frees. NULL is allowed. Waits at most 100 ms until all has arrived. */
void hapi_websocket_close(hapi_websocket *ws);

/* Waits until there is something to read, at most ms. */
void hapi_websocket_wait(hapi_websocket *ws, int ms);

/* Takes what has come, without waiting, and calls for each whole text message. */
hapi_websocket_state hapi_websocket_receive(
    hapi_websocket *ws, void (*take)(void *user, const char *text, size_t length), void *user);

/* False: it did not go out, as earlier bytes have not, or the connection is closed. */
bool hapi_websocket_send(hapi_websocket *ws, const char *text, size_t length);

/* [any] Whether it was built with libwslay. */
bool hapi_websocket_is_there(void);

#endif
