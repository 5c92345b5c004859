/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef HAPODE_LIBSERIALPORT
#include <libserialport.h>
#endif

#include "plugins/spidar/serial.h"

/* Bytes are sent to a port that is looked at, so only those of USB adapters are: whatever else
 * there is may be a console or a modem. */

#ifdef HAPODE_LIBSERIALPORT

static bool usb_port_at(int index, char *path)
{
  struct sp_port **ports = NULL;
  bool found = false;
  if (sp_list_ports(&ports) != SP_OK) {
    return false;
  }
  for (int i = 0; ports[i] != NULL && !found; ++i) {
    if (sp_get_port_transport(ports[i]) == SP_TRANSPORT_USB && index-- == 0) {
      snprintf(path, HAPI_SPIDAR_PATH_MAX, "%s", sp_get_port_name(ports[i]));
      found = true;
    }
  }
  sp_free_port_list(ports);
  return found;
}

#else

static bool is_usb(const char *name)
{
  return strncmp(name, "ttyUSB", 6) == 0 || strncmp(name, "ttyACM", 6) == 0;
}

/* In the order of the names, so that the same port is the first one each time. */
static bool usb_port_at(int index, char *path)
{
  char last[64] = "";
  bool found = true;
  for (int round = 0; round <= index && found; ++round) {
    char next[64] = "";
    DIR *folder = opendir("/sys/class/tty");
    const struct dirent *entry;
    while (folder != NULL && (entry = readdir(folder)) != NULL) {
      if (is_usb(entry->d_name) && strcmp(entry->d_name, last) > 0 &&
          (next[0] == '\0' || strcmp(entry->d_name, next) < 0)) {
        snprintf(next, sizeof next, "%.63s", entry->d_name);
      }
    }
    if (folder != NULL) {
      closedir(folder);
    }
    found = next[0] != '\0';
    memcpy(last, next, sizeof last);
  }
  if (found) {
    snprintf(path, HAPI_SPIDAR_PATH_MAX, "/dev/%s", last);
  }
  return found;
}

#endif

bool hapi_spidar_port_at(int index, char *path)
{
  const char *named = getenv("HAPODE_SPIDAR_PORT");
  if (named != NULL && *named != '\0') {
    if (index == 0) {
      snprintf(path, HAPI_SPIDAR_PATH_MAX, "%s", named);
      return true;
    }
    --index;
  }
  return usb_port_at(index, path);
}
