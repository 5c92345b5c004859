/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* dds_end serve|connect WORLD FOLDER|insecure|- SECONDS: an end of a link over DDS on the loopback
 * interface, for tests that need two processes. It says on its output who joins and leaves, and
 * which messages come. FOLDER: certificates. Once joined it sends TEXT of the environment
 * every 20 ms, as newest and as reliable messages in turns. */

#include <hapode/link_dds.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static int64_t clock_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void event_say(const hap_link_event *event)
{
  if (event->kind == HAP_LINK_JOINED) {
    printf("joined\n");
  } else if (event->kind == HAP_LINK_LEFT) {
    printf("left\n");
  } else {
    printf("%s %.*s\n", event->reliable != 0 ? "reliable" : "newest", (int)event->bytes,
           (const char *)event->data);
  }
  (void)fflush(stdout);
}

int main(int count, char **arguments)
{
  hap_link *link = NULL;
  hap_detail why = {""};
  hap_link_dds_def def;
  if (count != 5) {
    return 2;
  }
  const char *text = getenv("TEXT");
  bool secure = strchr(arguments[3], '/') != NULL;
  bool open = strcmp(arguments[3], "insecure") == 0;
  hap_link_dds_def_init(&def, sizeof def);
  def.world = arguments[2];
  def.module = getenv("HAPODE_LINK_DDS");
  def.certificates = secure ? arguments[3] : NULL;
  def.insecure = open ? 1 : 0;
  def.interface_name = def.peers = secure || open ? "127.0.0.1" : NULL;
  hap_status status = strcmp(arguments[1], "serve") == 0 ? hap_link_dds_serve(&def, &link, &why)
                                                         : hap_link_dds_connect(&def, &link, &why);
  if (status < HAP_OK) {
    printf("failed %s\n", why.text);
    return 1;
  }
  const int64_t end_ns = clock_now() + (int64_t)(1e9 * strtod(arguments[4], NULL));
  int64_t next_ns = 0;
  hap_link_address to = {.channel = 1};
  bool joined = false;
  for (int round = 0; clock_now() < end_ns;) {
    hap_link_event event;
    while (hap_link_poll(link, clock_now(), &event, sizeof event) == HAP_OK) {
      joined = event.kind == HAP_LINK_JOINED || (joined && event.kind != HAP_LINK_LEFT);
      to.peer = event.kind == HAP_LINK_JOINED ? event.peer : to.peer;
      event_say(&event);
    }
    if (joined && text != NULL && clock_now() >= next_ns) {
      uint32_t size = (uint32_t)strlen(text);
      status = ++round % 2 == 0 ? hap_link_send_newest(link, clock_now(), &to, text, size)
                                : hap_link_send_reliably(link, clock_now(), &to, text, size);
      next_ns = clock_now() + 20000000;
    }
    usleep(1000);
  }
  hap_link_close(link);
  return status < HAP_OK;
}
