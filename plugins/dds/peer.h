/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_DDS_PEER_H
#define HAPODE_PLUGINS_DDS_PEER_H

/* Who is at the other end, and the newest messages of it that nobody has polled yet: of each
 * channel and part one. */

#include <stdbool.h>
#include <stdint.h>

#include <dds/dds.h>

#include <hapode/link.h>

#define LINK_PEERS_MOST 64u   /* of a server */
#define LINK_NEWEST_MOST 512u /* channels and parts of a peer that are kept at once */

typedef struct link_newest {
  struct link_newest *next; /* by arrival, of those that wait; or of the free ones */
  uint8_t channel;
  uint8_t part;
  uint32_t bytes;
  int64_t arrived_ns;
  unsigned char data[HAP_LINK_NEWEST_MOST];
} link_newest;

typedef struct link_peer {
  uint64_t id;      /* the client's number by lot */
  uint32_t number;  /* for the link's owner; 0: nobody is here */
  bool welcome;     /* a server: its answer is on its way */
  int64_t since_ns; /* of that */
  bool joined;
  dds_instance_handle_t writer; /* of its reliable messages */
  dds_instance_handle_t owner;  /* participant of that */
  dds_instance_handle_t newest_writer;
  char name[HAP_LINK_NAME_MOST + 1];
  link_newest *first; /* that wait */
  uint32_t waiting;
  link_newest *free;
} link_peer;

/* Replaces one of the same channel and part. False: no room or no memory, and it is lost. */
bool link_peer_put(link_peer *peer, const link_newest *message);
/* The one that waits longest; NULL: none does. It goes back by link_peer_give_back. */
link_newest *link_peer_take(link_peer *peer);
void link_peer_give_back(link_peer *peer, link_newest *message);
void link_peer_clear(link_peer *peer); /* all of it: nobody is here */

#endif
