/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/identity.h"

#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

#define PORTS 16  /* of each kind that are looked at */
#define UPWARDS 5 /* from the port's folder to the adapter's, at most */
#define FILE_MAX 400

/* No printf and no heap here: the guard process calls this after a fork among threads. */
static void text_add(char *text, unsigned size, const char *more)
{
  unsigned used = (unsigned)strlen(text);
  while (*more != '\0' && used + 1 < size) {
    text[used++] = *more++;
  }
  text[used] = '\0';
}

/* The first line of a file; false: it cannot be read. */
static bool line_read(const char *folder, const char *name, char *out, unsigned size)
{
  char path[FILE_MAX] = "";
  text_add(path, sizeof path, folder);
  text_add(path, sizeof path, name);
  int file = open(path, O_RDONLY | O_CLOEXEC);
  ssize_t count = file >= 0 ? read(file, out, size - 1) : -1;
  if (file >= 0) {
    close(file);
  }
  out[count > 0 ? count : 0] = '\0';
  out[strcspn(out, "\n")] = '\0';
  return count > 0;
}

void hapi_spidar_identity_of(const char *sysfs, const char *name, hapi_spidar_identity *out)
{
  char folder[FILE_MAX] = "";
  char text[32];
  memset(out, 0, sizeof *out);
  text_add(folder, sizeof folder, sysfs);
  text_add(folder, sizeof folder, "/class/tty/");
  text_add(folder, sizeof folder, name);
  text_add(folder, sizeof folder, "/device/");
  for (int i = 0; i < UPWARDS && !out->usb; ++i) {
    char interface[sizeof out->interface];
    if (line_read(folder, "bInterfaceNumber", interface, sizeof interface)) {
      memcpy(out->interface, interface, sizeof interface);
    }
    out->usb = line_read(folder, "idVendor", out->product, sizeof out->product);
    if (!out->usb) {
      text_add(folder, sizeof folder, "../");
    }
  }
  if (!out->usb) {
    memset(out, 0, sizeof *out);
    return;
  }
  text_add(out->product, sizeof out->product, ":");
  (void)line_read(folder, "idProduct", text, sizeof text);
  text_add(out->product, sizeof out->product, text);
  (void)line_read(folder, "serial", out->serial, sizeof out->serial);
  (void)line_read(folder, "product", out->about, sizeof out->about);
  (void)line_read(folder, "busnum", out->place, sizeof out->place);
  (void)line_read(folder, "devpath", text, sizeof text);
  text_add(out->place, sizeof out->place, "-");
  text_add(out->place, sizeof out->place, text);
}

void hapi_spidar_identity_at(const char *sysfs, const char *path, hapi_spidar_identity *out)
{
  char real[PATH_MAX];
  memset(out, 0, sizeof *out);
  if (realpath(path, real) != NULL) {
    hapi_spidar_identity_of(sysfs, strrchr(real, '/') + 1, out);
  }
}

static bool identity_matches(const hapi_spidar_identity *wanted, const hapi_spidar_identity *found,
                             bool same_place)
{
  return found->usb && strcmp(found->product, wanted->product) == 0 &&
         strcmp(found->interface, wanted->interface) == 0 &&
         strcmp(found->serial, wanted->serial) == 0 &&
         (same_place ? strcmp(found->place, wanted->place) == 0 : wanted->serial[0] != '\0');
}

bool hapi_spidar_identity_next(const char *sysfs, int *at, char *out_path, unsigned size,
                               hapi_spidar_identity *out)
{
  static const char *const kinds[] = {"ttyUSB", "ttyACM"};
  for (; *at < 2 * PORTS; ++*at) {
    int number = *at % PORTS;
    const char digits[3] = {(char)('0' + number / 10), (char)('0' + number % 10), '\0'};
    char name[16] = "";
    text_add(name, sizeof name, kinds[*at / PORTS]);
    text_add(name, sizeof name, number < 10 ? digits + 1 : digits);
    hapi_spidar_identity_of(sysfs, name, out);
    if (out->usb) {
      ++*at;
      out_path[0] = '\0';
      text_add(out_path, size, "/dev/");
      text_add(out_path, size, name);
      return true;
    }
  }
  return false;
}

bool hapi_spidar_identity_find(const char *sysfs, const hapi_spidar_identity *identity, char *out,
                               unsigned size)
{
  char path[32];
  hapi_spidar_identity found;
  int elsewhere = 0;
  int at = 0;
  out[0] = '\0';
  while (identity->usb && hapi_spidar_identity_next(sysfs, &at, path, sizeof path, &found)) {
    bool here = identity_matches(identity, &found, true);
    if (here || identity_matches(identity, &found, false)) {
      out[0] = '\0';
      text_add(out, size, path);
      elsewhere += !here;
    }
    if (here) {
      return true;
    }
  }
  return elsewhere == 1;
}
