/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The file of an identity, and a device that takes one over. */

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>

#include "base/def.h"
#include "base/key_file.h"
#include "base/log.h"
#include "base/number.h"
#include "base/regular.h"
#include "device/device.h"
#include "device/identify.h"

#define VERSION 1.0

static const hap_device_identity nobody = {.cookie = 0x48444931u};
static const hapi_def_type identity_type = HAPI_DEF_TYPE(hap_device_identity, nobody);

typedef struct figure {
  const char *key;
  size_t offset;
  double most;
  const char *about;
} figure;

static const figure figures[] = {
    {"mass", offsetof(hap_device_identity, mass), 1e4, "kg"},
    {"damping", offsetof(hap_device_identity, damping), 1e6, "N s/m"},
    {"friction", offsetof(hap_device_identity, friction), 1e6, "N"},
    {"delay", offsetof(hap_device_identity, delay), 1.0, "s"},
    {"quantum", offsetof(hap_device_identity, quantum), 1.0, "m"},
    {"residual", offsetof(hap_device_identity, residual), 1.0,
     "share of the force that the others do not explain"},
};

#define FIGURES (sizeof figures / sizeof figures[0])

static double *value_of(hap_device_identity *identity, size_t index)
{
  return (double *)((void *)((char *)identity + figures[index].offset));
}

void hap_device_identity_init(hap_device_identity *identity, size_t size_of_identity)
{
  hapi_def_init(&identity_type, identity, size_of_identity);
}

/* The caller's identity as this build's, its values checked. */
static hap_status identity_read(const hap_device_identity *given, hap_device_identity *out,
                                hap_detail *detail)
{
  HAPI_TRY(hapi_def_read(&identity_type, given, out, detail));
  out->device[sizeof out->device - 1] = '\0';
  for (size_t i = 0; i < FIGURES; ++i) {
    const hapi_number_rule rule = {
        figures[i].key, *value_of(out, i), 0.0, figures[i].most, NULL, 0.0};
    HAPI_TRY(hapi_numbers_check(&rule, 1, detail));
  }
  return HAP_OK;
}

hap_status hapi_device_identity_give(const hap_device_identity *identity, hap_device_identity *out,
                                     hap_detail *detail)
{
  return hapi_def_write(&identity_type, identity, out, detail);
}

/* ---- reading ---- */

typedef struct reader {
  hapi_key_file file;
  bool known[FIGURES];
  bool named;
  bool versioned;
  hap_device_identity identity;
} reader;

static bool number_of(const char *value, double *out)
{
  const char *end = hapi_number_read(value, out);
  return end != NULL && *end == '\0';
}

static hap_status take_version(reader *r, const char *value)
{
  double version = 0.0;
  if (!number_of(value, &version)) {
    return hapi_key_file_fail(&r->file, "version: expected a number, not ", value);
  }
  if (version != VERSION) {
    return hapi_key_file_fail(&r->file, "this library reads version 1, not ", value);
  }
  r->versioned = true;
  return HAP_OK;
}

static hap_status take_name(reader *r, const char *value)
{
  if (r->named) {
    return hapi_key_file_fail(&r->file, "given twice: ", "device");
  }
  if (*value == '\0' || strlen(value) >= sizeof r->identity.device) {
    return hapi_key_file_fail(&r->file, "device: expected a name of 1 to 63 characters, not ",
                              value);
  }
  snprintf(r->identity.device, sizeof r->identity.device, "%s", value);
  r->named = true;
  return HAP_OK;
}

static hap_status take_figure(reader *r, const char *key, const char *value)
{
  size_t i = 0;
  while (i < FIGURES && strcmp(key, figures[i].key) != 0) {
    ++i;
  }
  if (i == FIGURES) {
    return hapi_key_file_fail(
        &r->file,
        "known are version, device, mass, damping, friction, delay, quantum and "
        "residual, not ",
        key);
  }
  if (r->known[i]) {
    return hapi_key_file_fail(&r->file, "given twice: ", key);
  }
  double number = 0.0;
  if (!number_of(value, &number) || number < 0.0 || number > figures[i].most) {
    return hapi_fail(r->file.detail, HAP_ERROR_FORMAT,
                     "%.200s, line %lu: %s: expected a number from 0 to %g, not %.60s",
                     r->file.path, r->file.line, key, figures[i].most, value);
  }
  r->known[i] = true;
  *value_of(&r->identity, i) = number;
  return HAP_OK;
}

static hap_status take_line(void *self, const hapi_key_file *file, char *key, char *value)
{
  reader *r = self;
  bool name = strcmp(key, "device") == 0;
  if (!name) { /* which may have a '#' */
    hapi_key_file_uncomment(value);
  }
  if (strcmp(key, "version") == 0 && !r->versioned) {
    return take_version(r, value);
  }
  if (!r->versioned) {
    return hapi_key_file_fail(file, "expected version = 1 before all else, not ", key);
  }
  return name ? take_name(r, value) : take_figure(r, key, value);
}

static hap_status check_complete(const reader *r)
{
  const char *missing = r->named ? NULL : "device";
  for (size_t i = 0; i < FIGURES && missing == NULL; ++i) {
    missing = r->known[i] ? NULL : figures[i].key;
  }
  return missing == NULL ? HAP_OK : hapi_key_file_lacks(&r->file, "", missing);
}

hap_status hap_device_identity_read(const char *path, hap_device_identity *out, hap_detail *detail)
{
  if (path == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "the path of the identity is NULL");
  }
  reader r = {.file = {.path = path, .detail = detail}};
  HAPI_TRY(hapi_key_file_read(&r.file, take_line, &r));
  HAPI_TRY(check_complete(&r));
  return hapi_device_identity_give(&r.identity, out, detail);
}

/* ---- writing ---- */

static bool name_fits_a_line(const char *name)
{
  bool good = *name != '\0' && *name != ' ' && name[strlen(name) - 1] != ' ';
  for (; *name != '\0'; ++name) {
    good = good && (unsigned char)*name >= ' ';
  }
  return good;
}

hap_status hap_device_identity_write(const char *path, const hap_device_identity *identity,
                                     hap_detail *detail)
{
  hap_device_identity known;
  HAPI_TRY(identity_read(identity, &known, detail));
  if (path == NULL || !name_fits_a_line(known.device)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "the path is NULL, or the device's name is not one line of text");
  }
  const char *why;
  FILE *file = hapi_regular_create_stream(path, O_TRUNC, &why);
  if (file == NULL) {
    return hapi_fail(detail, HAP_ERROR_IO, "%.200s: cannot be opened: %s", path, why);
  }
  fprintf(file, "# hapode: what an identification found out about a device\nversion = 1\n");
  fprintf(file, "device = %s\n", known.device);
  for (size_t i = 0; i < FIGURES; ++i) {
    char number[32];
    hapi_number_write(number, sizeof number, *value_of(&known, i));
    fprintf(file, "%s = %s # %s\n", figures[i].key, number, figures[i].about);
  }
  bool good = ferror(file) == 0;
  good = fclose(file) == 0 && good;
  return good ? HAP_OK
              : hapi_fail(detail, HAP_ERROR_IO, "%.200s: cannot be written: %s", path,
                          strerror(errno));
}

/* ---- use ---- */

hap_status hap_device_set_identity(hap_device *device, const hap_device_identity *identity,
                                   hap_detail *detail)
{
  hap_device_identity known;
  if (device == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "hap_device_set_identity: device is NULL");
  }
  HAPI_TRY(identity_read(identity, &known, detail));
  if (strcmp(known.device, hapi_device_info(device)->name) != 0) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "the identity is that of '%s', the device is '%s'",
                     known.device, hapi_device_info(device)->name);
  }
  if (!hapi_device_claim(device)) {
    return hapi_fail(detail, HAP_ERROR_STATE, "a pointer has the device: set its identity before");
  }
  hap_device_info *info = &device->effectors[0].info;
  info->mass = known.mass;
  info->damping = known.damping;
  info->friction = known.friction;
  info->delay = known.delay;
  if (known.quantum > 0.0) {
    info->quantum = known.quantum;
  }
  hapi_device_release(device);
  return HAP_OK;
}
