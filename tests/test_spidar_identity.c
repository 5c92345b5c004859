/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Which adapter a port is, by a sysfs of a test's own. */

#include "tests/files.h"
#include "tests/tap.h"

#include <sys/stat.h>
#include <unistd.h>

#include "plugins/spidar/identity.h"

#define SIZE 64

/* A whole path below the folder of the test. */
static const char *sysfs_path(const char *path)
{
  static char whole[4][800];
  static int next;
  next = (next + 1) % 4;
  snprintf(whole[next], sizeof whole[next], "%s/%s", test_folder, path);
  return whole[next];
}

static void file_put(const char *folder, const char *name, const char *text)
{
  char path[400];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  file_write(sysfs_path(path), text);
}

static void folder_put(const char *path)
{
  REQUIRE(mkdir(sysfs_path(path), 0700) == 0 || access(sysfs_path(path), F_OK) == 0);
}

/* An FTDI adapter as the kernel shows it: the port, in the interface, in the device. */
static void adapter_put(const char *root, const char *name, const char *place, const char *product,
                        const char *serial)
{
  char path[300];
  char device[120];
  const char *const folders[] = {"", "/class", "/class/tty", "/devices"};
  for (int i = 0; i < 4; ++i) {
    snprintf(path, sizeof path, "%s%s", root, folders[i]);
    folder_put(path);
  }
  snprintf(device, sizeof device, "%s/devices/1-%s", root, place);
  folder_put(device);
  file_put(device, "idVendor", "0403\n");
  file_put(device, "idProduct", product);
  file_put(device, "busnum", "1\n");
  file_put(device, "devpath", place);
  file_put(device, "product", "FT232R USB UART\n");
  if (serial != NULL) {
    file_put(device, "serial", serial);
  }
  snprintf(path, sizeof path, "%s/1-%s:1.0", device, place);
  folder_put(path);
  file_put(path, "bInterfaceNumber", "00\n");
  snprintf(path, sizeof path, "%s/1-%s:1.0/%s", device, place, name);
  folder_put(path);
  char link[200];
  char target[200];
  snprintf(link, sizeof link, "%s/class/tty/%s", root, name);
  folder_put(link);
  snprintf(link, sizeof link, "%s/class/tty/%s/device", root, name);
  snprintf(target, sizeof target, "../../../devices/1-%s/1-%s:1.0/%s", place, place, name);
  (void)unlink(sysfs_path(link));
  REQUIRE(symlink(target, sysfs_path(link)) == 0);
}

static hapi_spidar_identity identity_in(const char *root, const char *name)
{
  hapi_spidar_identity identity;
  hapi_spidar_identity_of(sysfs_path(root), name, &identity);
  return identity;
}

TEST(an_adapter_is_known_by_what_sysfs_says)
{
  adapter_put("one", "ttyUSB0", "2.4", "6001\n", "A5XK3RJT\n");
  hapi_spidar_identity identity = identity_in("one", "ttyUSB0");
  CHECK(identity.usb && strcmp(identity.product, "0403:6001") == 0);
  CHECK(strcmp(identity.serial, "A5XK3RJT") == 0 && strcmp(identity.place, "1-2.4") == 0);
  CHECK(strcmp(identity.interface, "00") == 0 && strcmp(identity.about, "FT232R USB UART") == 0);
  CHECK(!identity_in("one", "ttyUSB1").usb && !identity_in("one", "ttyS0").usb);
  hapi_spidar_identity_at(sysfs_path("one"), "/dev/null", &identity);
  CHECK(!identity.usb);
}

static bool found_as(const char *root, const hapi_spidar_identity *identity, const char *path)
{
  char out[SIZE] = "";
  bool found = hapi_spidar_identity_find(sysfs_path(root), identity, out, sizeof out);
  return path != NULL ? found && strcmp(out, path) == 0 : !found;
}

TEST(an_adapter_is_found_under_its_new_name)
{
  adapter_put("before", "ttyUSB0", "2", "6001\n", "A1\n");
  hapi_spidar_identity identity = identity_in("before", "ttyUSB0");
  adapter_put("renamed", "ttyUSB0", "3", "6001\n", "B2\n"); /* another one has its name */
  CHECK(found_as("renamed", &identity, NULL));
  adapter_put("renamed", "ttyUSB12", "2", "6001\n", "A1\n");
  CHECK(found_as("renamed", &identity, "/dev/ttyUSB12"));
  adapter_put("moved", "ttyUSB3", "4", "6001\n", "A1\n"); /* in another socket */
  CHECK(found_as("moved", &identity, "/dev/ttyUSB3"));
  adapter_put("moved", "ttyUSB4", "5", "6001\n", "A1\n"); /* two with the same number */
  CHECK(found_as("moved", &identity, NULL));
  adapter_put("moved", "ttyUSB5", "2", "6001\n", "A1\n"); /* and one in its socket */
  CHECK(found_as("moved", &identity, "/dev/ttyUSB5"));
  adapter_put("other", "ttyUSB0", "2", "6015\n", "A1\n"); /* another product */
  CHECK(found_as("other", &identity, NULL));
}

TEST(an_adapter_without_a_number_is_known_by_its_socket_alone)
{
  adapter_put("plain", "ttyUSB0", "2", "6001\n", NULL);
  hapi_spidar_identity identity = identity_in("plain", "ttyUSB0");
  CHECK(found_as("plain", &identity, "/dev/ttyUSB0"));
  adapter_put("plain2", "ttyUSB0", "3", "6001\n", NULL);
  CHECK(found_as("plain2", &identity, NULL));
  adapter_put("plain2", "ttyUSB1", "2", "6001\n", "A1\n"); /* that one has a number */
  CHECK(found_as("plain2", &identity, NULL));
  const hapi_spidar_identity none = {.usb = false};
  CHECK(found_as("plain", &none, NULL));
}

TEST(the_ports_are_listed)
{
  char path[SIZE];
  hapi_spidar_identity found;
  int at = 0;
  adapter_put("list", "ttyACM0", "3", "6015\n", "B2\n");
  adapter_put("list", "ttyUSB9", "2", "6001\n", "A1\n");
  adapter_put("list", "ttyUSB15", "4", "6001\n", NULL);
  const char *const wanted[] = {"/dev/ttyUSB9", "/dev/ttyUSB15", "/dev/ttyACM0"};
  for (int i = 0; i < 3; ++i) {
    CHECK(hapi_spidar_identity_next(sysfs_path("list"), &at, path, sizeof path, &found) &&
          strcmp(path, wanted[i]) == 0 && found.usb);
  }
  CHECK(!hapi_spidar_identity_next(sysfs_path("list"), &at, path, sizeof path, &found));
}

SET_UP
{
  return folder_make();
}
