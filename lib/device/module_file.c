/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "device/module_file.h"

#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <limits.h>
#include <pwd.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/xattr.h>
#include <unistd.h>

#include "base/assert.h"
#include "base/log.h"

/* A module holds motors, and root may be who loads it. So the path is walked by descriptors, one
 * part after the other, and each part is checked as it is opened. A folder that others may write
 * lets them put another file under the same name. Links are read here and not by the system, as
 * their folders count too.
 *
 * A sticky folder such as /tmp lets others add names, but not replace those of other owners. There
 * a file or link with several names is refused: anybody may have given it this one. */

#define LINKS_MAX 40   /* the system's own bound */
#define PATH_SHOWN 200 /* characters of a path in a text */
#define PLACE_SHOWN 120

typedef struct walk {
  const char *path; /* of the user */
  hap_detail *detail;
  int at;              /* descriptor of the folder that was reached */
  bool shared;         /* that folder is sticky, and others may add names */
  char here[PATH_MAX]; /* its path, for texts */
  char rest[PATH_MAX]; /* what is still to walk, behind "here" */
  int links;
} walk;

static hap_status walk_refuse(const walk *w, const char *what, const char *remedy)
{
  return hapi_fail(w->detail, HAP_ERROR_IO,
                   "module %.*s: %.*s %s; only root and the user may change what holds motors: %s",
                   PATH_SHOWN, w->path, PLACE_SHOWN, w->here, what, remedy);
}

static hap_status walk_fail(const walk *w, int cause)
{
  return hapi_fail(w->detail, cause == ENOENT ? HAP_ERROR_NOT_FOUND : HAP_ERROR_IO,
                   "module %.*s: cannot be opened: %s", PATH_SHOWN, w->path, strerror(cause));
}

/* ---- who may write ---- */

/* An access list of the file system adds writers, who show as the group. */
static bool has_access_list(int place)
{
  char name[40];
  snprintf(name, sizeof name, "/proc/self/fd/%d", place);
  return getxattr(name, "system.posix_acl_access", NULL, 0) >= 0;
}

/* Many systems give each user a group of his own, with his name. */
static bool group_is_private(int place, const struct stat *about)
{
  struct passwd user;
  struct group group;
  struct passwd *found_user = NULL;
  struct group *found_group = NULL;
  char user_text[2048];
  char group_text[2048];
  return about->st_uid != 0 && !has_access_list(place) &&
         getpwuid_r(about->st_uid, &user, user_text, sizeof user_text, &found_user) == 0 &&
         getgrgid_r(about->st_gid, &group, group_text, sizeof group_text, &found_group) == 0 &&
         found_user != NULL && found_group != NULL && user.pw_gid == about->st_gid &&
         strcmp(user.pw_name, group.gr_name) == 0 && group.gr_mem[0] == NULL;
}

static bool others_may_write(int place, const struct stat *about)
{
  return (about->st_mode & S_IWOTH) != 0 ||
         ((about->st_mode & S_IWGRP) != 0 && !group_is_private(place, about));
}

/* The place is w->here: a folder, a link or a file. */
static hap_status place_check(const walk *w, int place, const struct stat *about)
{
  bool is_folder = S_ISDIR(about->st_mode);
  bool is_sticky = is_folder && (about->st_mode & S_ISVTX) != 0;
  if (about->st_uid != 0 && about->st_uid != geteuid()) {
    char what[60];
    snprintf(what, sizeof what, "belongs to user number %ju", (uintmax_t)about->st_uid);
    return walk_refuse(w, what, "chown it, or run as that user");
  }
  if (w->shared && !is_folder && about->st_nlink != 1) {
    return walk_refuse(w, "has several names (hard links), in a folder that others may write",
                       "copy it to a folder of your own");
  }
  if (!S_ISLNK(about->st_mode) && !is_sticky && others_may_write(place, about)) {
    return walk_refuse(w, "may be written by others", "chmod go-w on it");
  }
  return HAP_OK;
}

/* ---- the walk ---- */

/* Takes the descriptor. */
static hap_status walk_folder(walk *w, int place, const struct stat *about)
{
  if (w->at >= 0) {
    close(w->at);
  }
  w->at = place;
  w->shared = others_may_write(place, about);
  return place_check(w, place, about);
}

/* -1: there is none, and errno says why. */
static int place_open(int folder, const char *name, struct stat *out_about)
{
  int place = openat(folder, name, O_PATH | O_NOFOLLOW | O_CLOEXEC);
  if (place >= 0 && fstat(place, out_about) != 0) {
    close(place);
    return -1;
  }
  return place;
}

static hap_status walk_begin(walk *w)
{
  struct stat about;
  memcpy(w->here, "/", 2);
  int place = place_open(AT_FDCWD, "/", &about);
  return place < 0 ? walk_fail(w, errno) : walk_folder(w, place, &about);
}

/* The link's text takes its place before what is still to walk. */
static hap_status walk_link(walk *w, int place)
{
  char text[PATH_MAX];
  ssize_t length = readlinkat(place, "", text, sizeof text);
  close(place);
  if (length < 0) {
    return walk_fail(w, errno);
  }
  size_t kept = strlen(w->rest);
  if (++w->links > LINKS_MAX) {
    return walk_fail(w, ELOOP);
  }
  if ((size_t)length + kept + 2 > sizeof w->rest) {
    return walk_fail(w, ENAMETOOLONG);
  }
  memmove(w->rest + length + 1, w->rest, kept + 1);
  memcpy(w->rest, text, (size_t)length);
  w->rest[length] = '/';
  if (w->rest[length + 1] == '\0') {
    w->rest[length] = '\0';
  }
  if (text[0] == '/') {
    return walk_begin(w);
  }
  *strrchr(w->here, '/') = '\0'; /* the link's own name */
  return HAP_OK;
}

/* For the texts alone, so a path that is too long is cut. */
static void here_append(walk *w, const char *name)
{
  size_t length = strlen(w->here);
  const char *slash = length > 0 && w->here[length - 1] == '/' ? "" : "/";
  snprintf(w->here + length, sizeof w->here - length, "%s%.255s", slash, name);
}

/* Takes one name off the rest. out_place: -1 until the name is neither a folder nor a link. */
static hap_status walk_on(walk *w, int *out_place)
{
  char name[NAME_MAX + 1];
  struct stat about;
  const char *first = w->rest + strspn(w->rest, "/");
  size_t length = strcspn(first, "/");
  if (length >= sizeof name) {
    return walk_fail(w, ENAMETOOLONG);
  }
  memcpy(name, first, length);
  name[length] = '\0';
  memmove(w->rest, first + length, strlen(first + length) + 1);
  if (length == 0) {
    return HAP_OK;
  }
  int place = place_open(w->at, name, &about);
  if (place < 0) {
    return walk_fail(w, errno);
  }
  here_append(w, name);
  if (S_ISDIR(about.st_mode)) {
    return walk_folder(w, place, &about);
  }
  hap_status status = HAP_OK;
  if (S_ISREG(about.st_mode) || S_ISLNK(about.st_mode)) {
    status = place_check(w, place, &about);
  }
  if (status == HAP_OK && S_ISLNK(about.st_mode)) {
    return walk_link(w, place);
  }
  if (status == HAP_OK && w->rest[0] != '\0') {
    status = walk_fail(w, ENOTDIR);
  }
  if (status != HAP_OK) {
    close(place);
    return status;
  }
  *out_place = place;
  return HAP_OK;
}

/* O_PATH touches no device and waits for no pipe; only a file is opened for reading. */
static hap_status file_reopen(const walk *w, int place, int *out_file)
{
  struct stat about;
  char name[40];
  if (place < 0 || fstat(place, &about) != 0 || !S_ISREG(about.st_mode)) {
    return hapi_fail(w->detail, HAP_ERROR_IO,
                     "module %.*s: not a file but a folder, a pipe or a device", PATH_SHOWN,
                     w->path);
  }
  snprintf(name, sizeof name, "/proc/self/fd/%d", place);
  *out_file = open(name, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (*out_file < 0) {
    return hapi_fail(w->detail, HAP_ERROR_IO, "module %.*s: cannot be opened: %s%s", PATH_SHOWN,
                     w->path, strerror(errno), errno == ENOENT ? " (is /proc mounted?)" : "");
  }
  return HAP_OK;
}

hap_status hapi_module_file_open(const char *path, int *out_file, hap_detail *detail)
{
  walk w = {.path = path, .detail = detail, .at = -1};
  int place = -1;
  *out_file = -1;
  if (strlen(path) >= sizeof w.rest) {
    return walk_fail(&w, ENAMETOOLONG);
  }
  memcpy(w.rest, path, strlen(path) + 1);
  hap_status status = walk_begin(&w);
  while (status == HAP_OK && place < 0 && w.rest[0] != '\0') {
    status = walk_on(&w, &place);
  }
  if (status == HAP_OK) {
    status = file_reopen(&w, place, out_file);
  }
  if (place >= 0) {
    close(place);
  }
  if (w.at >= 0) {
    close(w.at);
  }
  return status;
}

/* The loader takes two libraries of one name for the same, and numbers of descriptors come again.
 * A loaded file keeps its number in the file system. So that number is in the name, as a slash for
 * each 0 and "/." for each 1, which the system passes over. */
static char *append_bits(char *end, uint64_t number)
{
  for (int bit = 0; bit < 64; ++bit) {
    *end++ = '/';
    if (((number >> bit) & 1) != 0) {
      *end++ = '.';
    }
  }
  return end;
}

void hapi_module_file_name(int file, char *out, size_t size)
{
  struct stat about = {.st_ino = 0};
  HAPI_ASSERT(size >= HAPI_MODULE_LOAD_PATH);
  (void)fstat(file, &about);
  char *end = out + snprintf(out, size, "/proc/self/fd");
  end = append_bits(append_bits(end, about.st_ino), about.st_dev);
  snprintf(end, size - (size_t)(end - out), "/%d", file);
}
