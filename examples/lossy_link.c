/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdio.h>

#define MS 1000000LL

/* What the server has got. */
typedef struct got {
  unsigned newest, reliable, left;
} got;

/* All that has come by now. */
static void server_poll(hap_link *server, int64_t now_ns, got *io)
{
  hap_link_event event;
  while (hap_link_poll(server, now_ns, &event, sizeof event) == HAP_OK) {
    if (event.kind == HAP_LINK_JOINED) {
      printf("client %u is \"%s\"\n", (unsigned)event.peer, (const char *)event.data);
    }
    io->newest += event.kind == HAP_LINK_MESSAGE && event.reliable == 0;
    io->reliable += event.kind == HAP_LINK_MESSAGE && event.reliable == 1;
    io->left += event.kind == HAP_LINK_LEFT;
  }
}

/* A newest message, and with every hundredth a reliable one. */
static hap_status client_send(hap_link *client, int64_t now_ns, int number)
{
  const hap_link_address newest = {.peer = HAP_LINK_SERVER, .channel = 1};
  const hap_link_address reliable = {.peer = HAP_LINK_SERVER, .channel = 2};
  hap_status status = hap_link_send_newest(client, now_ns, &newest, &number, sizeof number);
  return status < HAP_OK || number % 100 != 0
             ? status
             : hap_link_send_reliably(client, now_ns, &reliable, &number, sizeof number);
}

int main(void)
{
  hap_link *server;
  hap_link *client;
  hap_link_event event;
  hap_link_figures figures;
  hap_detail why = {""};
  got all = {0, 0, 0};
  int number = 0, joined = 0;
  hap_link_path_def up, down; /* to the server, and back */
  hap_link_path_def_init(&up, sizeof up);
  up.delay = 0.05, up.jitter = 0.02;
  down = up;
  up.loss = 0.05;
  if (hap_link_local_serve(&server, &why) < HAP_OK ||
      hap_link_local_connect(server, "left hand", &up, &down, &client, &why) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  for (int64_t now_ns = 0; number < 1000; now_ns += MS) {
    server_poll(server, now_ns, &all);
    while (hap_link_poll(client, now_ns, &event, sizeof event) == HAP_OK) {
      joined = joined || event.kind == HAP_LINK_JOINED; /* after a round trip */
    }
    if (joined && client_send(client, now_ns, number++) < HAP_OK) {
      (void)hap_link_detail(client, &why);
      return fprintf(stderr, "%s\n", why.text), 1;
    }
    if (number == 500) { /* the network gets better */
      up.loss = 0.0;
      (void)hap_link_local_set_paths(client, &up, NULL);
    }
  }
  (void)hap_link_get_figures(client, &figures, sizeof figures);
  hap_link_close(client);
  server_poll(server, 10000 * MS, &all);
  hap_link_close(server);
  printf("%llu sent; came: %u newest, %u reliable; %u left\n", (unsigned long long)figures.sent,
         all.newest, all.reliable, all.left);
  return 0;
}
