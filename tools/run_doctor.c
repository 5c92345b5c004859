/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_doctor.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <hapode/hapode.h>

#include "tools/doctor.h"

static const char *state_name(doctor_state state)
{
  switch (state) {
    case DOCTOR_OK:
      return "ok";
    case DOCTOR_WARNING:
      return "warning";
    case DOCTOR_PROBLEM:
      return "problem";
  }
  return "";
}

void doctor_say(doctor_check *check, doctor_state state, const char *format, ...)
{
  va_list list;
  va_start(list, format);
  check->state = state;
  (void)vsnprintf(check->text, sizeof check->text, format, list);
  va_end(list);
}

void doctor_todo(doctor_check *check, const char *text)
{
  snprintf(check->todo, sizeof check->todo, "%s", text);
}

/* Appends to the text of a check; what has no room is left out. */
void doctor_append(doctor_check *check, const char *before, const char *text)
{
  size_t used = strlen(check->text);
  snprintf(check->text + used, sizeof check->text - used, "%s%s", before, text);
}

static FILE *place_open(const doctor_place *place, const char *path)
{
  char whole[4096];
  snprintf(whole, sizeof whole, "%s%s", place->root, path);
  return fopen(whole, "re");
}

/* The first line of a small file, without its end; false: there is none. */
bool doctor_line(const doctor_place *place, const char *path, char *out, size_t size)
{
  FILE *file = place_open(place, path);
  bool good = file != NULL && fgets(out, (int)size, file) != NULL;
  if (file != NULL) {
    fclose(file);
  }
  if (good) {
    out[strcspn(out, "\n")] = '\0';
  }
  return good;
}

/* The rest of the line of a file that begins so. */
bool doctor_field(const doctor_place *place, const char *path, const char *name, char *out,
                  size_t size)
{
  FILE *file = place_open(place, path);
  char line[1024];
  bool found = false;
  while (file != NULL && !found && fgets(line, sizeof line, file) != NULL) {
    found = strncmp(line, name, strlen(name)) == 0;
  }
  if (file != NULL) {
    fclose(file);
  }
  if (found) {
    line[strcspn(line, "\n")] = '\0';
    snprintf(out, size, "%s", line + strlen(name));
  }
  return found;
}

DIR *doctor_folder(const doctor_place *place, const char *path)
{
  char whole[4096];
  snprintf(whole, sizeof whole, "%s%s", place->root, path);
  return opendir(whole);
}

bool doctor_is_root(const doctor_place *place)
{
  char uid[64];
  char *end = uid;
  /* real, then effective */
  if (!doctor_field(place, "/proc/self/status", "Uid:", uid, sizeof uid)) {
    return false;
  }
  (void)strtol(uid, &end, 10);
  return strtol(end, NULL, 10) == 0;
}

/* Bytes of a sequence of UTF-8 that is whole and shortest, else 0. */
static int utf8_length(const unsigned char *at)
{
  static const unsigned least[5] = {0, 0, 0x80, 0x800, 0x10000};
  int length = at[0] < 0x80                    ? 1
               : at[0] >= 0xc2 && at[0] < 0xe0 ? 2
               : at[0] < 0xc2                  ? 0
               : at[0] < 0xf0                  ? 3
               : at[0] < 0xf5                  ? 4
                                               : 0;
  unsigned value = length > 1 ? at[0] & (0xffu >> (length + 1)) : 0;
  for (int i = 1; i < length; ++i) {
    if ((at[i] & 0xc0) != 0x80) {
      return 0;
    }
    value = value << 6 | (at[i] & 0x3f);
  }
  bool good = length < 2 ||
              (value >= least[length] && value <= 0x10ffff && (value < 0xd800 || value > 0xdfff));
  return good ? length : 0;
}

static void json_text(FILE *out, const char *text)
{
  const unsigned char *at = (const unsigned char *)text;
  fputc('"', out);
  while (*at != '\0') {
    int length = utf8_length(at);
    if (length == 0) {
      fputc('?', out);
    } else if (*at < 0x20 || *at == 0x7f) {
      fprintf(out, "\\u%04x", *at);
    } else if (*at == '"' || *at == '\\') {
      fprintf(out, "\\%c", *at);
    } else {
      (void)fwrite(at, 1, (size_t)length, out);
    }
    at += length > 0 ? length : 1;
  }
  fputc('"', out);
}

static void check_print_json(FILE *out, const char *key, const doctor_check *check)
{
  fprintf(out, "{\"key\": \"%s\", \"state\": \"%s\", \"text\": ", key, state_name(check->state));
  json_text(out, check->text);
  fputs(", \"type\": ", out);
  json_text(out, check->todo);
  if (check->measured) {
    fprintf(out, ", \"p50_us\": %.1f, \"p999_us\": %.1f", check->p50_us, check->p999_us);
  }
  fputc('}', out);
}

static void check_print(FILE *out, const char *key, const doctor_check *check)
{
  fprintf(out, "%-16s %-8s ", key, state_name(check->state));
  for (const char *at = check->text; *at != '\0'; ++at) { /* a terminal obeys control bytes */
    fputc((unsigned char)*at < 0x20 || *at == 0x7f ? '?' : *at, out);
  }
  fputc('\n', out);
  if (check->todo[0] != '\0') {
    fprintf(out, "%25s type: %s\n", "", check->todo);
  }
}

bool run_doctor(FILE *out, const char *root, bool json)
{
  static const struct {
    const char *key;
    void (*look)(const doctor_place *place, doctor_check *check);
  } checks[] = {{"kernel", doctor_check_kernel},    {"rtprio", doctor_check_rtprio},
                {"memlock", doctor_check_memlock},  {"memory_lock", doctor_check_memory_lock},
                {"latency", doctor_check_latency},  {"ode", doctor_check_ode},
                {"devices", doctor_check_devices},  {"vendor_libraries", doctor_check_vendors},
                {"udev_rules", doctor_check_rules}, {"groups", doctor_check_groups},
                {"ports", doctor_check_ports},      {"locale", doctor_check_locale},
                {"governor", doctor_check_governor}};
  doctor_place place = {root};
  doctor_state worst = DOCTOR_OK;
  if (json) {
    fprintf(out, "{\"version\": \"%s\", \"checks\": [", hap_version());
  }
  for (size_t i = 0; i < sizeof checks / sizeof checks[0]; ++i) {
    doctor_check check = {0};
    checks[i].look(&place, &check);
    worst = check.state > worst ? check.state : worst;
    if (json) {
      fputs(i > 0 ? ",\n" : "\n", out);
      check_print_json(out, checks[i].key, &check);
    } else {
      check_print(out, checks[i].key, &check);
    }
  }
  if (json) {
    fprintf(out, "],\n\"state\": \"%s\"}\n", state_name(worst));
  }
  return worst != DOCTOR_PROBLEM;
}
