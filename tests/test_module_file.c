/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A module is loaded only from where nobody but root and the user can change it, and the file that
 * is loaded is the one that was checked. HAPODE_TABLES: a good module. */

#include "tests/files.h"
#include "tests/tap.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <pthread.h>
#include <pwd.h>
#include <stdatomic.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <sys/xattr.h>
#include <unistd.h>

#include "device/device.h"
#include "device/module_file.h"

#define NOBODY 65534

static char module_bytes[4000000];
static size_t module_size;

static void module_copy(const char *path)
{
  if (module_size == 0) {
    FILE *file = fopen(getenv("HAPODE_TABLES"), "r");
    REQUIRE(file != NULL);
    module_size = fread(module_bytes, 1, sizeof module_bytes, file);
    fclose(file);
    REQUIRE(module_size > 0 && module_size < sizeof module_bytes);
  }
  remove(path);
  file_write_bytes(path, module_bytes, module_size);
  REQUIRE(chmod(path, 0755) == 0);
}

/* A folder with a module in it, such as "own/m.so". */
static const char *folder_with_module(const char *folder, mode_t mode)
{
  static char path[400];
  REQUIRE(mkdir(folder_path(folder), 0755) == 0);
  snprintf(path, sizeof path, "%s/m.so", folder_path(folder));
  module_copy(path);
  REQUIRE(chmod(folder_path(folder), mode) == 0);
  return path;
}

static hap_status open_status(const char *path, hap_detail *detail)
{
  char spec[5000];
  hap_device *device = NULL;
  snprintf(spec, sizeof spec, "module:%s", path);
  hap_status status = hap_device_open(spec, &device, detail);
  hap_device_close(device);
  return status;
}

static void module_loads(const char *path)
{
  hap_detail detail = {""};
  hap_status status = open_status(path, &detail);
  CHECK_SAY(status == HAP_OK, "%s: %s", path, detail.text);
}

/* The text names the module's path, the wrong place and the remedy. */
static void module_refused(const char *path, const char *place, const char *what)
{
  hap_detail detail = {""};
  hap_status status = open_status(path, &detail);
  bool said = strstr(detail.text, path) != NULL && strstr(detail.text, place) != NULL &&
              strstr(detail.text, what) != NULL && strlen(detail.text) < sizeof detail.text - 1;
  CHECK_SAY(status == HAP_ERROR_IO && said, "%s: %s, \"%s\"", path, hap_status_name(status),
            detail.text);
}

/* ---- who may write ---- */

TEST(a_file_that_others_may_write_is_refused)
{
  const char *path = folder_with_module("file", 0755);
  module_loads(path);
  CHECK(chmod(path, 0757) == 0);
  module_refused(path, path, "may be written by others");
  module_refused(path, path, "chmod go-w");
  CHECK(chmod(path, 0700) == 0);
  module_loads(path);
  if (geteuid() == 0) { /* members of root's group are not root */
    CHECK(chmod(path, 0775) == 0);
    module_refused(path, path, "may be written by others");
  }
}

TEST(a_folder_that_others_may_write_is_refused)
{
  const char *path = folder_with_module("folder", 0777);
  module_refused(path, folder_path("folder"), "may be written by others");
  CHECK(chmod(folder_path("folder"), 0755) == 0);
  module_loads(path);
  char deep[400];
  REQUIRE(mkdir(folder_path("folder/deep"), 0755) == 0);
  snprintf(deep, sizeof deep, "%s/deep/m.so", folder_path("folder"));
  module_copy(deep);
  module_loads(deep);
  CHECK(chmod(folder_path("folder"), 0757) == 0); /* not only the last folder */
  module_refused(deep, folder_path("folder"), "chmod go-w");
}

TEST(links_do_not_hide_a_folder)
{
  char link_path[400];
  char target[400];
  const char *path = folder_with_module("bad", 0777);
  REQUIRE(symlink(path, folder_path("link.so")) == 0); /* a good folder, a bad target */
  module_refused(folder_path("link.so"), folder_path("bad"), "may be written by others");
  REQUIRE(symlink("bad", folder_path("link")) == 0); /* of a folder, relative */
  snprintf(link_path, sizeof link_path, "%s/m.so", folder_path("link"));
  module_refused(link_path, folder_path("bad"), "may be written by others");
  folder_with_module("good", 0755);
  snprintf(target, sizeof target, "%s/../good/m.so", folder_path("bad"));
  REQUIRE(symlink(target, folder_path("through.so")) == 0); /* a bad folder on the way */
  module_refused(folder_path("through.so"), folder_path("bad"), "may be written by others");
  snprintf(link_path, sizeof link_path, "%s/link.so", folder_path("bad"));
  REQUIRE(symlink("../good/m.so", link_path) == 0); /* a link in a bad folder */
  module_refused(link_path, folder_path("bad"), "may be written by others");
  REQUIRE(symlink("good/m.so", folder_path("fine.so")) == 0);
  module_loads(folder_path("fine.so"));
  REQUIRE(symlink(".//good/./../good/m.so", folder_path("winding.so")) == 0);
  module_loads(folder_path("winding.so"));
}

TEST(links_end)
{
  char name[30];
  hap_detail detail;
  REQUIRE(symlink("b.so", folder_path("a.so")) == 0 && symlink("a.so", folder_path("b.so")) == 0);
  CHECK(open_status(folder_path("a.so"), &detail) == HAP_ERROR_IO);
  CHECK(strstr(detail.text, strerror(ELOOP)) != NULL);
  module_copy(folder_path("l0"));
  for (int i = 1; i <= 41; ++i) {
    char target[30];
    snprintf(name, sizeof name, "l%d", i);
    snprintf(target, sizeof target, "l%d", i - 1);
    REQUIRE(symlink(target, folder_path(name)) == 0);
  }
  module_loads(folder_path("l40"));
  CHECK(open_status(folder_path("l41"), &detail) == HAP_ERROR_IO);
  REQUIRE(symlink("nowhere", folder_path("dangling.so")) == 0);
  CHECK(open_status(folder_path("dangling.so"), &detail) == HAP_ERROR_NOT_FOUND);
  snprintf(name, sizeof name, "l0/");
  CHECK(open_status(folder_path(name), &detail) == HAP_ERROR_IO);
  CHECK(strstr(detail.text, strerror(ENOTDIR)) != NULL);
}

/* /tmp is one: others may add names, but not replace those of other owners. */
TEST(a_sticky_folder_is_no_danger_but_for_names_that_others_gave)
{
  const char *path = folder_with_module("sticky", 01777);
  char other[400];
  module_loads(path);
  folder_with_module("kept", 0755);
  snprintf(other, sizeof other, "%s/linked.so", folder_path("sticky"));
  char kept[400];
  snprintf(kept, sizeof kept, "%s/m.so", folder_path("kept"));
  REQUIRE(link(kept, other) == 0);
  module_refused(other, other, "hard links");
  module_loads(kept); /* where nobody else can add names, several do no harm */
}

/* ---- owners ---- */

static const struct passwd *user_with_private_group(void)
{
  const struct passwd *user = NULL;
  setpwent();
  while ((user = getpwent()) != NULL) {
    const struct group *group = getgrgid(user->pw_gid);
    if (user->pw_uid != 0 && group != NULL && strcmp(group->gr_name, user->pw_name) == 0 &&
        group->gr_mem[0] == NULL) {
      break;
    }
  }
  return user;
}

/* In a process of that user. */
static hap_status status_as(uid_t user, gid_t group, const char *path)
{
  int end = 0;
  fflush(stdout);
  pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    bool good = setgroups(0, NULL) == 0 && setgid(group) == 0 && setuid(user) == 0;
    _exit(good ? -(int)open_status(path, NULL) : 99);
  }
  REQUIRE(waitpid(child, &end, 0) == child && WIFEXITED(end));
  return (hap_status)-WEXITSTATUS(end);
}

TEST(only_root_and_the_user_may_own_file_and_folders)
{
  if (geteuid() != 0) {
    SKIP("only root can give files away");
  }
  const struct passwd *user = user_with_private_group();
  if (user == NULL) {
    SKIP("no user with a group of its own");
  }
  uid_t uid = user->pw_uid;
  gid_t gid = user->pw_gid;
  REQUIRE(chmod(test_folder, 0755) == 0);
  const char *path = folder_with_module("owned", 0755);
  CHECK(status_as(uid, gid, path) == HAP_OK); /* root's */
  REQUIRE(chown(path, uid, gid) == 0);
  module_refused(path, path, "belongs to user number");
  module_refused(path, path, "chown");
  CHECK(status_as(uid, gid, path) == HAP_OK); /* its own */
  CHECK(status_as(NOBODY, NOBODY, path) == HAP_ERROR_IO);
  REQUIRE(chmod(path, 0775) == 0);
  CHECK(status_as(uid, gid, path) == HAP_OK); /* nobody else is in its group */
  REQUIRE(chown(path, uid, NOBODY) == 0);
  CHECK(status_as(uid, gid, path) == HAP_ERROR_IO);
  REQUIRE(chown(path, 0, 0) == 0 && chmod(path, 0755) == 0);
  module_loads(path);
  REQUIRE(chown(folder_path("owned"), uid, gid) == 0); /* may replace root's file */
  module_refused(path, folder_path("owned"), "belongs to user number");
  CHECK(status_as(uid, gid, path) == HAP_OK);
  REQUIRE(symlink(path, folder_path("lent.so")) == 0 && chown(folder_path("owned"), 0, 0) == 0);
  module_loads(folder_path("lent.so"));
  REQUIRE(lchown(folder_path("lent.so"), uid, gid) == 0);
  module_refused(folder_path("lent.so"), folder_path("lent.so"), "belongs to user number");
}

/* The list shows as rights of the group. */
TEST(an_access_list_is_seen)
{
  static const unsigned char list[] = {2,  0, 0, 0,                      /* version */
                                       1,  0, 7, 0, 255, 255, 255, 255,  /* owner */
                                       2,  0, 7, 0, 1,   0,   0,   0,    /* user 1 */
                                       4,  0, 5, 0, 255, 255, 255, 255,  /* group */
                                       16, 0, 7, 0, 255, 255, 255, 255,  /* mask */
                                       32, 0, 5, 0, 255, 255, 255, 255}; /* others */
  const char *path = folder_with_module("listed", 0755);
  if (setxattr(path, "system.posix_acl_access", list, sizeof list, 0) != 0) {
    SKIP("no access lists here");
  }
  module_refused(path, path, "may be written by others");
  const struct passwd *user = geteuid() == 0 ? user_with_private_group() : NULL;
  if (user != NULL) {
    uid_t uid = user->pw_uid;
    gid_t gid = user->pw_gid;
    REQUIRE(chmod(test_folder, 0755) == 0 && chown(path, uid, gid) == 0);
    CHECK(status_as(uid, gid, path) == HAP_ERROR_IO);
  }
}

/* ---- one file ---- */

/* Descriptors of closed files come again. */
TEST(two_modules_are_never_taken_for_one)
{
  hap_device *devices[2] = {NULL, NULL};
  void *libraries[2];
  char spec[2][500];
  char name[HAPI_MODULE_LOAD_PATH];
  char other_name[HAPI_MODULE_LOAD_PATH];
  int file = -1;
  hap_detail detail;
  module_copy(folder_path("one.so"));
  module_copy(folder_path("two.so"));
  snprintf(spec[0], sizeof spec[0], "module:%s", folder_path("one.so"));
  snprintf(spec[1], sizeof spec[1], "module:%s", folder_path("two.so"));
  for (int i = 0; i < 2; ++i) {
    REQUIRE(hap_device_open(spec[i], &devices[i], NULL) == HAP_OK);
    libraries[i] = dlopen(spec[i] + strlen("module:"), RTLD_NOW | RTLD_NOLOAD);
    REQUIRE(libraries[i] != NULL);
  }
  CHECK(libraries[0] != libraries[1]);
  CHECK(dlsym(libraries[0], "tables_opened") != dlsym(libraries[1], "tables_opened"));
  for (int i = 0; i < 2; ++i) {
    dlclose(libraries[i]);
    hap_device_close(devices[i]);
  }
  REQUIRE(hapi_module_file_open(folder_path("one.so"), &file, &detail) == HAP_OK);
  hapi_module_file_name(file, name, sizeof name);
  CHECK(access(name, R_OK) == 0);
  int kept = file;
  close(file);
  REQUIRE(hapi_module_file_open(folder_path("two.so"), &file, &detail) == HAP_OK);
  hapi_module_file_name(file, other_name, sizeof other_name);
  CHECK(file == kept && strcmp(name, other_name) != 0);
  close(file);
}

static atomic_int over;

/* A link that leads to a good file and to one that others may write, by turns. */
static void *link_swap(void *unused)
{
  while (atomic_load(&over) == 0) {
    bool good = symlink("good.so", folder_path("new.so")) == 0 &&
                rename(folder_path("new.so"), folder_path("swap.so")) == 0 &&
                symlink("bad.so", folder_path("new.so")) == 0 &&
                rename(folder_path("new.so"), folder_path("swap.so")) == 0;
    if (!good) {
      break;
    }
  }
  return unused;
}

static bool is_mapped(const char *part)
{
  char line[600];
  bool found = false;
  FILE *maps = fopen("/proc/self/maps", "r");
  while (maps != NULL && fgets(line, sizeof line, maps) != NULL) {
    found = found || strstr(line, part) != NULL;
  }
  if (maps != NULL) {
    fclose(maps);
  }
  return found;
}

TEST(what_is_loaded_is_what_was_checked)
{
  pthread_t thread;
  char spec[500];
  int loaded = 0;
  module_copy(folder_path("good.so"));
  module_copy(folder_path("bad.so"));
  REQUIRE(chmod(folder_path("bad.so"), 0777) == 0);
  REQUIRE(symlink("good.so", folder_path("swap.so")) == 0);
  snprintf(spec, sizeof spec, "module:%s", folder_path("swap.so"));
  atomic_store(&over, 0);
  REQUIRE(pthread_create(&thread, NULL, link_swap, NULL) == 0);
  for (int i = 0; i < 400; ++i) {
    hap_device *device = NULL;
    if (hap_device_open(spec, &device, NULL) == HAP_OK) {
      ++loaded;
      CHECK(is_mapped("/good.so") && !is_mapped("/bad.so"));
    }
    hap_device_close(device);
  }
  atomic_store(&over, 1);
  pthread_join(thread, NULL);
  CHECK(loaded > 0 && loaded < 400);
}

static int descriptors_open(void)
{
  int count = 0;
  for (int i = 0; i < 256; ++i) {
    count += fcntl(i, F_GETFD) >= 0;
  }
  return count;
}

TEST(no_descriptor_is_left)
{
  int before = descriptors_open();
  hap_detail detail;
  module_copy(folder_path("fd.so"));
  REQUIRE(symlink("fd.so", folder_path("fdl.so")) == 0);
  REQUIRE(mkfifo(folder_path("fifo.so"), 0600) == 0);
  module_loads(folder_path("fdl.so"));
  CHECK(open_status(folder_path("fifo.so"), &detail) == HAP_ERROR_IO);
  CHECK(open_status(folder_path("none.so"), &detail) == HAP_ERROR_NOT_FOUND);
  CHECK(open_status(folder_path("fd.so/x"), &detail) == HAP_ERROR_IO);
  CHECK(open_status(test_folder, &detail) == HAP_ERROR_IO);
  CHECK(chmod(folder_path("fd.so"), 0777) == 0);
  CHECK(open_status(folder_path("fdl.so"), &detail) == HAP_ERROR_IO);
  CHECK(descriptors_open() == before);
}

SET_UP
{
  return getenv("HAPODE_TABLES") != NULL ? folder_make() : tap_bail_out("HAPODE_TABLES is not set");
}
