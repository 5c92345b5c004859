/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/serial.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/serial.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "base/assert.h"
#include "base/clock.h"
#include "base/log.h"

#define LOCK_TRIES 50 /* of 10 ms */
#define FORCE_TRIES 200
#define WRITER_LOOK_NS 20000
#define WRITER_PAUSES 16
#define WRITER_PAUSE_NS 100000

_Static_assert(ATOMIC_POINTER_LOCK_FREE == 2, "zeros are sent from signal handlers");

hap_status hapi_spidar_serial_init(hapi_spidar_serial *serial, hap_detail *detail)
{
  memset(serial, 0, sizeof *serial);
  serial->fd = open("/dev/null", O_RDWR | O_CLOEXEC);
  if (serial->fd < 0) {
    return hapi_fail(detail, HAP_ERROR_SYSTEM, "/dev/null: %s", strerror(errno));
  }
  return HAP_OK;
}

void hapi_spidar_serial_finish(hapi_spidar_serial *serial)
{
  if (serial->fd >= 0) {
    close(serial->fd);
    serial->fd = -1;
  }
}

/* ---- opening ---- */

static hap_status fail_open(const char *path, int error, hap_detail *detail)
{
  const char *help = "";
  if (error == EACCES || error == EPERM) {
    help =
        "; install 60-hapode-spidar.rules (docs/spidar.md), or join the group that owns the port";
  } else if (error == ENOENT || error == ENXIO || error == ENODEV || error == EIO) {
    help = "; is it plugged in? \"hapode-run --list\" lists the ports there are";
  }
  return hapi_fail(detail, HAP_ERROR_DEVICE, "%s: %s%s", path, strerror(error), help);
}

/* A guard process of one that has just died may hold it for a moment. */
static bool port_lock(int fd)
{
  for (int i = 0; i < LOCK_TRIES; ++i) {
    if (flock(fd, LOCK_EX | LOCK_NB) == 0) {
      return true;
    }
    hapi_clock_sleep_until(hapi_clock_now() + 10000000);
  }
  return false;
}

static bool make_raw(int fd)
{
  struct termios t;
  if (tcgetattr(fd, &t) != 0) {
    return false;
  }
  cfmakeraw(&t);
  t.c_cflag &= ~(tcflag_t)(CRTSCTS | CSTOPB | HUPCL);
  t.c_cflag |= CLOCAL | CREAD;
  t.c_cc[VMIN] = 1; /* so that a read of nothing is EAGAIN, and 0 a line that was hung up */
  t.c_cc[VTIME] = 0;
  (void)cfsetspeed(&t, B2000000); /* fails for speeds that it does not know */
  return tcsetattr(fd, TCSANOW, &t) == 0;
}

/* What an adapter or a pseudo-terminal does not know does no harm. */
static void port_settle(int fd)
{
  struct serial_struct about;
  int lines = 0;
  if (ioctl(fd, TIOCMGET, &lines) == 0) {
    lines &= ~(TIOCM_RTS | TIOCM_DTR);
    (void)ioctl(fd, TIOCMSET, &lines);
  }
  if (ioctl(fd, TIOCGSERIAL, &about) == 0) { /* latency 1 ms where the driver lets everybody */
    about.flags |= ASYNC_LOW_LATENCY;
    (void)ioctl(fd, TIOCSSERIAL, &about);
  }
  /* Not the output: it may be the zeros of whoever had the port before. */
  (void)tcflush(fd, TCIFLUSH);
}

static hap_status set_up(int fd, const char *path, hap_detail *detail)
{
  if (!isatty(fd)) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "%s is not a serial port", path);
  }
  if (!port_lock(fd)) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "%s is in use by another program or device", path);
  }
  if (!make_raw(fd)) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "%s does not do 2 Mbit/s: %s", path,
                     strerror(errno));
  }
  port_settle(fd);
  return HAP_OK;
}

hap_status hapi_spidar_serial_open(hapi_spidar_serial *serial, const char *path, hap_detail *detail)
{
  int fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) {
    return fail_open(path, errno, detail);
  }
  hap_status status = set_up(fd, path, detail);
  if (status >= HAP_OK && dup3(fd, serial->fd, O_CLOEXEC) < 0) {
    status = fail_open(path, errno, detail);
  }
  close(fd);
  if (status >= HAP_OK) {
    atomic_fetch_add(&serial->cuts, 1);    /* by who had it before, perhaps */
    if (strcmp(serial->path, path) != 0) { /* opened anew, it stays: others may be reading it */
      snprintf(serial->path, sizeof serial->path, "%s", path);
    }
    int latency = hapi_spidar_serial_latency(path);
    if (latency > 1) {
      hapi_log(HAP_LOG_WARNING,
               "spidar: %s: the latency timer of the USB adapter is %d ms, 1 ms is needed: install "
               "60-hapode-spidar.rules (docs/spidar.md)",
               path, latency);
    }
  }
  return status;
}

int hapi_spidar_serial_attach(hapi_spidar_serial *serial, const char *path)
{
  int fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) {
    return -errno;
  }
  int error = !isatty(fd) ? ENOTTY : flock(fd, LOCK_EX | LOCK_NB) != 0 || !make_raw(fd) ? errno : 0;
  if (error != 0) {
    close(fd);
    return -error;
  }
  port_settle(fd);
  serial->fd = fd;
  return 0;
}

void hapi_spidar_serial_shut(hapi_spidar_serial *serial)
{
  int nothing = open("/dev/null", O_RDWR | O_CLOEXEC);
  if (nothing >= 0) {
    (void)dup3(nothing, serial->fd, O_CLOEXEC);
    close(nothing);
  }
}

int hapi_spidar_serial_latency(const char *path)
{
  char file[HAPI_SPIDAR_PATH_MAX + 64];
  char text[16] = "";
  char real[PATH_MAX];
  if (realpath(path, real) == NULL) {
    return -1;
  }
  snprintf(file, sizeof file, "/sys/bus/usb-serial/devices/%.200s/latency_timer",
           strrchr(real, '/') + 1);
  int fd = open(file, O_RDONLY | O_CLOEXEC);
  ssize_t count = fd >= 0 ? read(fd, text, sizeof text - 1) : -1;
  if (fd >= 0) {
    close(fd);
  }
  return count > 0 ? (int)strtol(text, NULL, 10) : -1;
}

/* ---- every tick ---- */

/* Of this process alone: the lock of the port keeps others out. */
static bool writer_enter(hapi_spidar_serial *serial)
{
  uintptr_t none = 0;
  return atomic_compare_exchange_strong(&serial->writer, &none, (uintptr_t)pthread_self());
}

static void writer_leave(hapi_spidar_serial *serial)
{
  atomic_store(&serial->writer, 0);
}

/* Bytes that the port took, or -errno. */
static int port_write(const hapi_spidar_serial *serial, const uint8_t *bytes, int count)
{
  ssize_t sent = write(serial->fd, bytes, (size_t)count);
  if (sent >= 0) {
    return (int)sent;
  }
  /* EINTR: before a byte went out, by a signal handler that zeroed perhaps */
  return errno == EINTR ? -EAGAIN : -errno;
}

static void rest_keep(hapi_spidar_serial *serial, const uint8_t *bytes, int count)
{
  HAPI_ASSERT(count >= 0 && count <= (int)sizeof serial->rest);
  memmove(serial->rest, bytes, (size_t)count);
  serial->rest_count = count;
}

/* 0: nothing is left of what went before; -errno. */
static int rest_write(hapi_spidar_serial *serial)
{
  static const uint8_t end[HAPI_SPIDAR_FRAME_MAX];
  unsigned cuts = atomic_load(&serial->cuts);
  if (cuts != serial->cuts_known) {
    serial->cuts_known = cuts;
    rest_keep(serial, end, (int)sizeof end);
  }
  if (serial->rest_count == 0) {
    return 0;
  }
  int sent = port_write(serial, serial->rest, serial->rest_count);
  if (sent > 0) {
    rest_keep(serial, serial->rest + sent, serial->rest_count - sent);
  }
  return sent < 0 ? sent : serial->rest_count > 0 ? -EAGAIN : 0;
}

/* All bytes or none: 0 or -errno. */
static int whole_write(hapi_spidar_serial *serial, const uint8_t *bytes, int count)
{
  int status = rest_write(serial);
  if (status < 0) {
    return status;
  }
  int sent = port_write(serial, bytes, count);
  if (sent <= 0) {
    return sent < 0 ? sent : -EAGAIN;
  }
  rest_keep(serial, bytes + sent, count - sent);
  return 0;
}

static int serial_send(void *self, const uint8_t *bytes, int count)
{
  hapi_spidar_serial *serial = self;
  if (!writer_enter(serial)) {
    return -EAGAIN; /* zeros are going out */
  }
  bool first = atomic_load(&serial->forcing) == 0; /* else zeros wait for this one */
  int sent = first ? whole_write(serial, bytes, count) : -EAGAIN;
  writer_leave(serial);
  return sent;
}

static int serial_receive(void *self, uint8_t *bytes, int size)
{
  const hapi_spidar_serial *serial = self;
  ssize_t count = read(serial->fd, bytes, (size_t)size);
  if (count > 0) {
    return (int)count;
  }
  if (count == 0) {
    return -EIO; /* hung up; also /dev/null, when there is no port */
  }
  return errno == EAGAIN || errno == EINTR ? 0 : -errno;
}

static void serial_await(void *self, double seconds)
{
  const hapi_spidar_serial *serial = self;
  struct pollfd file = {serial->fd, POLLIN, 0};
  const struct timespec timeout = {(time_t)seconds,
                                   (long)(1e9 * (seconds - (double)(time_t)seconds))};
  (void)ppoll(&file, 1, &timeout, NULL);
}

static double serial_now(void *self)
{
  (void)self;
  return 1e-9 * (double)hapi_clock_now();
}

static void serial_flush(void *self)
{
  const hapi_spidar_serial *serial = self;
  (void)tcflush(serial->fd, TCIFLUSH);
}

void hapi_spidar_serial_port(hapi_spidar_serial *serial, hapi_spidar_port *out)
{
  *out = (hapi_spidar_port){serial,       serial_send, serial_receive,
                            serial_await, serial_now,  serial_flush};
}

/* Who is in the driver is out again in some us. One who has lost the processor needs the caller's,
 * so the caller sleeps. No wait for a write that this one interrupted, as a signal handler, and
 * none for other zeros, which may go in between. */
static bool writer_await(hapi_spidar_serial *serial)
{
  const struct timespec pause = {0, WRITER_PAUSE_NS};
  bool alone = writer_enter(serial);
  if (!alone && atomic_load(&serial->writer) == (uintptr_t)pthread_self()) {
    return false;
  }
  int64_t end = hapi_clock_now() + WRITER_LOOK_NS;
  while (!alone && hapi_clock_now() < end) {
    alone =
        atomic_load_explicit(&serial->writer, memory_order_relaxed) == 0 && writer_enter(serial);
  }
  for (int i = 0; i < WRITER_PAUSES && !alone && atomic_load(&serial->forcing) == 1; ++i) {
    (void)nanosleep(&pause, NULL);
    alone = writer_enter(serial);
  }
  return alone;
}

static bool force_alone(hapi_spidar_serial *serial, const uint8_t *bytes, int count)
{
  int status = -EAGAIN;
  for (int i = 0; i < FORCE_TRIES && status == -EAGAIN; ++i) {
    status = whole_write(serial, bytes, count);
  }
  for (int i = 0; i < FORCE_TRIES && status == 0 && serial->rest_count > 0; ++i) {
    int left = rest_write(serial);
    status = left == -EAGAIN ? 0 : left;
  }
  return status == 0 && serial->rest_count == 0;
}

/* Somebody who was interrupted here, or hangs in the driver, does not leave. Before and behind it
 * cuts tells: others may write in between. */
static bool force_beside(hapi_spidar_serial *serial, const uint8_t *bytes, int count)
{
  int sent = -EAGAIN;
  atomic_fetch_add(&serial->cuts, 1);
  for (int i = 0; i < FORCE_TRIES && (sent == -EAGAIN || (sent >= 0 && sent < count)); ++i) {
    sent = port_write(serial, bytes, count);
  }
  atomic_fetch_add(&serial->cuts, 1);
  return sent == count;
}

bool hapi_spidar_serial_force(hapi_spidar_serial *serial, const uint8_t *bytes, int count)
{
  int before = errno; /* of what was interrupted */
  atomic_fetch_add(&serial->forcing, 1);
  bool alone = writer_await(serial);
  bool sent = alone ? force_alone(serial, bytes, count) : force_beside(serial, bytes, count);
  if (alone) {
    writer_leave(serial);
  }
  atomic_fetch_sub(&serial->forcing, 1);
  errno = before;
  return sent;
}
