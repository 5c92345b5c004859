/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/doctor.h"

#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <hapode/hapode.h>

void doctor_check_devices(const doctor_place *place, doctor_check *check)
{
  const char *name;
  (void)place;
  doctor_say(check, DOCTOR_OK, "devices:");
  for (size_t i = 0; (name = hap_device_name_at(i, NULL)) != NULL; ++i) {
    doctor_append(check, " ", name);
  }
}

/* Loaded and let go of; nothing in them is called by name. */
void doctor_check_vendors(const doctor_place *place, doctor_check *check)
{
  static const char *const names[] = {"libdhd.so", "libdhd.so.3", "libHD.so", "libHD.so.3"};
  (void)place;
  doctor_say(check, DOCTOR_OK, "vendor libraries:");
  size_t found = 0;
  for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
    void *library = dlopen(names[i], RTLD_LAZY | RTLD_LOCAL);
    const char *why = library == NULL ? dlerror() : NULL;
    if (library != NULL) {
      doctor_append(check, " ", names[i]);
      ++found;
      (void)dlclose(library);
    } else if (why != NULL && !(strncmp(why, names[i], strlen(names[i])) == 0 &&
                                strstr(why, "No such file") != NULL)) {
      check->state = DOCTOR_WARNING;
      doctor_append(check, " cannot be loaded: ", why);
      doctor_todo(check, "install the vendor's library again, for this processor");
      ++found;
    }
  }
  if (found == 0) {
    doctor_append(check, " ", "none (only their devices need them)");
  }
}

void doctor_check_rules(const doctor_place *place, doctor_check *check)
{
  static const char *const folders[] = {"/etc/udev/rules.d", "/usr/lib/udev/rules.d",
                                        "/lib/udev/rules.d", "/usr/local/lib/udev/rules.d"};
  char path[4096];
  for (size_t i = 0; i < 3; ++i) {
    snprintf(path, sizeof path, "%s%s/60-hapode-spidar.rules", place->root, folders[i]);
    if (access(path, F_OK) == 0) {
      doctor_say(check, DOCTOR_OK, "%s/60-hapode-spidar.rules", folders[i]);
      return;
    }
  }
  snprintf(path, sizeof path, "%s%s/60-hapode-spidar.rules", place->root, folders[3]);
  doctor_say(check, DOCTOR_WARNING, "60-hapode-spidar.rules is %s",
             access(path, F_OK) == 0 ? "where udev does not look" : "not installed");
  doctor_todo(check,
              "sudo cp plugins/spidar/60-hapode-spidar.rules /etc/udev/rules.d/ && sudo udevadm "
              "control --reload");
}

/* Whether the process is in the group of that name. */
static bool group_has(const doctor_place *place, const char *name)
{
  char rest[512];
  char groups[1024];
  char wanted[64];
  snprintf(wanted, sizeof wanted, "%s:", name);
  if (!doctor_field(place, "/etc/group", wanted, rest, sizeof rest) ||
      !doctor_field(place, "/proc/self/status", "Groups:", groups, sizeof groups)) {
    return false;
  }
  const char *colon = strchr(rest, ':');
  long id = colon != NULL ? strtol(colon + 1, NULL, 10) : -1;
  char *end = groups;
  for (const char *at = groups;; at = end) {
    long group = strtol(at, &end, 10);
    if (end == at) {
      return false;
    }
    if (group == id) {
      return true;
    }
  }
}

void doctor_check_groups(const doctor_place *place, doctor_check *check)
{
  bool dialout = group_has(place, "dialout");
  bool plugdev = group_has(place, "plugdev");
  if (doctor_is_root(place)) {
    doctor_say(check, DOCTOR_OK, "root needs no groups");
  } else if (dialout && plugdev) {
    doctor_say(check, DOCTOR_OK, "dialout and plugdev");
  } else {
    doctor_say(check, DOCTOR_WARNING, "not in%s%s", dialout ? "" : " dialout",
               plugdev ? "" : " plugdev");
    doctor_todo(check, "sudo usermod -aG dialout,plugdev $USER, then log in again");
  }
}

/* A process that has the file open, 0: none that can be seen. */
static long port_holder(const doctor_place *place, const char *port)
{
  char path[64];
  char target[256];
  DIR *all = doctor_folder(place, "/proc");
  struct dirent *process;
  long holder = 0;
  while (all != NULL && holder == 0 && (process = readdir(all)) != NULL) {
    long id = strtol(process->d_name, NULL, 10);
    snprintf(path, sizeof path, "/proc/%ld/fd", id);
    DIR *files = id > 0 ? doctor_folder(place, path) : NULL;
    struct dirent *file;
    while (files != NULL && holder == 0 && (file = readdir(files)) != NULL) {
      ssize_t length = readlinkat(dirfd(files), file->d_name, target, sizeof target - 1);
      target[length > 0 ? length : 0] = '\0';
      holder = strcmp(target, port) == 0 ? id : 0;
    }
    if (files != NULL) {
      closedir(files);
    }
  }
  if (all != NULL) {
    closedir(all);
  }
  return holder;
}

static void port_look(const doctor_place *place, const char *port, doctor_check *check)
{
  char path[4096];
  char line[128];
  long holder = port_holder(place, port);
  snprintf(path, sizeof path, "%s%s", place->root, port);
  if (holder > 0) {
    snprintf(line, sizeof line, "%.60s is held by process %ld", port, holder);
    check->state = DOCTOR_PROBLEM;
    snprintf(check->todo, sizeof check->todo, "ps %ld, then end that program", holder);
  } else if (access(path, R_OK | W_OK) != 0) {
    snprintf(line, sizeof line, "%.60s: %s", port, strerror(errno));
    check->state = DOCTOR_PROBLEM;
    doctor_todo(check, "ls -l /dev/ttyUSB* /dev/ttyACM*; see the checks udev_rules and groups");
  } else {
    snprintf(line, sizeof line, "%.60s is free", port);
  }
  doctor_append(check, check->text[0] != '\0' ? "; " : "", line);
}

void doctor_check_ports(const doctor_place *place, doctor_check *check)
{
  char port[300];
  const char *named = getenv("HAPODE_SPIDAR_PORT");
  DIR *folder = doctor_folder(place, "/sys/class/tty");
  struct dirent *entry;
  if (named != NULL && *named != '\0') {
    port_look(place, named, check);
  }
  while (folder != NULL && (entry = readdir(folder)) != NULL) {
    if (strncmp(entry->d_name, "ttyUSB", 6) == 0 || strncmp(entry->d_name, "ttyACM", 6) == 0) {
      snprintf(port, sizeof port, "/dev/%s", entry->d_name);
      port_look(place, port, check);
    }
  }
  if (folder != NULL) {
    closedir(folder);
  }
  if (check->text[0] == '\0') {
    doctor_say(check, DOCTOR_OK, "no serial port of a USB adapter");
  }
}
