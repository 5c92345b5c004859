/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "sync/message_queue.h"

#include <stdalign.h>
#include <stdbool.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"

typedef struct node {
  struct node *next;
  uint64_t number;
  alignas(16) char message[];
} node;

struct hapi_message_queue {
  size_t size;
  node *first; /* oldest */
  node *last;
  node *held;
  node *spare; /* for the next ones */
  uint64_t expected;
  uint64_t forgotten; /* those before it, but for the one that is expected */
  bool starved;
  bool missing; /* one was asked for that is not there */
};

hap_status hapi_message_queue_create(size_t message_size, hapi_message_queue **out)
{
  HAPI_ASSERT(message_size > 0);
  *out = hapi_alloc(sizeof **out);
  if (*out == NULL) {
    return HAP_ERROR_MEMORY;
  }
  (*out)->size = message_size;
  (*out)->expected = UINT64_MAX;
  return HAP_OK;
}

static void free_list(node *at)
{
  while (at != NULL) {
    node *next = at->next;
    hapi_free(at);
    at = next;
  }
}

void hapi_message_queue_destroy(hapi_message_queue *queue)
{
  if (queue != NULL) {
    free_list(queue->first);
    free_list(queue->spare);
    hapi_free(queue->held);
    hapi_free(queue);
  }
}

static void give_back(hapi_message_queue *queue, node *n)
{
  if (n != NULL) {
    n->next = queue->spare;
    queue->spare = n;
  }
}

static bool number_is_wanted(const hapi_message_queue *queue, uint64_t number)
{
  return number >= queue->forgotten || number == queue->expected;
}

static void drop_unwanted(hapi_message_queue *queue)
{
  node **link = &queue->first;
  queue->last = NULL;
  while (*link != NULL) {
    node *n = *link;
    if (number_is_wanted(queue, n->number)) {
      queue->last = n;
      link = &n->next;
    } else {
      *link = n->next;
      give_back(queue, n);
    }
  }
}

static node *new_node(hapi_message_queue *queue)
{
  node *n = queue->spare;
  if (n != NULL) {
    queue->spare = n->next;
  } else {
    n = hapi_alloc(sizeof *n + queue->size);
    queue->starved = queue->starved || n == NULL;
  }
  return n;
}

void hapi_message_queue_put(hapi_message_queue *queue, uint64_t number, const void *message)
{
  HAPI_ASSERT(queue->last == NULL || number > queue->last->number);
  node *n = number_is_wanted(queue, number) ? new_node(queue) : NULL;
  if (n == NULL) {
    return;
  }
  n->next = NULL;
  n->number = number;
  memcpy(n->message, message, queue->size);
  if (queue->last != NULL) {
    queue->last->next = n;
  } else {
    queue->first = n;
  }
  queue->last = n;
}

void *hapi_message_queue_take(hapi_message_queue *queue)
{
  uint64_t number = queue->expected;
  if (number == UINT64_MAX) {
    number = queue->last != NULL ? queue->last->number : 0;
  }
  if (number == 0 || number == hapi_message_queue_held(queue)) {
    return NULL;
  }
  node **link = &queue->first;
  while (*link != NULL && (*link)->number < number) {
    link = &(*link)->next;
  }
  node *found = *link;
  if (found == NULL || found->number != number) {
    queue->missing = true;
    return NULL;
  }
  *link = found->next;
  give_back(queue, queue->held);
  queue->held = found;
  hapi_message_queue_forget(queue, number > queue->forgotten ? number : queue->forgotten);
  return found->message;
}

void hapi_message_queue_expect(hapi_message_queue *queue, uint64_t number)
{
  queue->expected = number;
}

void hapi_message_queue_forget(hapi_message_queue *queue, uint64_t before)
{
  queue->forgotten = before;
  drop_unwanted(queue);
}

uint64_t hapi_message_queue_held(const hapi_message_queue *queue)
{
  return queue->held != NULL ? queue->held->number : 0;
}

hap_status hapi_message_queue_status(const hapi_message_queue *queue)
{
  return queue->starved ? HAP_ERROR_MEMORY : queue->missing ? HAP_ERROR_NOT_FOUND : HAP_OK;
}
