/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/doctor.h"

#include <dlfcn.h>
#include <errno.h>
#include <link.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <hapode/hapode.h>

#include "plugins/forcedimension/libdhd.h"
#include "plugins/openhaptics/libhd.h"

void doctor_check_devices(const doctor_place *place, doctor_check *check)
{
  const char *name;
  (void)place;
  doctor_say(check, DOCTOR_OK, "devices:");
  for (size_t i = 0; (name = hap_device_name_at(i, NULL)) != NULL; ++i) {
    doctor_append(check, " ", name);
  }
}

/* ---- libraries of makers ---- */

typedef struct maker_library {
  const char *device;
  const char *const *names; /* as the device tries them; ends with NULL */
} maker_library;

static const maker_library maker_libraries[] = {{"forcedimension", hapi_dhd_names},
                                                {"openhaptics", hapi_hd_names}};

/* The whole path of a library that was loaded. */
static const char *library_path(void *library, const char *name)
{
  struct link_map *map = NULL;
  return dlinfo(library, RTLD_DI_LINKMAP, (void *)&map) == 0 && map->l_name[0] == '/' ? map->l_name
                                                                                      : name;
}

/* Loaded and let go of; nothing in it is called by name. False: it is not there. */
static bool library_look(const maker_library *maker, doctor_check *check)
{
  for (size_t i = 0; maker->names[i] != NULL; ++i) {
    void *library = dlopen(maker->names[i], RTLD_LAZY | RTLD_LOCAL);
    const char *why = library == NULL ? dlerror() : NULL;
    if (library != NULL) {
      doctor_append(check, " ", library_path(library, maker->names[i]));
      (void)dlclose(library);
      return true;
    }
    if (why != NULL && !(strncmp(why, maker->names[i], strlen(maker->names[i])) == 0 &&
                         strstr(why, "No such file") != NULL)) {
      check->state = DOCTOR_WARNING;
      doctor_append(check, " cannot be loaded: ", why);
      doctor_todo(check, "install the vendor's library again, for this processor");
      return true;
    }
  }
  return false;
}

/* Copied to where the loader would find it after ldconfig. */
static bool library_is_unseen(const doctor_place *place, const maker_library *maker,
                              doctor_check *check)
{
  char path[4096];
  for (size_t i = 0; maker->names[i] != NULL; ++i) {
    snprintf(path, sizeof path, "%s/usr/local/lib/%s", place->root, maker->names[i]);
    if (access(path, F_OK) == 0) {
      check->state = DOCTOR_WARNING;
      doctor_append(check, " /usr/local/lib/", maker->names[i]);
      doctor_append(check, " is not in the loader's list", "");
      doctor_todo(check, "sudo ldconfig");
      return true;
    }
  }
  return false;
}

/* Whether it is one of the folders that colons or semicolons part. */
static bool folders_have(const char *folders, const char *name)
{
  const size_t length = strlen(name);
  for (const char *at = folders; at != NULL; at = strpbrk(at, ":;"), at += at != NULL) {
    if (strncmp(at, name, length) == 0 && strchr(":;", at[length]) != NULL) {
      return true;
    }
  }
  return false;
}

/* Where the loader looks, in its order. Its list, /etc/ld.so.cache, comes before the folders that
 * it always knows. */
static void loader_folders(doctor_check *check)
{
  const char *set = getenv("LD_LIBRARY_PATH");
  void *self = dlopen(NULL, RTLD_LAZY);
  Dl_serinfo size = {0};
  doctor_append(check, "; looked in LD_LIBRARY_PATH (",
                set != NULL && *set != '\0' ? set : "not set");
  doctor_append(check, "), /etc/ld.so.cache", "");
  const bool told = self != NULL && dlinfo(self, RTLD_DI_SERINFOSIZE, &size) == 0;
  Dl_serinfo *folders = told ? malloc(size.dls_size) : NULL;
  if (folders != NULL && dlinfo(self, RTLD_DI_SERINFOSIZE, folders) == 0 &&
      dlinfo(self, RTLD_DI_SERINFO, folders) == 0) {
    for (unsigned i = 0; i < folders->dls_cnt; ++i) {
      if (!folders_have(set, folders->dls_serpath[i].dls_name)) {
        doctor_append(check, ", ", folders->dls_serpath[i].dls_name);
      }
    }
  }
  free(folders);
  if (self != NULL) {
    (void)dlclose(self);
  }
}

void doctor_check_vendors(const doctor_place *place, doctor_check *check)
{
  const size_t count = sizeof maker_libraries / sizeof maker_libraries[0];
  size_t absent = 0;
  doctor_say(check, DOCTOR_OK, "%s", "");
  for (size_t m = 0; m < count; ++m) {
    const maker_library *maker = &maker_libraries[m];
    doctor_append(check, m > 0 ? "; " : "", maker->device);
    doctor_append(check, ":", "");
    if (library_look(maker, check) || library_is_unseen(place, maker, check)) {
      continue;
    }
    ++absent;
    for (size_t i = 0; maker->names[i] != NULL; ++i) {
      doctor_append(check, i > 0 ? ", " : " no ", maker->names[i]);
    }
  }
  if (absent > 0) {
    loader_folders(check);
    doctor_append(check, "; only these devices need them", "");
  }
}

/* ---- rules of udev ---- */

static const struct {
  const char *device; /* also the folder in plugins */
  const char *file;
} device_rules[] = {{"spidar", "60-hapode-spidar.rules"},
                    {"forcedimension", "60-hapode-forcedimension.rules"}};

static bool rules_are_in(const doctor_place *place, const char *folder, const char *file)
{
  char path[4096];
  snprintf(path, sizeof path, "%s%s/%s", place->root, folder, file);
  return access(path, F_OK) == 0;
}

/* The folder of a file of rules among those that udev reads; NULL: none. */
static const char *rules_folder(const doctor_place *place, const char *file)
{
  static const char *const folders[] = {"/etc/udev/rules.d", "/run/udev/rules.d",
                                        "/usr/lib/udev/rules.d", "/lib/udev/rules.d"};
  for (size_t i = 0; i < sizeof folders / sizeof folders[0]; ++i) {
    if (rules_are_in(place, folders[i], file)) {
      return folders[i];
    }
  }
  return NULL;
}

void doctor_check_rules(const doctor_place *place, doctor_check *check)
{
  static const char unread[] = "/usr/local/lib/udev/rules.d";
  doctor_say(check, DOCTOR_OK, "%s", "");
  for (size_t i = 0; i < sizeof device_rules / sizeof device_rules[0]; ++i) {
    const char *file = device_rules[i].file;
    const char *folder = rules_folder(place, file);
    const bool astray = folder == NULL && rules_are_in(place, unread, file);
    if (i > 0) {
      doctor_append(check, "; ", "");
    }
    if (folder != NULL) {
      doctor_append(check, folder, "/");
      doctor_append(check, file, "");
      continue;
    }
    doctor_append(check, file, astray ? " is in " : " is not installed");
    doctor_append(check, astray ? unread : "", astray ? ", where udev does not look" : "");
    doctor_append(check, ", needed by ", device_rules[i].device);
    const size_t used = strlen(check->todo);
    snprintf(check->todo + used, sizeof check->todo - used, "%s%s%s%s/%s",
             check->state == DOCTOR_OK ? "sudo cp" : "", " ", astray ? unread : "plugins/",
             astray ? "" : device_rules[i].device, file);
    check->state = DOCTOR_WARNING;
  }
  if (check->state != DOCTOR_OK) {
    const size_t used = strlen(check->todo);
    snprintf(check->todo + used, sizeof check->todo - used,
             " /etc/udev/rules.d/ && sudo udevadm control --reload");
  }
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
