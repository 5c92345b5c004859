/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/haply/websocket.h"

#include "base/log.h"

#ifndef HAPODE_WSLAY

#include <unistd.h>

bool hapi_websocket_is_there(void)
{
  return false;
}

hap_status hapi_websocket_open(const hapi_websocket_place *place, double seconds,
                               hapi_websocket **out, hap_detail *detail)
{
  (void)seconds;
  *out = NULL;
  return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                   "%s: hapode was built without libwslay; install it (Debian: libwslay-dev) and "
                   "build hapode anew",
                   place->device);
}

hapi_websocket *hapi_websocket_adopt(int fd)
{
  (void)close(fd);
  return NULL;
}

void hapi_websocket_close(hapi_websocket *ws)
{
  (void)ws;
}

void hapi_websocket_wait(hapi_websocket *ws, int ms)
{
  (void)ws, (void)ms;
}

hapi_websocket_state hapi_websocket_receive(
    hapi_websocket *ws, void (*take)(void *user, const char *text, size_t length), void *user)
{
  (void)ws, (void)take, (void)user;
  return HAPI_WEBSOCKET_GONE;
}

bool hapi_websocket_send(hapi_websocket *ws, const char *text, size_t length)
{
  (void)ws, (void)text, (void)length;
  return false;
}

#else

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <unistd.h>
#include <wslay/wslay.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "plugins/haply/handshake.h"

#define ANSWER_MOST 4096
#define RECEIVE_MOST 32768 /* bytes in one call, so that a flood does not keep it */
#define CLOSE_WAIT_NS 100000000LL

struct hapi_websocket {
  int fd;
  wslay_event_context_ptr context;
  bool failed;     /* a call of the socket */
  size_t received; /* in this call */
  /* Came behind the answer of the handshake. */
  char rest[ANSWER_MOST];
  size_t rest_at;
  size_t rest_end;
  void (*take)(void *user, const char *text, size_t length);
  void *user;
};

bool hapi_websocket_is_there(void)
{
  return true;
}

/* ---- what libwslay calls ---- */

static ssize_t rest_take(hapi_websocket *ws, uint8_t *out, size_t size)
{
  size_t count = ws->rest_end - ws->rest_at;
  count = count < size ? count : size;
  memcpy(out, ws->rest + ws->rest_at, count);
  ws->rest_at += count;
  return (ssize_t)count;
}

static ssize_t on_receive(wslay_event_context_ptr context, uint8_t *out, size_t size, int flags,
                          void *user)
{
  hapi_websocket *ws = user;
  ssize_t got = 0;
  (void)flags;
  if (ws->rest_at < ws->rest_end) {
    return rest_take(ws, out, size);
  }
  if (ws->received >= RECEIVE_MOST) {
    wslay_event_set_error(context, WSLAY_ERR_WOULDBLOCK);
    return -1;
  }
  do {
    got = recv(ws->fd, out, size, 0);
  } while (got < 0 && errno == EINTR);
  if (got > 0) {
    ws->received += (size_t)got;
    return got;
  }
  bool later = got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
  ws->failed = ws->failed || !later;
  wslay_event_set_error(context, later ? WSLAY_ERR_WOULDBLOCK : WSLAY_ERR_CALLBACK_FAILURE);
  return -1;
}

static ssize_t on_send(wslay_event_context_ptr context, const uint8_t *bytes, size_t count,
                       int flags, void *user)
{
  hapi_websocket *ws = user;
  ssize_t sent = 0;
  int more = (flags & WSLAY_MSG_MORE) != 0 ? MSG_MORE : 0;
  do {
    sent = send(ws->fd, bytes, count, MSG_NOSIGNAL | more);
  } while (sent < 0 && errno == EINTR);
  if (sent >= 0) {
    return sent;
  }
  bool later = errno == EAGAIN || errno == EWOULDBLOCK;
  ws->failed = ws->failed || !later;
  wslay_event_set_error(context, later ? WSLAY_ERR_WOULDBLOCK : WSLAY_ERR_CALLBACK_FAILURE);
  return -1;
}

static int on_mask(wslay_event_context_ptr context, uint8_t *out, size_t size, void *user)
{
  (void)context, (void)user;
  return getrandom(out, size, 0) == (ssize_t)size ? 0 : -1;
}

static void on_message(wslay_event_context_ptr context,
                       const struct wslay_event_on_msg_recv_arg *message, void *user)
{
  hapi_websocket *ws = user;
  (void)context;
  if (message->opcode == WSLAY_TEXT_FRAME && ws->take != NULL) {
    ws->take(ws->user, (const char *)message->msg, message->msg_length);
  }
}

/* ---- life ---- */

hapi_websocket *hapi_websocket_adopt(int fd)
{
  static const struct wslay_event_callbacks callbacks = {.recv_callback = on_receive,
                                                         .send_callback = on_send,
                                                         .genmask_callback = on_mask,
                                                         .on_msg_recv_callback = on_message};
  int on = 1;
  hapi_websocket *ws = hapi_alloc(sizeof *ws);
  if (ws == NULL || wslay_event_context_client_init(&ws->context, &callbacks, ws) != 0) {
    hapi_free(ws);
    close(fd);
    return NULL;
  }
  ws->fd = fd;
  (void)fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
  (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on); /* a force does not wait */
  wslay_event_config_set_max_recv_msg_length(ws->context, HAPI_WEBSOCKET_MESSAGE_MOST);
  return ws;
}

/* Until the other side has closed, too: closed with bytes unread, the connection would be reset,
 * and what was sent last, a zero, might be lost. */
static void socket_drain(int fd, int64_t end_ns)
{
  char bytes[1024];
  ssize_t got = 1;
  (void)shutdown(fd, SHUT_WR);
  while (got != 0 && hapi_clock_now() < end_ns) {
    struct pollfd readable = {fd, POLLIN, 0};
    got = poll(&readable, 1, 5) > 0 ? recv(fd, bytes, sizeof bytes, 0) : 1;
    got = got < 0 && errno != EAGAIN && errno != EINTR ? 0 : got;
  }
}

void hapi_websocket_close(hapi_websocket *ws)
{
  if (ws == NULL) {
    return;
  }
  int64_t end_ns = hapi_clock_now() + CLOSE_WAIT_NS;
  (void)wslay_event_queue_close(ws->context, WSLAY_CODE_NORMAL_CLOSURE, NULL, 0);
  while (!ws->failed && wslay_event_want_write(ws->context) && wslay_event_send(ws->context) == 0 &&
         wslay_event_want_write(ws->context) && hapi_clock_now() < end_ns) {
    struct pollfd writable = {ws->fd, POLLOUT, 0};
    (void)poll(&writable, 1, 5);
  }
  wslay_event_context_free(ws->context);
  socket_drain(ws->fd, end_ns);
  close(ws->fd);
  hapi_free(ws);
}

/* ---- the connection ---- */

static bool fd_await(int fd, short events, int64_t end_ns)
{
  struct pollfd ready = {fd, events, 0};
  int64_t left_ms = (end_ns - hapi_clock_now()) / 1000000 + 1;
  int got = left_ms > 0 ? poll(&ready, 1, (int)left_ms) : 0;
  return got > 0 || (got < 0 && errno == EINTR);
}

static int address_connect(const struct addrinfo *address, int64_t end_ns)
{
  int error = 0;
  socklen_t size = sizeof error;
  int fd = socket(address->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) {
    return -1;
  }
  bool good = connect(fd, address->ai_addr, address->ai_addrlen) == 0 ||
              (errno == EINPROGRESS && fd_await(fd, POLLOUT, end_ns) &&
               getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size) == 0 && error == 0);
  if (!good) {
    error = error != 0 ? error : errno;
    close(fd);
    errno = error;
    return -1;
  }
  return fd;
}

static int place_connect(const hapi_websocket_place *place, int64_t end_ns, hap_detail *detail)
{
  const struct addrinfo hints = {.ai_socktype = SOCK_STREAM};
  struct addrinfo *found = NULL;
  char port[16];
  int fd = -1;
  snprintf(port, sizeof port, "%u", place->port);
  int failed = getaddrinfo(place->host, port, &hints, &found);
  for (const struct addrinfo *at = found; failed == 0 && at != NULL && fd < 0; at = at->ai_next) {
    fd = address_connect(at, end_ns);
  }
  if (fd < 0) {
    (void)hapi_fail(detail, HAP_ERROR_NOT_FOUND, "%s: nobody answers at ws://%.100s:%u (%s)",
                    place->device, place->host, place->port,
                    failed != 0 ? gai_strerror(failed) : strerror(errno));
  }
  if (found != NULL) {
    freeaddrinfo(found);
  }
  return fd;
}

static bool request_send(int fd, const hapi_websocket_place *place, const char *key)
{
  char text[512];
  int length = snprintf(text, sizeof text,
                        "GET / HTTP/1.1\r\nHost: %.100s:%u\r\nUpgrade: websocket\r\n"
                        "Connection: Upgrade\r\nSec-WebSocket-Key: %s\r\n"
                        "Sec-WebSocket-Version: 13\r\n\r\n",
                        place->host, place->port, key);
  return send(fd, text, (size_t)length, MSG_NOSIGNAL) == length;
}

/* Up to its empty line; bytes behind it are the first frames. Its length, 0: it did not come. */
static size_t answer_receive(int fd, int64_t end_ns, char out[ANSWER_MOST], size_t *out_all)
{
  static const char empty[] = "\r\n\r\n";
  size_t used = 0;
  while (used < ANSWER_MOST && fd_await(fd, POLLIN, end_ns)) {
    ssize_t got = recv(fd, out + used, ANSWER_MOST - used, 0);
    if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) {
      break;
    }
    used += got > 0 ? (size_t)got : 0;
    const char *end = memmem(out, used, empty, 4);
    if (end != NULL) {
      *out_all = used;
      return (size_t)(end - out) + 4;
    }
  }
  *out_all = used;
  return 0;
}

static hap_status handshake_fail(const hapi_websocket_place *place, const char *answer,
                                 size_t length, hap_detail *detail)
{
  char line[60] = "nothing";
  for (size_t i = 0; i < length && i + 1 < sizeof line; ++i) {
    bool shown = answer[i] >= ' ' && answer[i] <= '~';
    if (answer[i] == '\r' || answer[i] == '\n') {
      break;
    }
    line[i] = '?';
    if (shown) {
      line[i] = answer[i];
    }
    line[i + 1] = '\0';
  }
  return hapi_fail(detail, HAP_ERROR_FORMAT,
                   "%s: what listens at %.100s:%u does not speak WebSocket: it answers '%s'",
                   place->device, place->host, place->port, line);
}

hap_status hapi_websocket_open(const hapi_websocket_place *place, double seconds,
                               hapi_websocket **out, hap_detail *detail)
{
  int64_t end_ns = hapi_clock_now() + (int64_t)(1e9 * seconds);
  uint8_t nonce[16];
  char key[HAPI_HANDSHAKE_KEY];
  char answer[ANSWER_MOST];
  size_t all = 0;
  *out = NULL;
  int fd = place_connect(place, end_ns, detail);
  if (fd < 0) {
    return HAP_ERROR_NOT_FOUND;
  }
  if (getrandom(nonce, sizeof nonce, 0) != (ssize_t)sizeof nonce) {
    close(fd);
    return hapi_fail(detail, HAP_ERROR_SYSTEM, "%s: no random numbers: %s", place->device,
                     strerror(errno));
  }
  hapi_handshake_key(nonce, key);
  size_t length = request_send(fd, place, key) ? answer_receive(fd, end_ns, answer, &all) : 0;
  if (!hapi_handshake_is_accepted(answer, length, key)) {
    close(fd);
    return handshake_fail(place, answer, all, detail);
  }
  *out = hapi_websocket_adopt(fd);
  if (*out == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "%s: out of memory", place->device);
  }
  (*out)->rest_end = all - length;
  memcpy((*out)->rest, answer + length, all - length);
  return HAP_OK;
}

/* ---- messages ---- */

void hapi_websocket_wait(hapi_websocket *ws, int ms)
{
  struct pollfd readable = {ws->fd, POLLIN, 0};
  if (ws->rest_at == ws->rest_end && !ws->failed) {
    (void)poll(&readable, 1, ms);
  }
}

hapi_websocket_state hapi_websocket_receive(
    hapi_websocket *ws, void (*take)(void *user, const char *text, size_t length), void *user)
{
  ws->take = take;
  ws->user = user;
  ws->received = 0;
  int got = wslay_event_recv(ws->context);
  if (ws->failed) {
    return HAPI_WEBSOCKET_GONE;
  }
  if (got != 0) {
    return HAPI_WEBSOCKET_BROKEN;
  }
  (void)wslay_event_send(ws->context); /* answers to pings, or a close with the reason */
  if (wslay_event_get_close_received(ws->context)) {
    return HAPI_WEBSOCKET_GONE;
  }
  /* Closes by itself what it does not understand. */
  return wslay_event_get_close_sent(ws->context) || !wslay_event_get_read_enabled(ws->context)
             ? HAPI_WEBSOCKET_BROKEN
             : HAPI_WEBSOCKET_OPEN;
}

bool hapi_websocket_send(hapi_websocket *ws, const char *text, size_t length)
{
  const struct wslay_event_msg message = {WSLAY_TEXT_FRAME, (const uint8_t *)text, length};
  /* What has not gone out must not be followed: it would be old when it arrives. */
  if (ws->failed || (wslay_event_want_write(ws->context) &&
                     (wslay_event_send(ws->context) != 0 || wslay_event_want_write(ws->context)))) {
    return false;
  }
  return wslay_event_queue_msg(ws->context, &message) == 0 && wslay_event_send(ws->context) == 0 &&
         !wslay_event_want_write(ws->context);
}

#endif
