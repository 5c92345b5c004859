/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include <hapode/link.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/def.h"
#include "base/log.h"
#include "link/link_internal.h"

/* A link inside the process, on whatever clock its ends are polled with. A message is put into the
 * queue of the other end with the time of its arrival. Both ends have one owner, so there is no
 * lock. */

#define QUEUE_MOST 8192u /* messages on their way to an end */

typedef struct local_message {
  struct local_message *next;
  int64_t due_ns;
  hap_link_event event; /* data: what follows the struct */
} local_message;

/* The messages on their way to one end, by arrival; of equal ones in the order of sending. */
typedef struct local_queue {
  local_message *first;
  uint32_t count;
} local_queue;

/* One direction between a client and the server. */
typedef struct local_path {
  hap_link_path_def def;
  uint64_t random;         /* state of the generator */
  int64_t reliable_due_ns; /* of the last reliable message: none comes before it */
} local_path;

typedef struct local_hub local_hub;

typedef struct local_end {
  local_hub *hub;
  uint32_t number; /* of a client; HAP_LINK_SERVER of the server */
  bool asked;      /* a client: it has told that it joins */
  bool heard;      /* a client: the server has heard of it */
  bool joined;     /* a client: the answer has come */
  char name[HAP_LINK_NAME_MOST + 1];
  int64_t now_ns;     /* of its last call */
  local_queue in;     /* on its way to here */
  local_message *out; /* given by the last poll */
  local_path up;      /* of a client */
  local_path down;    /* likewise */
  struct local_end *next;
} local_end;

/* The server's end and all clients; freed with the last of them. */
struct local_hub {
  local_end *server;  /* NULL: closed */
  local_end *clients; /* open ones */
  uint32_t number;    /* of the newest client */
};

static const hap_link_path_def path_defaults = {.cookie = 0x484c5031u, .seed = 1};
static const hapi_def_type path_type = HAPI_DEF_TYPE(hap_link_path_def, path_defaults);

void hap_link_path_def_init(hap_link_path_def *def, size_t size_of_def)
{
  hapi_def_init(&path_type, def, size_of_def);
}

/* ---- the generator: SplitMix64 (Steele, Lea, Flood 2014) ---- */

/* 0 <= x < 1 */
static double path_draw(local_path *path)
{
  uint64_t x = path->random += 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return (double)((x ^ (x >> 31)) >> 11) * 0x1p-53;
}

static hap_status path_set(const hap_link_path_def *given, local_path *io, hap_detail *detail)
{
  hap_link_path_def def;
  HAPI_TRY(hapi_def_read_optional(&path_type, given, &def, detail));
  const hapi_number_rule rules[] = {
      HAPI_RULE(&def, delay, 0.0, 10.0),
      HAPI_RULE(&def, jitter, 0.0, 10.0),
      HAPI_RULE(&def, loss, 0.0, 1.0),
      HAPI_RULE(&def, duplicate, 0.0, 1.0),
  };
  HAPI_TRY(hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail));
  io->def = def;
  io->random = def.seed;
  return HAP_OK;
}

/* ---- queues ---- */

static void queue_clear(local_queue *queue)
{
  while (queue->first != NULL) {
    local_message *message = queue->first;
    queue->first = message->next;
    hapi_free(message);
  }
  queue->count = 0;
}

/* False: no memory or no room. */
static bool queue_put(local_queue *queue, int64_t due_ns, const hap_link_event *event)
{
  local_message *message = NULL;
  if (queue->count == QUEUE_MOST ||
      (message = hapi_alloc(sizeof *message + event->bytes)) == NULL) {
    return false;
  }
  message->due_ns = due_ns;
  message->event = *event;
  if (event->bytes > 0) {
    message->event.data = memcpy(message + 1, event->data, event->bytes);
  }
  local_message **at = &queue->first;
  while (*at != NULL && (*at)->due_ns <= due_ns) {
    at = &(*at)->next;
  }
  message->next = *at;
  *at = message;
  ++queue->count;
  return true;
}

static int64_t path_arrival(const local_path *path, int64_t now_ns, double share)
{
  return now_ns + (int64_t)llround(1e9 * (path->def.delay + share * path->def.jitter));
}

static bool path_send_reliably(local_path *path, int64_t now_ns, local_queue *to,
                               const hap_link_event *event)
{
  int64_t due_ns = path_arrival(path, now_ns, path_draw(path));
  due_ns = due_ns > path->reliable_due_ns ? due_ns : path->reliable_due_ns;
  if (!queue_put(to, due_ns, event)) {
    return false;
  }
  path->reliable_due_ns = due_ns;
  return true;
}

/* As many numbers are drawn for each message, so that one setting does not change what another one
 * comes to. */
static void path_send_newest(local_path *path, int64_t now_ns, local_queue *to,
                             const hap_link_event *event)
{
  bool lost = path_draw(path) < path->def.loss;
  double share = path_draw(path);
  bool twice = path_draw(path) < path->def.duplicate;
  double again = path_draw(path);
  if (!lost) {
    (void)queue_put(to, path_arrival(path, now_ns, share), event);
  }
  if (!lost && twice) {
    (void)queue_put(to, path_arrival(path, now_ns, again), event);
  }
}

/* ---- the operations ---- */

static local_end *hub_find(const local_hub *hub, uint32_t number)
{
  local_end *client = hub->clients;
  while (client != NULL && client->number != number) {
    client = client->next;
  }
  return client;
}

static bool end_is_server(const local_end *end)
{
  return end->number == HAP_LINK_SERVER;
}

/* The client of a message from here; NULL: the peer is not there. */
static local_end *client_of(local_end *end, uint32_t peer)
{
  if (!end_is_server(end)) {
    return peer == HAP_LINK_SERVER && end->joined && end->hub->server != NULL ? end : NULL;
  }
  local_end *client = hub_find(end->hub, peer);
  return client != NULL && client->heard ? client : NULL;
}

static hap_status local_send(void *self, int64_t now_ns, const hap_link_parcel *parcel,
                             hap_detail *detail)
{
  local_end *end = self;
  local_end *client = client_of(end, parcel->to.peer);
  end->now_ns = now_ns;
  if (client == NULL) {
    return hapi_fail(detail, HAP_ERROR_NOT_FOUND, "peer %u has not joined, or has left",
                     parcel->to.peer);
  }
  bool down = end_is_server(end);
  local_path *path = down ? &client->down : &client->up;
  local_queue *to = down ? &client->in : &end->hub->server->in;
  const hap_link_event event = {.size = sizeof event,
                                .kind = HAP_LINK_MESSAGE,
                                .peer = end->number,
                                .channel = parcel->to.channel,
                                .part = parcel->to.part,
                                .reliable = parcel->reliable,
                                .bytes = parcel->bytes,
                                .data = parcel->data};
  if (parcel->reliable == 0) {
    path_send_newest(path, now_ns, to, &event);
    return HAP_OK;
  }
  return path_send_reliably(path, now_ns, to, &event)
             ? HAP_OK
             : hapi_fail(detail, HAP_ERROR_CAPACITY,
                         "%u messages are on their way, or there is no memory for one more: send "
                         "it again later",
                         to->count);
}

/* The client's first call: the server hears of it after the delay. */
static void client_ask(local_end *client, int64_t now_ns)
{
  const hap_link_event event = {.size = sizeof event,
                                .kind = HAP_LINK_JOINED,
                                .peer = client->number,
                                .bytes = sizeof client->name,
                                .data = client->name};
  client->asked = client->hub->server != NULL &&
                  path_send_reliably(&client->up, now_ns, &client->hub->server->in, &event);
}

/* The server has heard of it, and answers. */
static void server_welcome(local_end *server, int64_t now_ns, uint32_t number)
{
  local_end *client = hub_find(server->hub, number);
  const hap_link_event event = {
      .size = sizeof event, .kind = HAP_LINK_JOINED, .peer = HAP_LINK_SERVER};
  if (client != NULL) {
    client->heard = path_send_reliably(&client->down, now_ns, &client->in, &event);
  }
}

/* What is left of a client that has gone. */
static void queue_drop(local_queue *queue, uint32_t peer)
{
  for (local_message **at = &queue->first; *at != NULL;) {
    local_message *message = *at;
    if (message->event.peer != peer) {
      at = &message->next;
      continue;
    }
    *at = message->next;
    --queue->count;
    hapi_free(message);
  }
}

static void event_follow(local_end *end, int64_t now_ns, hap_link_event *io)
{
  if (io->kind == HAP_LINK_JOINED) {
    if (end_is_server(end)) {
      server_welcome(end, now_ns, io->peer);
    } else {
      end->joined = true;
    }
    io->bytes = 0; /* the name is a text */
  } else if (io->kind == HAP_LINK_LEFT) {
    end->joined = false;
    queue_drop(&end->in, io->peer);
  }
}

static hap_status local_poll(void *self, int64_t now_ns, hap_link_event *out, hap_detail *detail)
{
  local_end *end = self;
  (void)detail;
  end->now_ns = now_ns;
  hapi_free(end->out);
  end->out = NULL;
  if (!end_is_server(end) && !end->asked) {
    client_ask(end, now_ns);
  }
  local_message *message = end->in.first;
  if (message == NULL || message->due_ns > now_ns) {
    return HAP_END;
  }
  end->in.first = message->next;
  --end->in.count;
  end->out = message;
  *out = message->event;
  out->arrived_ns = message->due_ns;
  event_follow(end, now_ns, out);
  return HAP_OK;
}

static void hub_leave(local_hub *hub)
{
  if (hub->server == NULL && hub->clients == NULL) {
    hapi_free(hub);
  }
}

static void client_close(local_end *client)
{
  local_hub *hub = client->hub;
  local_end **at = &hub->clients;
  while (*at != client) {
    HAPI_ASSERT(*at != NULL);
    at = &(*at)->next;
  }
  *at = client->next;
  const hap_link_event event = {
      .size = sizeof event, .kind = HAP_LINK_LEFT, .peer = client->number};
  if (hub->server != NULL && client->heard) {
    (void)path_send_reliably(&client->up, client->now_ns, &hub->server->in, &event);
  } else if (hub->server != NULL) {
    queue_drop(&hub->server->in, client->number); /* nobody has heard of it */
  }
}

static void server_close(local_end *server)
{
  const hap_link_event event = {
      .size = sizeof event, .kind = HAP_LINK_LEFT, .peer = HAP_LINK_SERVER};
  server->hub->server = NULL;
  for (local_end *client = server->hub->clients; client != NULL; client = client->next) {
    if (client->heard) {
      (void)path_send_reliably(&client->down, server->now_ns, &client->in, &event);
    }
  }
}

static void local_close(void *self)
{
  local_end *end = self;
  local_hub *hub = end->hub;
  if (end_is_server(end)) {
    server_close(end);
  } else {
    client_close(end);
  }
  queue_clear(&end->in);
  hapi_free(end->out);
  hapi_free(end);
  hub_leave(hub);
}

static const hap_link_ops local_ops = {.abi = HAP_LINK_ABI,
                                       .size = sizeof local_ops,
                                       .name = "local",
                                       .send = local_send,
                                       .poll = local_poll,
                                       .close = local_close};

/* ---- the ends ---- */

hap_status hap_link_local_serve(hap_link **out, hap_detail *detail)
{
  local_hub *hub = hapi_alloc(sizeof *hub);
  local_end *server = hapi_alloc(sizeof *server);
  if (out == NULL || hub == NULL || server == NULL) {
    hapi_free(hub);
    hapi_free(server);
    return out == NULL ? hapi_fail(detail, HAP_ERROR_ARGUMENT, "hap_link_local_serve: out is NULL")
                       : hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a link");
  }
  server->hub = hub;
  hub->server = server;
  return hap_link_create(&local_ops, server, out, detail);
}

/* The hub of a server's end; NULL: it is none of this kind. */
static local_hub *hub_of(const hap_link *server)
{
  local_end *end = hapi_link_self(server, &local_ops);
  return end != NULL && end_is_server(end) ? end->hub : NULL;
}

static hap_status name_check(const local_hub *hub, const char *name, hap_detail *detail)
{
  if (name == NULL || strlen(name) > HAP_LINK_NAME_MOST) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "the name of a client is NULL or above %u bytes",
                     HAP_LINK_NAME_MOST);
  }
  for (const local_end *client = hub->clients; client != NULL; client = client->next) {
    if (strcmp(client->name, name) == 0) {
      return hapi_fail(detail, HAP_ERROR_STATE, "a client \"%s\" is there already", name);
    }
  }
  return HAP_OK;
}

hap_status hap_link_local_connect(hap_link *server, const char *name, const hap_link_path_def *up,
                                  const hap_link_path_def *down, hap_link **out, hap_detail *detail)
{
  local_hub *hub = hub_of(server);
  if (out == NULL || hub == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "hap_link_local_connect: out is NULL, or server is no end of "
                     "hap_link_local_serve");
  }
  *out = NULL;
  local_path paths[2] = {{.reliable_due_ns = INT64_MIN}, {.reliable_due_ns = INT64_MIN}};
  HAPI_TRY(name_check(hub, name, detail));
  HAPI_TRY(path_set(up, &paths[0], detail));
  HAPI_TRY(path_set(down, &paths[1], detail));
  local_end *client = hapi_alloc(sizeof *client);
  if (client == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a link");
  }
  memcpy(client->name, name, strlen(name));
  client->hub = hub;
  client->number = ++hub->number;
  client->up = paths[0];
  client->down = paths[1];
  client->next = hub->clients;
  hub->clients = client;
  return hap_link_create(&local_ops, client, out, detail);
}

hap_status hap_link_local_set_paths(hap_link *client, const hap_link_path_def *up,
                                    const hap_link_path_def *down)
{
  local_end *end = hapi_link_self(client, &local_ops);
  hap_detail detail;
  if (end == NULL || end_is_server(end)) {
    return HAP_ERROR_ARGUMENT;
  }
  local_path paths[2] = {end->up, end->down};
  if (up != NULL) {
    HAPI_TRY(path_set(up, &paths[0], &detail));
  }
  if (down != NULL) {
    HAPI_TRY(path_set(down, &paths[1], &detail));
  }
  end->up = paths[0];
  end->down = paths[1];
  return HAP_OK;
}
