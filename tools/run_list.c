/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_list.h"

#include <stdlib.h>
#include <string.h>

#include "device/device.h"
#include "plugins/haply/websocket.h"
#include "plugins/spidar/serial.h"
#include "scenes/scenes.h"
#include "tools/run_effects.h"

static const char *model_text(hap_model model)
{
  switch (model) {
    case HAP_MODEL_SINGLE:
      return "the world itself is stepped at the haptic rate (paper's Method 1)";
    case HAP_MODEL_IMPULSE:
      return "force on the last known pose, its impulse goes to the world (Method 3)";
    case HAP_MODEL_ACCELERANCE:
      return "testing simulations give A and b to the loop (Method 2)";
    case HAP_MODEL_CONTACT:
      return "the loop simulates what is near with its own contacts (the default)";
  }
  return "";
}

static void print_scene(const scene_parameters *p, FILE *out)
{
  char name[32];
  snprintf(name, sizeof name, "%s%s", p->name, p->count_default > 0 ? "[:N]" : "");
  fprintf(out, "  %-12s %s\n", name, p->text);
  fprintf(out, "%15s", "");
  if (p->count_default > 0) {
    fprintf(out, "N %d, ", p->count_default);
  }
  fprintf(out, "mass %g kg, size %g m, mu %g, gravity %g m/s^2, gap %g m\n", p->mass, p->size,
          p->mu, p->gravity, p->gap);
  fprintf(out, "%15spointer: ", "");
  if (p->tool[0] > 0.0) {
    fprintf(out, "box %g x %g x %g m, rounded by ", p->tool[0], p->tool[1], p->tool[2]);
  }
  fprintf(out, "radius %g m, k %g N/m, d %g N s/m", p->radius, p->stiffness, p->damping);
  if (p->friction > 0.0) {
    fprintf(out, ", friction %g, finger radius %g m", p->friction, p->finger_radius);
  }
  fprintf(out, "\n%15sduration %g s, %d iterations", "", p->duration, p->iterations);
  if (p->hinge_torque > 0.0) {
    fprintf(out, ", hinge friction %g N m", p->hinge_torque);
  }
  fputc('\n', out);
  for (int i = 0; i < p->pointers; ++i) {
    fprintf(out, "%15shand: %s\n", "", p->hands[i]);
  }
}

/* A port may belong to any machine: it is not opened. */
static void print_ports(FILE *out)
{
  char path[HAPI_SPIDAR_PATH_MAX];
  hapi_spidar_identity port;
  int at = 0;
  int count = 0;
  const char *named = getenv("HAPODE_SPIDAR_PORT");
  if (named != NULL && *named != '\0') {
    fprintf(out, "%15smay be on %s, by HAPODE_SPIDAR_PORT\n", "", named);
  }
  for (; hapi_spidar_identity_next(HAPI_SPIDAR_SYSFS, &at, path, sizeof path, &port); ++count) {
    fprintf(out, "%15smay be on %s: %s, %s, socket %s%s%s; not asked\n", "", path,
            port.about[0] != '\0' ? port.about : "USB adapter", port.product, port.place,
            port.serial[0] != '\0' ? ", serial number " : "", port.serial);
  }
  fprintf(out, "%15s%s\n", "",
          count > 0 ? "--list-probe asks, and sends bytes to each of these ports"
                    : "there is no serial port of a USB adapter");
}

/* What a device needs, and what is done about it; nothing of it is loaded or asked. */
static void print_needs(const char *name, FILE *out)
{
  static const struct {
    const char *name;
    const char *needs;
  } known[] = {
      {"haply", "needs the maker's Inverse Service: install it from haply.co, start it"},
      {"forcedimension", "needs libdhd.so.3: install the maker's SDK 3, run ldconfig"},
      {"openhaptics",
       "needs libHD.so.3: install OpenHaptics and the Touch driver, run Touch_Setup"},
  };
  for (size_t i = 0; i < sizeof known / sizeof known[0]; ++i) {
    if (strcmp(known[i].name, name) == 0) {
      fprintf(out, "%15s%s\n", "", known[i].needs);
      fprintf(out, "%15snot asked; --list-probe opens it\n", "");
    }
  }
  if (strcmp(name, "haply") == 0 && !hapi_websocket_is_there()) {
    fprintf(out, "%15sand libwslay, without which hapode was built: install libwslay-dev, build\n",
            "");
  }
}

/* Of hardware, asked: whether it is there, and else why it cannot be used. */
static void print_device(const char *name, const char *text, FILE *out, bool probe)
{
  const hap_device_ops *ops = hapi_registry_find(name, strlen(name));
  hap_device *device = NULL;
  hap_device_info info;
  hap_detail detail = {""};
  fprintf(out, "  %-12s %s\n", name, text != NULL ? text : "");
  if (ops == NULL || ops->pacing == HAP_PACING_VIRTUAL) {
    return;
  }
  if (!probe) {
    if (strcmp(name, "spidar") == 0) {
      print_ports(out);
    }
    print_needs(name, out);
    return;
  }
  if (hap_device_open(name, &device, &detail) < HAP_OK) {
    fprintf(out, "%15snot usable now: %s\n", "", detail.text);
    return;
  }
  (void)hap_device_get_info(device, &info, sizeof info);
  fprintf(out, "%15sthere is one: %s, %g N\n", "", info.name, info.max_force);
  hap_device_close(device);
}

void run_list_print(FILE *out, bool probe)
{
  const scene_parameters *p;
  const char *name;
  const char *text = "";
  fputs("scenes:\n", out);
  for (size_t i = 0; (p = scene_table_at(i)) != NULL; ++i) {
    print_scene(p, out);
  }
  fputs("\nmodels:\n", out);
  for (int i = 0; hap_model_name((hap_model)i) != NULL; ++i) {
    fprintf(out, "  %-12s %s\n", hap_model_name((hap_model)i), model_text((hap_model)i));
  }
  fputs("\ndevices:\n", out);
  for (size_t i = 0; (name = hap_device_name_at(i, &text)) != NULL; ++i) {
    print_device(name, text, out, probe);
  }
  fputs("\neffects (NAME=on, off or auto, which is the default):\n", out);
  run_effects_list(out);
}
