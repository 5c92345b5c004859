/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Every reader of a file refuses what is none, at once and in words: a pipe would hang it. A hang
 * is a time-out of this test. */

#include "tests/files.h"
#include "tests/tap.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <hapode/device.h>
#include <hapode/identify.h>
#include <hapode/record.h>

#include "base/regular.h"

static hap_status recording_read(const char *path, hap_detail *detail)
{
  hap_player *player = NULL;
  hap_status status = hap_player_open(path, HAP_PLAY_INCOMPLETE, &player, detail);
  hap_player_close(player);
  return status;
}

static hap_status spec_open(const char *format, const char *path, hap_detail *detail)
{
  char spec[600];
  hap_device *device = NULL;
  snprintf(spec, sizeof spec, "%s%s", format, path);
  hap_status status = hap_device_open(spec, &device, detail);
  hap_device_close(device);
  return status;
}

static hap_status motion_read(const char *path, hap_detail *detail)
{
  return spec_open("replay:", path, detail);
}

static hap_status geometry_read(const char *path, hap_detail *detail)
{
  return spec_open("spidar:/dev/null,model=", path, detail);
}

static hap_status identity_read(const char *path, hap_detail *detail)
{
  hap_device_identity identity;
  hap_device_identity_init(&identity, sizeof identity);
  return hap_device_identity_read(path, &identity, detail);
}

static hap_status module_read(const char *path, hap_detail *detail)
{
  return spec_open("module:", path, detail);
}

static hap_status (*const readers[])(const char *path, hap_detail *detail) = {
    recording_read, motion_read, geometry_read, identity_read, module_read};

static void all_refuse(const char *path, const char *what)
{
  for (size_t i = 0; i < sizeof readers / sizeof readers[0]; ++i) {
    hap_detail detail = {""};
    hap_status status = readers[i](path, &detail);
    CHECK_SAY(status == HAP_ERROR_IO && strstr(detail.text, what) != NULL &&
                  strstr(detail.text, path) != NULL,
              "reader %zu, %s: %s, \"%s\"", i, path, hap_status_name(status), detail.text);
  }
}

TEST(pipes_sockets_devices_and_folders_are_refused)
{
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  REQUIRE(mkfifo(folder_path("pipe"), 0600) == 0);
  int end = socket(AF_UNIX, SOCK_STREAM, 0);
  snprintf(address.sun_path, sizeof address.sun_path, "%.100s", folder_path("socket"));
  REQUIRE(end >= 0 && bind(end, (struct sockaddr *)&address, sizeof address) == 0);
  all_refuse(folder_path("pipe"), "a pipe");
  all_refuse(folder_path("socket"), "a pipe");
  all_refuse(test_folder, "a folder");
  all_refuse("/dev/zero", "a device");
  REQUIRE(symlink("pipe", folder_path("link")) == 0);
  all_refuse(folder_path("link"), "a pipe");
  int held = open(folder_path("pipe"), O_RDWR); /* also one that somebody holds open */
  REQUIRE(held >= 0);
  all_refuse(folder_path("pipe"), "a pipe");
  close(held);
  close(end);
}

TEST(files_are_opened)
{
  const char *why = "of before";
  char text[8] = "";
  file_write(folder_path("file"), "a\nb\n");
  REQUIRE(symlink("file", folder_path("to_file")) == 0);
  FILE *file = hapi_regular_open(folder_path("to_file"), &why);
  REQUIRE(file != NULL && why == NULL);
  CHECK(fread(text, 1, sizeof text, file) == 4 && strcmp(text, "a\nb\n") == 0);
  CHECK((fcntl(fileno(file), F_GETFD) & FD_CLOEXEC) != 0);
  fclose(file);
  CHECK(hapi_regular_open(folder_path("none"), &why) == NULL);
  CHECK(why != NULL && strcmp(why, "No such file or directory") == 0);
}

SET_UP
{
  return folder_make();
}
