/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* tun_way NAMESPACE_A NAMESPACE_B DELAY_MS JITTER_MS LOSS: a way of packets between two network
 * namespaces, each of which gets a tun device "way0". A packet takes DELAY_MS and up to JITTER_MS
 * more, uniformly, so packets overtake; a share LOSS of them is lost. Says "ready", and ends with
 * its input. For kernels without netem; needs rights of root. */

#include <errno.h>
#include <fcntl.h>
#include <linux/if_tun.h>
#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#define PACKETS_MOST 4096
#define BYTES_MOST 2048

typedef struct packet {
  int to; /* 0, 1: index of the device; negative: a free place */
  size_t bytes;
  int64_t due_ns;
  unsigned char data[BYTES_MOST];
} packet;

static packet packets[PACKETS_MOST];
static uint64_t random_state = 88172645463325252u;

static double random_share(void) /* xorshift (Marsaglia 2003) */
{
  random_state ^= random_state << 13;
  random_state ^= random_state >> 7;
  random_state ^= random_state << 17;
  return (double)(random_state >> 11) * 0x1p-53;
}

static int64_t clock_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* In the namespace of that name, where this process then stays. */
static int device_open(const char *name)
{
  char path[200];
  struct ifreq request;
  memset(&request, 0, sizeof request);
  (void)snprintf(path, sizeof path, "/run/netns/%s", name);
  int space = open(path, O_RDONLY | O_CLOEXEC);
  if (space < 0 || setns(space, CLONE_NEWNET) != 0) {
    perror(path);
    exit(1);
  }
  close(space);
  int device = open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
  request.ifr_flags = IFF_TUN | IFF_NO_PI;
  (void)strncpy(request.ifr_name, "way0", IFNAMSIZ - 1);
  if (device < 0 || ioctl(device, TUNSETIFF, &request) != 0) {
    perror("/dev/net/tun");
    exit(1);
  }
  return device;
}

static packet *packet_place(void)
{
  for (int i = 0; i < PACKETS_MOST; ++i) {
    if (packets[i].to < 0) {
      return &packets[i];
    }
  }
  return NULL; /* as a queue that is full */
}

static void device_read(int device, int to, const double way[3])
{
  static unsigned char lost[BYTES_MOST];
  for (;;) {
    packet *place = packet_place();
    ssize_t bytes = read(device, place != NULL ? place->data : lost, BYTES_MOST);
    if (bytes <= 0) {
      return;
    }
    double share = random_share();
    if (place != NULL && random_share() >= way[2]) {
      place->to = to;
      place->bytes = (size_t)bytes;
      place->due_ns = clock_now() + (int64_t)(1e6 * (way[0] + share * way[1]));
    }
  }
}

/* The time of the next one; those that are due go. */
static int64_t packets_send(const int devices[2], int64_t now_ns)
{
  int64_t next_ns = now_ns + 1000000000;
  for (;;) {
    packet *first = NULL;
    for (int i = 0; i < PACKETS_MOST; ++i) {
      if (packets[i].to >= 0 && (first == NULL || packets[i].due_ns < first->due_ns)) {
        first = &packets[i];
      }
    }
    if (first == NULL || first->due_ns > now_ns) {
      return first != NULL ? first->due_ns : next_ns;
    }
    if (write(devices[first->to], first->data, first->bytes) < 0 && errno != EIO) {
      perror("way0"); /* EIO: it is not up */
    }
    first->to = -1;
  }
}

int main(int count, char **arguments)
{
  if (count != 6) {
    return 2;
  }
  const int devices[2] = {device_open(arguments[1]), device_open(arguments[2])};
  const double way[3] = {strtod(arguments[3], NULL), strtod(arguments[4], NULL),
                         strtod(arguments[5], NULL)};
  for (int i = 0; i < PACKETS_MOST; ++i) {
    packets[i].to = -1;
  }
  printf("ready\n");
  (void)fflush(stdout);
  struct pollfd waits[3] = {{.fd = devices[0], .events = POLLIN},
                            {.fd = devices[1], .events = POLLIN},
                            {.fd = STDIN_FILENO, .events = POLLIN}};
  while ((waits[2].revents & (POLLIN | POLLHUP)) == 0) {
    int64_t now_ns = clock_now();
    int64_t left_ns = packets_send(devices, now_ns) - now_ns;
    const struct timespec left = {(time_t)(left_ns / 1000000000), (long)(left_ns % 1000000000)};
    (void)ppoll(waits, 3, &left, NULL);
    device_read(devices[0], 1, way);
    device_read(devices[1], 0, way);
  }
  return 0;
}
