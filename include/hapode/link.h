/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LINK_H
#define HAPODE_LINK_H

/* Links: messages between the process that has the world (server) and processes that have hands
 * (clients). A link is one end: that of the server to all its clients, or that of a client to its
 * server. A message is bytes; a link does not look into it.
 *
 *   newest     may be lost, doubled or overtaken. Of a channel and part only the newest counts: an
 *              older one that comes late may be given or thrown away.
 *   reliable   comes once, in the order of sending, unless the peer leaves.
 *
 * A newest message is one datagram, HAP_LINK_NEWEST_MOST bytes at most. The sender splits what is
 * larger into parts that can be used one by one: a lost datagram costs its own part only.
 *
 * Calls never block. A link belongs to one thread at a time, and never to the haptic thread. now_ns
 * is the time of hap_session_now: in drive LOCKSTEP the virtual clock. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

#define HAP_LINK_NEWEST_MOST 1200u    /* bytes of a newest message */
#define HAP_LINK_RELIABLE_MOST 60000u /* bytes of a reliable message */
#define HAP_LINK_CHANNELS 16u         /* channels are numbered from 0 */
#define HAP_LINK_PARTS 256u           /* parts of a channel, numbered from 0 */
#define HAP_LINK_NAME_MOST 63u        /* bytes of a client's name */

/* The peer of a client. Clients have other numbers, by the server's link; none comes twice. */
#define HAP_LINK_SERVER 0u

/* One end of a link. */
typedef struct hap_link hap_link;

/* What hap_link_poll has found. Values are never renumbered. */
typedef enum hap_link_event_kind {
  HAP_LINK_MESSAGE = 0, /* a message of a peer that has joined */
  HAP_LINK_JOINED = 1,  /* the peer can be sent to; before its first message */
  HAP_LINK_LEFT = 2     /* the peer has closed, or nothing is heard of it; its last event */
} hap_link_event_kind;

/* Something that came in. It has a size and may grow at its end. */
typedef struct hap_link_event {
  uint32_t size;     /* bytes filled in */
  uint32_t kind;     /* hap_link_event_kind */
  uint32_t peer;     /* HAP_LINK_SERVER, or the number of a client */
  uint32_t channel;  /* of a message: below HAP_LINK_CHANNELS */
  uint32_t part;     /* of a newest message: below HAP_LINK_PARTS; of a reliable one 0 */
  uint32_t reliable; /* 1: the message was sent reliably */
  uint32_t bytes;    /* at data */
  uint32_t reserved;
  /* The message, until the next call with this link. JOINED at a server: the client's name, with
   * its final zero. Else NULL. */
  const void *data;
  int64_t arrived_ns; /* when it was there to be polled, as far as the transport knows */
} hap_link_event;

/* Counts of payload since the link was made, without what the transport adds. It has a size and may
 * grow at its end. */
typedef struct hap_link_figures {
  uint32_t size;           /* bytes filled in */
  uint32_t peers;          /* that are there now */
  uint64_t sent;           /* messages that the transport has taken */
  uint64_t sent_bytes;     /* of them */
  uint64_t received;       /* messages that poll has given */
  uint64_t received_bytes; /* of them */
  uint64_t refused;        /* messages that came with a channel, part or length out of range */
} hap_link_figures;

/* Where a message goes. Final. */
typedef struct hap_link_address {
  uint32_t peer;    /* HAP_LINK_SERVER, or the number of a client that has joined */
  uint32_t channel; /* below HAP_LINK_CHANNELS */
  uint32_t part;    /* below HAP_LINK_PARTS; of a reliable message 0 */
} hap_link_address;

/* [owner] Sends a newest message of 1..HAP_LINK_NEWEST_MOST bytes. It may replace one of the same
 * peer, channel and part that was not polled yet. A transport without room drops it, as a network
 * may. HAP_ERROR_ARGUMENT: address or length out of range. HAP_ERROR_NOT_FOUND: the peer is not
 * there. HAP_ERROR_IO: the transport has failed. hap_link_detail says which. */
HAP_NODISCARD HAP_API hap_status hap_link_send_newest(hap_link *link, int64_t now_ns,
                                                      const hap_link_address *to, const void *data,
                                                      uint32_t bytes);

/* [owner] Sends a message of 1..HAP_LINK_RELIABLE_MOST bytes reliably. HAP_ERROR_CAPACITY: the
 * transport has no room now, and the message can be sent again later. Other errors as above. */
HAP_NODISCARD HAP_API hap_status hap_link_send_reliably(hap_link *link, int64_t now_ns,
                                                        const hap_link_address *to,
                                                        const void *data, uint32_t bytes);

/* [owner] The next thing that has come in by now_ns. HAP_END: nothing more now, and *out is as it
 * was but for its size. HAP_ERROR_IO: the transport has failed, and hap_link_detail says how.
 * HAP_ERROR_ARGUMENT: a NULL, or no room for the size. size_of_out: sizeof *out of the caller's
 * build. */
HAP_NODISCARD HAP_API hap_status hap_link_poll(hap_link *link, int64_t now_ns, hap_link_event *out,
                                               size_t size_of_out);

/* [owner] Tells the peers that this end leaves, and frees it. NULL is allowed. */
HAP_API void hap_link_close(hap_link *link);

/* [owner] What the last error of a call with this link was about; "" when there was none. */
HAP_API hap_status hap_link_detail(const hap_link *link, hap_detail *out);

/* [owner] Counts. HAP_ERROR_ARGUMENT: a NULL, or no room for the size. */
HAP_API hap_status hap_link_get_figures(const hap_link *link, hap_link_figures *out,
                                        size_t size_of_out);

/* ---- a link inside the process ---- */

/* What happens to messages on their way in one direction. Each direction has its own generator,
 * which is seeded: the same calls at the same times have the same outcome on every machine.
 * Reliable messages have delay and jitter, but are neither lost nor doubled, and keep their order.
 * It has a size and may grow at its end. */
typedef struct hap_link_path_def {
  uint32_t size;    /* set by hap_link_path_def_init */
  uint32_t cookie;  /* set by hap_link_path_def_init */
  double delay;     /* s, 0..10, default 0: least time on the way */
  double jitter;    /* s, 0..10, default 0: up to that much more, uniformly; so messages overtake */
  double loss;      /* 0..1, default 0: share of the newest messages that are lost */
  double duplicate; /* 0..1, default 0: share of them that come twice, each with its own jitter */
  uint64_t seed;    /* default 1 */
} hap_link_path_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_link_path_def_init(hap_link_path_def *def, size_t size_of_def);

/* [any] The server's end of a link inside the process. */
HAP_NODISCARD HAP_API hap_status hap_link_local_serve(hap_link **out, hap_detail *detail);

/* [server's owner] A client's end to a server of hap_link_local_serve. Both ends belong to one
 * thread, and both are polled with the same clock. The client joins with its first poll: then the
 * server hears of it, and answers. name: of the client, at most HAP_LINK_NAME_MOST bytes. up, down:
 * to the server and from it, NULL for the defaults. Either end may be closed first.
 * HAP_ERROR_ARGUMENT: server is of another kind, or a number is out of range. HAP_ERROR_STATE:
 * another client of the server has the name. */
HAP_NODISCARD HAP_API hap_status hap_link_local_connect(hap_link *server, const char *name,
                                                        const hap_link_path_def *up,
                                                        const hap_link_path_def *down,
                                                        hap_link **out, hap_detail *detail);

/* [server's owner] Other paths of a client's end from now on; NULL: as it is. What is on its way
 * stays so. Errors as of hap_link_local_connect. */
HAP_NODISCARD HAP_API hap_status hap_link_local_set_paths(hap_link *client,
                                                          const hap_link_path_def *up,
                                                          const hap_link_path_def *down);

/* ---- for people who write a link ---- */

/* Goes up when a member of hap_link_ops changes its meaning. */
#define HAP_LINK_ABI 1u

/* What a transport is to send. Final. */
typedef struct hap_link_parcel {
  hap_link_address to; /* checked */
  uint32_t reliable;   /* 0: a newest message */
  uint32_t bytes;      /* at data */
  const void *data;    /* the message */
} hap_link_parcel;

/* The operations of a transport, all of them needed. The library has checked addresses, lengths and
 * NULL before each call, and counts what passes. detail is never NULL: on an error one sentence
 * that says what is wrong and what to do. It has a size and may grow at its end. */
typedef struct hap_link_ops {
  uint32_t abi;     /* HAP_LINK_ABI */
  uint32_t size;    /* sizeof(hap_link_ops) of the transport's build */
  const char *name; /* for texts: "local", "dds" */

  /* As hap_link_send_newest and hap_link_send_reliably. Nothing of the parcel is kept. */
  hap_status (*send)(void *self, int64_t now_ns, const hap_link_parcel *parcel, hap_detail *detail);

  /* As hap_link_poll; out arrives zeroed but for its size. arrived_ns 0 stands for now_ns. */
  hap_status (*poll)(void *self, int64_t now_ns, hap_link_event *out, hap_detail *detail);

  /* Peers are told; frees self. */
  void (*close)(void *self);
} hap_link_ops;

/* [any] Makes a link of these operations. ops stays until the link is closed. self is the
 * transport's; it is closed by hap_link_close, and by this call where it fails.
 * HAP_ERROR_ARGUMENT: a NULL, or a member is missing. HAP_ERROR_UNSUPPORTED: another ABI. */
HAP_NODISCARD HAP_API hap_status hap_link_create(const hap_link_ops *ops, void *self,
                                                 hap_link **out, hap_detail *detail);

HAP_END_DECLS

#endif
