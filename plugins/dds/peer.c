/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "peer.h"

#include <stdlib.h>
#include <string.h>

static link_newest *newest_new(link_peer *peer)
{
  link_newest *message = peer->free;
  if (peer->waiting >= LINK_NEWEST_MOST) {
    return NULL;
  }
  if (message == NULL) {
    return calloc(1, sizeof *message);
  }
  peer->free = message->next;
  return message;
}

bool link_peer_put(link_peer *peer, const link_newest *message)
{
  link_newest **at = &peer->first;
  link_newest *to = NULL;
  while (*at != NULL) { /* there are a few dozen at most, in honest links */
    if ((*at)->channel == message->channel && (*at)->part == message->part) {
      to = *at;
      *at = to->next; /* it comes now */
    } else {
      at = &(*at)->next;
    }
  }
  if (to == NULL) {
    to = newest_new(peer);
    peer->waiting += to != NULL;
  }
  if (to == NULL) {
    return false;
  }
  *to = *message;
  to->next = NULL;
  *at = to;
  return true;
}

link_newest *link_peer_take(link_peer *peer)
{
  link_newest *message = peer->first;
  if (message != NULL) {
    peer->first = message->next;
    --peer->waiting;
  }
  return message;
}

void link_peer_give_back(link_peer *peer, link_newest *message)
{
  message->next = peer->free;
  peer->free = message;
}

static void newest_free(link_newest *list)
{
  while (list != NULL) {
    link_newest *next = list->next;
    free(list);
    list = next;
  }
}

void link_peer_clear(link_peer *peer)
{
  newest_free(peer->first);
  newest_free(peer->free);
  memset(peer, 0, sizeof *peer);
}
