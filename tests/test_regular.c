/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Every reader and writer of a file refuses what is none, at once and in words: a pipe would hang
 * it. A hang is a time-out of this test. */

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
#include "plugins/spidar/model.h"

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

/* ---- writers ---- */

static hap_status identity_write(const char *path, hap_detail *detail)
{
  hap_device_identity identity;
  hap_device_identity_init(&identity, sizeof identity);
  snprintf(identity.device, sizeof identity.device, "some");
  return hap_device_identity_write(path, &identity, detail);
}

static hap_status stream_write(const char *path, hap_detail *detail)
{
  const char *why = "of before";
  FILE *stream = hapi_regular_create_stream(path, O_TRUNC, &why);
  CHECK((stream != NULL) == (why == NULL));
  snprintf(detail->text, sizeof detail->text, "%s: %s", path, stream == NULL ? why : "");
  bool good = stream != NULL && fputs("b\n", stream) >= 0;
  good = stream != NULL && fclose(stream) == 0 && good;
  return good ? HAP_OK : HAP_ERROR_IO;
}

static hap_status (*const writers[])(const char *path, hap_detail *detail) = {identity_write,
                                                                              stream_write};

static void writers_refuse(const char *path, const char *what)
{
  for (size_t i = 0; i < sizeof writers / sizeof writers[0]; ++i) {
    hap_detail detail = {""};
    hap_status status = writers[i](path, &detail);
    CHECK_SAY(status == HAP_ERROR_IO && strstr(detail.text, what) != NULL &&
                  strstr(detail.text, path) != NULL,
              "writer %zu, %s: %s, \"%s\"", i, path, hap_status_name(status), detail.text);
  }
}

TEST(nothing_is_written_to_pipes_sockets_devices_and_folders)
{
  char beside[300];
  hap_detail detail = {""};
  writers_refuse(folder_path("pipe"), "a pipe");
  writers_refuse(folder_path("socket"), "a pipe");
  writers_refuse(folder_path("link"), "a pipe");
  writers_refuse(test_folder, "a folder");
  writers_refuse("/dev/zero", "a device");
  writers_refuse("/dev/ptmx", "a device");
  writers_refuse(folder_path("no/file"), "No such file");
  int held = open(folder_path("pipe"), O_RDWR);
  REQUIRE(held >= 0);
  writers_refuse(folder_path("pipe"), "a pipe"); /* its reader may stop */
  close(held);
  snprintf(beside, sizeof beside, "%s.new", folder_path("geometry"));
  REQUIRE(mkfifo(beside, 0600) == 0); /* where a geometry is written first */
  CHECK(hapi_spidar_model_write(folder_path("geometry"), hapi_spidar_model_find("x4r"), &detail) ==
        HAP_ERROR_IO);
  CHECK(strstr(detail.text, "a pipe") != NULL);
}

TEST(files_are_written)
{
  hap_detail detail = {""};
  const char *why = "of before";
  char text[8] = "";
  file_write(folder_path("written"), "what was there before\n");
  REQUIRE(symlink("written", folder_path("to_written")) == 0);
  CHECK(stream_write(folder_path("to_written"), &detail) == HAP_OK);
  int file = hapi_regular_create(folder_path("written"), O_APPEND, &why);
  REQUIRE(file >= 0 && why == NULL);
  CHECK((fcntl(file, F_GETFD) & FD_CLOEXEC) != 0);
  CHECK((fcntl(file, F_GETFL) & (O_NONBLOCK | O_APPEND)) == O_APPEND);
  CHECK(write(file, "c\n", 2) == 2);
  close(file);
  FILE *stream = fopen(folder_path("written"), "r");
  REQUIRE(stream != NULL);
  CHECK(fread(text, 1, sizeof text, stream) == 4 && memcmp(text, "b\nc\n", 4) == 0);
  fclose(stream);
  CHECK(stream_write("/dev/null", &detail) == HAP_OK);
}

/* A pipe too, where the program writes to it anyway. */
TEST(standard_output_may_be_named)
{
  int ends[2];
  char text[8] = "";
  hap_detail detail = {""};
  fflush(stdout);
  int before = dup(STDOUT_FILENO);
  REQUIRE(before >= 0 && pipe(ends) == 0);
  REQUIRE(dup2(ends[1], STDOUT_FILENO) >= 0);
  hap_status status = stream_write("/dev/stdout", &detail);
  REQUIRE(dup2(before, STDOUT_FILENO) >= 0);
  close(before);
  close(ends[1]);
  CHECK_SAY(status == HAP_OK, "%s", detail.text);
  CHECK(read(ends[0], text, sizeof text) == 2 && memcmp(text, "b\n", 2) == 0);
  close(ends[0]);
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
