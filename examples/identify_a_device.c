/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdio.h>

/* Called ten times a second: what a program would show, and where it would ask for a way out. */
static int progress_note(void *user, double done)
{
  *(double *)user = done;
  return 0; /* go on */
}

/* Measures the device, which nobody holds, and keeps the figures in a file. */
static hap_status figures_measure(hap_device *device, const char *path, double *done,
                                  hap_detail *why)
{
  hap_identify_def how;
  hap_device_identity found;
  hap_identify_def_init(&how, sizeof how);
  how.max_force = 2; /* N; and 50 mm, 0.5 m/s by default */
  how.watch = progress_note, how.user = done;
  hap_device_identity_init(&found, sizeof found);
  hap_status status = hap_device_identify(device, &how, &found, why);
  return status == HAP_OK ? hap_device_identity_write(path, &found, why) : status;
}

/* Later, in another run: the device has the figures of the file. */
static hap_status figures_set(hap_device *device, const char *path, hap_detail *why)
{
  hap_device_identity kept;
  hap_device_identity_init(&kept, sizeof kept);
  hap_status status = hap_device_identity_read(path, &kept, why);
  return status == HAP_OK ? hap_device_set_identity(device, &kept, why) : status;
}

static void figures_print(const hap_device *device, const char *when)
{
  hap_device_info info;
  if (hap_device_get_info(device, &info, sizeof info) == HAP_OK) {
    printf("%s: %.3f kg, %.2f N s/m, %.2f N\n", when, info.mass, info.damping, info.friction);
  }
}

int main(int argc, char **argv)
{
  /* A mechanism that is simulated, and knows less of itself than is true. */
  const char *real = "virtual:hand=none,device_mass=0.3,device_damping=1,friction=0.2";
  const char *path = argc > 1 ? argv[1] : "hand.txt";
  double done = 0;
  hap_detail why = {""};
  hap_device *device, *other;
  if (hap_device_open(real, &device, &why) < HAP_OK ||
      hap_device_open("virtual", &other, &why) < HAP_OK ||
      figures_measure(device, path, &done, &why) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  printf("last told at %.0f %%\n", 100 * done);
  figures_print(other, "before");
  if (figures_set(other, path, &why) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  figures_print(other, "as measured");
  hap_device_close(other);
  hap_device_close(device);
  return 0;
}
