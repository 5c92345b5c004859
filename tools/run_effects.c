/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_effects.h"

#include <string.h>

typedef struct effect {
  const char *name;
  const char *text;
  unsigned models;   /* that have it: bits by hap_model */
  unsigned autos;    /* that have it where a scene calls for it */
  unsigned switched; /* that can be told */
} effect;

#define BIT(model) (1u << (model))
#define CONTACT BIT(HAP_MODEL_CONTACT)
#define EVERY \
  (BIT(HAP_MODEL_SINGLE) | BIT(HAP_MODEL_IMPULSE) | BIT(HAP_MODEL_ACCELERANCE) | CONTACT)

static const effect effects[RUN_EFFECTS] = {
    {"testing", "testing simulations", BIT(HAP_MODEL_ACCELERANCE), CONTACT, 0},
    {"cross", "cross accelerance between local bodies", 0, 0, BIT(HAP_MODEL_ACCELERANCE)},
    {"contacts", "contacts between bodies in the loop", CONTACT, 0, 0},
    {"passes", "contact passes between syncs", CONTACT, 0, 0},
    {"joints", "joints in the loop", CONTACT, 0, 0},
    {"range", "local range beyond the neighbours", CONTACT, 0, 0},
    {"restitution", "restitution in the loop", CONTACT, 0, 0},
    {"friction", "friction on the pointer (--friction)", 0, EVERY, EVERY},
    {"torque", "torque on a pointer that is a tool", 0, EVERY, 0},
    {"gyro", "gyroscopic term in the loop", CONTACT, 0, 0},
    {"shape", "shape at every tick instead of a plane", CONTACT, 0, CONTACT},
    {"proxy", "coupling by a proxy (--coupling)", 0, CONTACT, CONTACT},
    {"observer", "energy observer", EVERY, 0, 0},
    {"recording", "recording for a replay bit for bit (--record)", 0, 0, EVERY},
};

static const char *const wishes[] = {"auto", "off", "on"};

static hap_status refuse(const char *item, size_t length, hap_detail *detail)
{
  int shown = length < 60 ? (int)length : 60;
  int used = snprintf(detail->text, sizeof detail->text,
                      "\"%.*s\" is not NAME=on, NAME=off or NAME=auto; names:", shown, item);
  for (size_t i = 0; i < RUN_EFFECTS && used < (int)sizeof detail->text; ++i) {
    used +=
        snprintf(detail->text + used, sizeof detail->text - (size_t)used, " %s", effects[i].name);
  }
  return HAP_ERROR_ARGUMENT;
}

static bool is_word(const char *text, size_t length, const char *word)
{
  return strlen(word) == length && memcmp(text, word, length) == 0;
}

static bool take_item(const char *item, size_t length, run_effects *io)
{
  const char *equals = memchr(item, '=', length);
  size_t name_length = equals != NULL ? (size_t)(equals - item) : length;
  if (equals == NULL) {
    return false;
  }
  for (size_t i = 0; i < RUN_EFFECTS; ++i) {
    for (size_t k = 0; k < sizeof wishes / sizeof wishes[0]; ++k) {
      if (is_word(item, name_length, effects[i].name) &&
          is_word(equals + 1, length - name_length - 1, wishes[k])) {
        io->wish[i] = (run_effect_wish)k;
        return true;
      }
    }
  }
  return false;
}

hap_status run_effects_parse(const char *list, run_effects *io, hap_detail *detail)
{
  for (;;) {
    size_t length = strcspn(list, ",");
    if (!take_item(list, length, io)) {
      return refuse(list, length, detail);
    }
    if (list[length] == '\0') {
      return HAP_OK;
    }
    list += length + 1;
  }
}

static bool has(hap_model model, const effect *e)
{
  return (e->models & BIT(model)) != 0;
}

hap_status run_effects_check(const run_effects *wanted, hap_model model, hap_detail *detail)
{
  for (size_t i = 0; i < RUN_EFFECTS; ++i) {
    bool on = has(model, &effects[i]);
    bool switched = (effects[i].switched & BIT(model)) != 0;
    bool maybe = (effects[i].autos & BIT(model)) != 0;
    bool other = wanted->wish[i] == (on ? RUN_EFFECT_OFF : RUN_EFFECT_ON) ||
                 (maybe && wanted->wish[i] != RUN_EFFECT_AUTO);
    if (other && !switched) {
      snprintf(detail->text, sizeof detail->text,
               "%s=%s is not supported in this version: model %s always runs %s: %s",
               effects[i].name, wishes[wanted->wish[i]], hap_model_name(model),
               maybe ? "with it where a scene calls for it"
               : on  ? "with it"
                     : "without it",
               effects[i].text);
      return HAP_ERROR_UNSUPPORTED;
    }
  }
  return HAP_OK;
}

static const char *state_of(const run_effects *wanted, hap_model model, size_t index)
{
  const effect *e = &effects[index];
  if ((e->switched & BIT(model)) != 0 && wanted->wish[index] != RUN_EFFECT_AUTO) {
    return wishes[wanted->wish[index]];
  }
  return (e->autos & BIT(model)) != 0 ? "auto" : has(model, e) ? "on" : "off";
}

run_effect_wish *run_effects_wish(run_effects *wanted, const char *name)
{
  size_t i = 0;
  while (i + 1 < RUN_EFFECTS && strcmp(effects[i].name, name) != 0) {
    ++i;
  }
  return &wanted->wish[i];
}

void run_effects_apply(const run_effects *wanted, hap_session_def *io)
{
  for (size_t i = 0; i < RUN_EFFECTS; ++i) {
    if (strcmp(effects[i].name, "shape") == 0 && wanted->wish[i] == RUN_EFFECT_OFF) {
      io->plane = HAP_PLANE_ALWAYS;
    }
    if (strcmp(effects[i].name, "cross") == 0 && wanted->wish[i] == RUN_EFFECT_ON) {
      io->cross = HAP_CROSS_ON;
    }
  }
}

void run_effects_print(const run_effects *wanted, hap_model model, FILE *out)
{
  for (size_t i = 0; i < RUN_EFFECTS; ++i) {
    fprintf(out, "%s%s=%s", i > 0 ? "," : "", effects[i].name, state_of(wanted, model, i));
  }
}

static void list_models(size_t index, FILE *out)
{
  static const run_effects none;
  const effect *e = &effects[index];
  const char *between = "";
  for (int m = 0; hap_model_name((hap_model)m) != NULL; ++m) {
    const char *state = state_of(&none, (hap_model)m, index);
    bool switched = (e->switched & BIT(m)) != 0;
    if (switched || strcmp(state, "off") != 0) {
      fprintf(out, "%s%s %s%s", between, hap_model_name((hap_model)m), state,
              switched ? " or as told" : "");
      between = ", ";
    }
  }
  fputs(*between == '\0' ? "in no model" : "", out);
}

void run_effects_list(FILE *out)
{
  for (size_t i = 0; i < RUN_EFFECTS; ++i) {
    fprintf(out, "  %-12s %s\n%15s", effects[i].name, effects[i].text, "");
    list_models(i, out);
    fputc('\n', out);
  }
}
