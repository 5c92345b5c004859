/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A link over DDS. Each direction has two topics: newest messages, best effort, of which the last
 * one of a key counts, and reliable ones. DDS' own threads take newest messages as they come, with
 * the time; reliable ones are taken by whoever polls.
 *
 *   client  JOIN with its name, again and again until it is answered: DDS loses what is written
 *           before both ends have found each other
 *   server  WELCOME for each JOIN
 *   client  READY for the first WELCOME. It has joined. Both ways work by now, so that no message
 *           after this one is lost.
 *   server  on READY the client has joined
 *   either  LEAVE; else the writer of the reliable messages has gone, as DDS says
 *
 * A peer is known by its participant: what another one writes in its name is thrown away. */

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>

#include "domain.h"
#include "hapode_link.h"
#include "peer.h"

#define AGAIN_NS INT64_C(50000000) /* until JOIN is written once more */
#define STRANGER_NS INT64_C(1000000000)
#define LOOK_NS INT64_C(100000000)     /* until peers are looked for once more */
#define WELCOME_NS INT64_C(2000000000) /* of a client that is welcome and does not come */
#define PLACES_MOST 8u                 /* of a participant, who may have several clients */
#define TAKE_MOST 32
#define RELIABLE_KEPT 1024 /* messages that DDS keeps for who has not got them yet */

typedef enum link_packet_kind {
  PACKET_MESSAGE = 0,
  PACKET_JOIN = 1,
  PACKET_WELCOME = 2,
  PACKET_READY = 3,
  PACKET_LEAVE = 4
} link_packet_kind;

typedef struct link_end {
  bool serves;
  uint32_t domain;
  uint64_t id; /* of a client */
  char name[HAP_LINK_NAME_MOST + 1];
  dds_entity_t participant;
  dds_entity_t newest_out; /* writers */
  dds_entity_t reliable_out;
  dds_entity_t newest_in; /* readers */
  dds_entity_t reliable_in;
  int64_t again_ns; /* a client: when JOIN is due */
  int64_t look_ns;  /* when peers are looked for */

  pthread_mutex_t lock;             /* over the peers: DDS' threads put newest messages there */
  link_peer peers[LINK_PEERS_MOST]; /* a client has one: the server */
  uint32_t number;                  /* of the newest client */
  uint32_t turn;                    /* peer to look at first */

  uint64_t stranger; /* whom nobody knows, or not any more; 0: none */
  int64_t stranger_ns;
  bool gone; /* a client: the server has left */

  /* Of the last poll. */
  link_peer *given_by;
  link_newest *given;
  unsigned char reliable[HAP_LINK_RELIABLE_MOST];
  char given_name[HAP_LINK_NAME_MOST + 1];
} link_end;

static int64_t clock_ns(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* ---- peers ---- */

static link_peer *peer_by_id(link_end *end, uint64_t id)
{
  for (uint32_t i = 0; i < LINK_PEERS_MOST; ++i) {
    if (end->peers[i].id == id && (end->peers[i].number != 0 || end->peers[i].welcome)) {
      return &end->peers[i];
    }
  }
  return NULL;
}

/* Of the link's owner; of a client the server's is 0, and stands for the first place. */
static link_peer *peer_by_number(link_end *end, uint32_t number)
{
  for (uint32_t i = 0; i < LINK_PEERS_MOST; ++i) {
    link_peer *peer = &end->peers[i];
    if (peer->joined && (end->serves ? peer->number == number : number == HAP_LINK_SERVER)) {
      return peer;
    }
  }
  return NULL;
}

/* A free place, or that of somebody who has not come; NULL: there is none for this participant. */
static link_peer *peer_place(link_end *end, dds_instance_handle_t owner, int64_t now_ns)
{
  link_peer *place = NULL;
  uint32_t places = 0;
  for (uint32_t i = 0; i < LINK_PEERS_MOST; ++i) {
    link_peer *peer = &end->peers[i];
    bool waits = peer->welcome && !peer->joined;
    bool late = waits && now_ns > peer->since_ns + WELCOME_NS;
    place = late || (peer->number == 0 && !peer->welcome) ? peer : place;
    places += (peer->joined || (waits && !late)) && peer->owner == owner;
  }
  return places < PLACES_MOST ? place : NULL;
}

/* The participant of a writer; 0: it is not there any more. */
static dds_instance_handle_t owner_of(dds_entity_t reader, dds_instance_handle_t writer)
{
  dds_builtintopic_endpoint_t *about = dds_get_matched_publication_data(reader, writer);
  dds_instance_handle_t owner = about != NULL ? about->participant_instance_handle : 0;
  if (about != NULL) {
    dds_builtintopic_free_endpoint(about);
  }
  return owner;
}

/* ---- newest messages, in threads of DDS ---- */

static void newest_keep(link_end *end, const hapode_link_newest *sample,
                        dds_instance_handle_t writer, int64_t now_ns)
{
  link_peer *peer = peer_by_id(end, sample->client);
  if (peer == NULL || !peer->joined) {
    end->stranger = end->serves && peer == NULL ? sample->client : end->stranger;
    return;
  }
  if (peer->newest_writer != writer) {
    if (owner_of(end->newest_in, writer) != peer->owner) {
      return;
    }
    peer->newest_writer = writer;
  }
  link_newest message = {.channel = sample->channel,
                         .part = sample->part,
                         .bytes = sample->data._length,
                         .arrived_ns = now_ns};
  if (message.bytes <= HAP_LINK_NEWEST_MOST) { /* else DDS has not kept to its bound */
    if (message.bytes > 0) {
      memcpy(message.data, sample->data._buffer, message.bytes);
    }
    (void)link_peer_put(peer, &message);
  }
}

static void newest_come(dds_entity_t reader, void *of)
{
  link_end *end = of;
  int64_t now_ns = clock_ns();
  dds_return_t count;
  do {
    void *samples[TAKE_MOST] = {NULL};
    dds_sample_info_t infos[TAKE_MOST];
    count = dds_take(reader, samples, infos, TAKE_MOST, TAKE_MOST);
    pthread_mutex_lock(&end->lock);
    for (dds_return_t i = 0; i < count; ++i) {
      if (infos[i].valid_data) {
        newest_keep(end, samples[i], infos[i].publication_handle, now_ns);
      }
    }
    pthread_mutex_unlock(&end->lock);
    if (count > 0) {
      (void)dds_return_loan(reader, samples, count);
    }
  } while (count == TAKE_MOST);
}

/* ---- out ---- */

typedef struct packet {
  uint64_t client;
  link_packet_kind kind;
  uint32_t channel;
  const void *data;
  uint32_t bytes;
} packet;

static dds_return_t packet_write(link_end *end, const packet *p)
{
  hapode_link_reliable sample = {
      .client = p->client,
      .kind = (uint8_t)p->kind,
      .channel = (uint8_t)p->channel,
      .data = {._maximum = p->bytes,
               ._length = p->bytes,
               ._buffer = (uint8_t *)(uintptr_t)p->data}}; /* DDS copies, and does not write it */
  return dds_write(end->reliable_out, &sample);
}

static hap_status send_result(dds_return_t result, const hap_link_parcel *parcel,
                              hap_detail *detail)
{
  if (result == DDS_RETCODE_TIMEOUT || result == DDS_RETCODE_OUT_OF_RESOURCES) {
    return parcel->reliable == 0
               ? HAP_OK /* lost, as on any network */
               : link_fail(detail, HAP_ERROR_CAPACITY,
                           "the peer has not taken what was sent before: send it again later");
  }
  return result >= 0 ? HAP_OK : link_fail(detail, HAP_ERROR_IO, "DDS: %s", dds_strretcode(result));
}

static hap_status link_send(void *self, int64_t now_ns, const hap_link_parcel *parcel,
                            hap_detail *detail)
{
  link_end *end = self;
  link_peer *peer = peer_by_number(end, parcel->to.peer);
  (void)now_ns;
  if (peer == NULL) {
    return link_fail(detail, HAP_ERROR_NOT_FOUND, "peer %u has not joined, or has left",
                     parcel->to.peer);
  }
  uint64_t client = end->serves ? peer->id : end->id;
  if (parcel->reliable != 0) {
    const packet p = {client, PACKET_MESSAGE, parcel->to.channel, parcel->data, parcel->bytes};
    return send_result(packet_write(end, &p), parcel, detail);
  }
  hapode_link_newest sample = {.client = client,
                               .channel = (uint8_t)parcel->to.channel,
                               .part = (uint8_t)parcel->to.part,
                               .data = {._maximum = parcel->bytes,
                                        ._length = parcel->bytes,
                                        ._buffer = (uint8_t *)(uintptr_t)parcel->data}};
  return send_result(dds_write(end->newest_out, &sample), parcel, detail);
}

/* ---- in ---- */

static void peer_drop(link_end *end, link_peer *peer)
{
  pthread_mutex_lock(&end->lock);
  if (end->given_by == peer && end->given != NULL) {
    free(end->given);
    end->given = NULL;
  }
  link_peer_clear(peer);
  pthread_mutex_unlock(&end->lock);
}

/* Somebody wants to join. Each JOIN is answered: earlier answers may have found nobody. */
static void server_welcome(link_end *end, const hapode_link_reliable *in,
                           dds_instance_handle_t writer)
{
  dds_instance_handle_t owner = owner_of(end->reliable_in, writer);
  link_peer *peer = peer_by_id(end, in->client);
  if (owner == 0 || (peer != NULL && (peer->joined || peer->owner != owner))) {
    return;
  }
  pthread_mutex_lock(&end->lock);
  if (peer == NULL && (peer = peer_place(end, owner, clock_ns())) != NULL) {
    link_peer_clear(peer);
    peer->id = in->client;
    peer->since_ns = clock_ns();
  }
  if (peer != NULL) {
    size_t length = in->data._length < HAP_LINK_NAME_MOST ? in->data._length : HAP_LINK_NAME_MOST;
    peer->welcome = true;
    peer->writer = writer;
    peer->owner = owner;
    for (size_t i = 0; i < length; ++i) { /* a stranger's text: no letter but printable ones */
      unsigned char letter = in->data._buffer[i];
      peer->name[i] = (char)(letter >= 0x20 && letter < 0x7f ? letter : '?');
    }
    peer->name[length] = '\0';
  }
  pthread_mutex_unlock(&end->lock);
  if (peer != NULL) {
    const packet answer = {.client = in->client, .kind = PACKET_WELCOME};
    (void)packet_write(end, &answer);
  }
}

static bool server_joined(link_end *end, link_peer *peer, hap_link_event *out)
{
  if (peer->joined) {
    return false;
  }
  pthread_mutex_lock(&end->lock);
  peer->joined = true;
  peer->number = ++end->number;
  pthread_mutex_unlock(&end->lock);
  memcpy(end->given_name, peer->name, sizeof end->given_name);
  out->kind = HAP_LINK_JOINED;
  out->peer = peer->number;
  out->data = end->given_name;
  return true;
}

/* The first server that answers. */
static bool client_joined(link_end *end, dds_instance_handle_t writer, hap_link_event *out)
{
  link_peer *server = &end->peers[0];
  dds_instance_handle_t owner = owner_of(end->reliable_in, writer);
  if (server->joined || end->gone || owner == 0) {
    return false;
  }
  pthread_mutex_lock(&end->lock);
  server->id = end->id;
  server->number = 1;
  server->joined = true;
  server->writer = writer;
  server->owner = owner;
  pthread_mutex_unlock(&end->lock);
  const packet ready = {.client = end->id, .kind = PACKET_READY};
  (void)packet_write(end, &ready);
  out->kind = HAP_LINK_JOINED;
  out->peer = HAP_LINK_SERVER;
  return true;
}

static bool peer_left(link_end *end, link_peer *peer, hap_link_event *out)
{
  bool told = peer->joined;
  out->kind = HAP_LINK_LEFT;
  out->peer = end->serves ? peer->number : HAP_LINK_SERVER;
  end->gone = !end->serves;
  peer_drop(end, peer);
  return told;
}

static bool message_take(link_end *end, const link_peer *peer, const hapode_link_reliable *in,
                         hap_link_event *out)
{
  uint32_t bytes = in->data._length;
  out->kind = HAP_LINK_MESSAGE;
  out->peer = end->serves ? peer->number : HAP_LINK_SERVER;
  out->channel = in->channel;
  out->reliable = 1;
  out->bytes = bytes; /* the library refuses and counts what is out of range */
  out->data = end->reliable;
  if (bytes > 0 && bytes <= sizeof end->reliable) {
    memcpy(end->reliable, in->data._buffer, bytes);
  }
  return true;
}

/* Whether it is an event. */
static bool reliable_hear(link_end *end, const hapode_link_reliable *in,
                          const dds_sample_info_t *info, hap_link_event *out)
{
  dds_instance_handle_t writer = info->publication_handle;
  if (!end->serves && in->client != end->id) {
    return false;
  }
  link_peer *peer = peer_by_id(end, in->client);
  if (info->valid_data && end->serves && in->kind == PACKET_JOIN) {
    server_welcome(end, in, writer);
    return false;
  }
  if (info->valid_data && !end->serves && in->kind == PACKET_WELCOME) {
    return client_joined(end, writer, out);
  }
  if (peer == NULL) {
    bool lost = info->valid_data && end->serves;
    end->stranger = lost && in->kind != PACKET_LEAVE ? in->client : end->stranger;
    return false;
  }
  if (!info->valid_data || writer != peer->writer) {
    return false; /* whoever writes by this key can end it: peers_look knows better */
  }
  switch (in->kind) {
    case PACKET_READY:
      return end->serves && server_joined(end, peer, out);
    case PACKET_LEAVE:
      return peer_left(end, peer, out);
    case PACKET_MESSAGE:
      return peer->joined && message_take(end, peer, in, out);
    default:
      return false;
  }
}

/* Whether somebody has gone without a word. */
static bool peers_look(link_end *end, int64_t now_ns, hap_link_event *out)
{
  if (now_ns < end->look_ns) {
    return false;
  }
  for (uint32_t i = 0; i < LINK_PEERS_MOST; ++i) {
    link_peer *peer = &end->peers[i];
    if (peer->joined && owner_of(end->reliable_in, peer->writer) != peer->owner) {
      return peer_left(end, peer, out); /* the rest with the next call */
    }
  }
  end->look_ns = now_ns + LOOK_NS;
  return false;
}

static bool reliable_take(link_end *end, hap_link_event *out)
{
  bool found = false;
  dds_return_t count;
  do {
    void *sample = NULL;
    dds_sample_info_t info;
    count = dds_take(end->reliable_in, &sample, &info, 1, 1);
    if (count > 0) {
      found = reliable_hear(end, sample, &info, out);
      (void)dds_return_loan(end->reliable_in, &sample, count);
    }
  } while (count > 0 && !found);
  return found;
}

static bool newest_take(link_end *end, hap_link_event *out)
{
  pthread_mutex_lock(&end->lock);
  if (end->given != NULL) {
    link_peer_give_back(end->given_by, end->given);
    end->given = NULL;
  }
  for (uint32_t i = 0; i < LINK_PEERS_MOST && end->given == NULL; ++i) { /* in turns */
    end->turn = (end->turn + 1) % LINK_PEERS_MOST;
    end->given_by = &end->peers[end->turn];
    end->given = end->given_by->joined ? link_peer_take(end->given_by) : NULL;
  }
  const link_newest *given = end->given;
  if (given != NULL) {
    out->kind = HAP_LINK_MESSAGE;
    out->peer = end->serves ? end->given_by->number : HAP_LINK_SERVER;
    out->channel = given->channel;
    out->part = given->part;
    out->bytes = given->bytes;
    out->data = given->data;
    out->arrived_ns = given->arrived_ns;
  }
  pthread_mutex_unlock(&end->lock);
  return given != NULL;
}

/* One that a server has lost, and that does not know, is told so, now and then. */
static void stranger_tell(link_end *end, int64_t now_ns)
{
  pthread_mutex_lock(&end->lock);
  uint64_t stranger = end->stranger;
  end->stranger = 0;
  pthread_mutex_unlock(&end->lock);
  if (stranger != 0 && now_ns >= end->stranger_ns) {
    const packet leave = {.client = stranger, .kind = PACKET_LEAVE};
    (void)packet_write(end, &leave);
    end->stranger_ns = now_ns + STRANGER_NS;
  }
}

static void client_ask(link_end *end, int64_t now_ns)
{
  if (!end->peers[0].joined && !end->gone && now_ns >= end->again_ns) {
    const packet join = {.client = end->id,
                         .kind = PACKET_JOIN,
                         .data = end->name,
                         .bytes = (uint32_t)strlen(end->name)};
    (void)packet_write(end, &join);
    end->again_ns = now_ns + AGAIN_NS;
  }
}

static hap_status link_poll(void *self, int64_t now_ns, hap_link_event *out, hap_detail *detail)
{
  link_end *end = self;
  (void)now_ns, (void)detail;
  if (end->serves) {
    stranger_tell(end, clock_ns());
  } else {
    client_ask(end, clock_ns());
  }
  return reliable_take(end, out) || newest_take(end, out) || peers_look(end, clock_ns(), out)
             ? HAP_OK
             : HAP_END;
}

/* ---- life ---- */

static void link_close(void *self)
{
  link_end *end = self;
  for (uint32_t i = 0; i < LINK_PEERS_MOST && end->reliable_out > 0; ++i) {
    if (end->peers[i].joined) {
      const packet leave = {.client = end->peers[i].id, .kind = PACKET_LEAVE};
      (void)packet_write(end, &leave);
    }
  }
  if (end->newest_in > 0) {
    (void)dds_set_listener(end->newest_in, NULL);
  }
  if (end->participant > 0) {
    (void)dds_wait_for_acks(end->reliable_out, DDS_MSECS(100));
    link_domain_leave(end->domain, end->participant);
  }
  for (uint32_t i = 0; i < LINK_PEERS_MOST; ++i) {
    link_peer_clear(&end->peers[i]);
  }
  free(end->given);
  pthread_mutex_destroy(&end->lock);
  free(end);
}

static void qos_set(dds_qos_t *qos, bool reliable)
{
  dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
  dds_qset_writer_data_lifecycle(qos, true);
  if (reliable) { /* none is blocked, none is lost: what has no room is refused */
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, 0);
    dds_qset_history(qos, DDS_HISTORY_KEEP_ALL, 0);
    dds_qset_resource_limits(qos, RELIABLE_KEPT, DDS_LENGTH_UNLIMITED, RELIABLE_KEPT);
  } else {
    dds_qset_reliability(qos, DDS_RELIABILITY_BEST_EFFORT, 0);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  }
}

/* One topic in each direction; the number is that of the format. */
static dds_entity_t topic_make(const link_end *end, bool reliable, bool up)
{
  static const char *const names[2][2] = {{"hapode_1_newest_down", "hapode_1_newest_up"},
                                          {"hapode_1_reliable_down", "hapode_1_reliable_up"}};
  return dds_create_topic(end->participant,
                          reliable ? &hapode_link_reliable_desc : &hapode_link_newest_desc,
                          names[reliable][up], NULL, NULL);
}

static bool pair_make(link_end *end, const dds_entity_t groups[2], bool reliable)
{
  dds_qos_t *qos = dds_create_qos();
  qos_set(qos, reliable);
  dds_entity_t out = topic_make(end, reliable, !end->serves);
  dds_entity_t in = topic_make(end, reliable, end->serves);
  dds_entity_t *writer = reliable ? &end->reliable_out : &end->newest_out;
  dds_entity_t *reader = reliable ? &end->reliable_in : &end->newest_in;
  dds_listener_t *listener = NULL;
  if (!reliable) {
    listener = dds_create_listener(end);
    dds_lset_data_available(listener, newest_come);
  }
  *writer = out > 0 ? dds_create_writer(groups[0], out, qos, NULL) : out;
  *reader = in > 0 ? dds_create_reader(groups[1], in, qos, listener) : in;
  dds_delete_qos(qos);
  if (listener != NULL) {
    dds_delete_listener(listener);
  }
  return *writer > 0 && *reader > 0;
}

/* Links of other worlds are in other partitions. */
static bool entities_make(link_end *end, const char *world)
{
  dds_qos_t *qos = dds_create_qos();
  dds_qset_partition1(qos, world);
  const dds_entity_t groups[2] = {dds_create_publisher(end->participant, qos, NULL),
                                  dds_create_subscriber(end->participant, qos, NULL)};
  dds_delete_qos(qos);
  return groups[0] > 0 && groups[1] > 0 && pair_make(end, groups, true) &&
         pair_make(end, groups, false);
}

static hap_status link_open(const hap_link_dds_def *def, uint32_t serves, void **out_self,
                            hap_detail *detail)
{
  link_end *end = calloc(1, sizeof *end);
  if (end == NULL) {
    return link_fail(detail, HAP_ERROR_MEMORY, "no memory for a link");
  }
  end->serves = serves != 0;
  end->domain = def->domain;
  (void)strncpy(end->name, def->name != NULL ? def->name : "", HAP_LINK_NAME_MOST);
  pthread_mutex_init(&end->lock, NULL);
  hap_status status = HAP_OK;
  if (getrandom(&end->id, sizeof end->id, 0) != (ssize_t)sizeof end->id || end->id == 0) {
    status = link_fail(detail, HAP_ERROR_IO, "the system gives no random number");
  }
  status = status >= HAP_OK ? link_domain_join(def, &end->participant, detail) : status;
  if (status >= HAP_OK && !entities_make(end, def->world)) {
    status =
        link_fail(detail, HAP_ERROR_IO, "DDS does not give topics for the world \"%s\"%s",
                  def->world, def->certificates != NULL ? ": do the permissions allow them?" : "");
  }
  if (status < HAP_OK) {
    link_close(end);
    return status;
  }
  *out_self = end;
  return HAP_OK;
}

static const hap_link_ops ops = {.abi = HAP_LINK_ABI,
                                 .size = sizeof ops,
                                 .name = "dds",
                                 .send = link_send,
                                 .poll = link_poll,
                                 .close = link_close};

static const hap_link_dds_module module = {.abi = HAP_LINK_DDS_ABI,
                                           .size = sizeof module,
                                           .ops = &ops,
                                           .open = link_open,
                                           .listen = link_domain_listen};

HAP_API const hap_link_dds_module *hapode_link_dds_module(void);
HAP_API const hap_link_dds_module *hapode_link_dds_module(void)
{
  return &module;
}
