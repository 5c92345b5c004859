/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_effects.h"

#include <math.h>
#include <string.h>

#include "tools/session_defs.h"

static hap_status item_refuse(const char *item, size_t length, hap_detail *detail)
{
  int shown = length < 60 ? (int)length : 60;
  int used = snprintf(detail->text, sizeof detail->text,
                      "\"%.*s\" is not NAME=on, NAME=off or NAME=auto; names: all", shown, item);
  for (int i = 0; i < HAP_EFFECTS && used < (int)sizeof detail->text; ++i) {
    used += snprintf(detail->text + used, sizeof detail->text - (size_t)used, " %s",
                     hap_effect_name((hap_effect)i));
  }
  return HAP_ERROR_ARGUMENT;
}

static bool is_word(const char *text, size_t length, const char *word)
{
  return word != NULL && strlen(word) == length && memcmp(text, word, length) == 0;
}

static bool find_wish(const char *text, size_t length, hap_effect_wish *out)
{
  for (int i = 0; hap_effect_wish_name((hap_effect_wish)i) != NULL; ++i) {
    if (is_word(text, length, hap_effect_wish_name((hap_effect_wish)i))) {
      *out = (hap_effect_wish)i;
      return true;
    }
  }
  return false;
}

static bool take_item(const char *item, size_t length, run_effects *io)
{
  const char *equals = memchr(item, '=', length);
  hap_effect_wish wish;
  if (equals == NULL || !find_wish(equals + 1, length - (size_t)(equals - item) - 1, &wish)) {
    return false;
  }
  size_t name_length = (size_t)(equals - item);
  bool all = is_word(item, name_length, "all");
  bool found = all;
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    if (all || is_word(item, name_length, hap_effect_name((hap_effect)i))) {
      io->wish[i] = wish;
      io->of_all[i] = all;
      found = true;
    }
  }
  return found;
}

hap_status run_effects_parse(const char *list, run_effects *io, hap_detail *detail)
{
  for (;;) {
    size_t length = strcspn(list, ",");
    if (!take_item(list, length, io)) {
      return item_refuse(list, length, detail);
    }
    if (list[length] == '\0') {
      return HAP_OK;
    }
    list += length + 1;
  }
}

hap_status run_effects_apply(const run_effects *wanted, hap_model model, hap_expert_def *io,
                             hap_detail *detail)
{
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    hap_status status = hap_effect_check((hap_effect)i, wanted->wish[i], model, detail);
    if (status < HAP_OK && !wanted->of_all[i]) {
      return status;
    }
    expert_wish(io, (hap_effect)i, status < HAP_OK ? HAP_EFFECT_AUTO : wanted->wish[i]);
  }
  return HAP_OK;
}

static const char *state_name(uint32_t state)
{
  return state == HAP_EFFECT_IS_ON ? "on" : state == HAP_EFFECT_IS_PARTLY ? "partly" : "off";
}

void run_effects_print(const hap_effect_info effects[HAP_EFFECTS], FILE *out)
{
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    fprintf(out, "%s%s=%s", i > 0 ? "," : "", hap_effect_name((hap_effect)i),
            state_name(effects[i].state));
  }
}

static void print_time(double value, FILE *out)
{
  if (isnan(value)) {
    fprintf(out, " %9s", "-");
  } else {
    fprintf(out, " %9.4f", value);
  }
}

void run_effects_table(const hap_effect_info effects[HAP_EFFECTS], FILE *out)
{
  fprintf(out, "%-12s %-5s %-7s %9s %9s %9s %9s  %s\n", "effect", "wish", "state", "on/of",
          "tick_us", "physics_ms", "pass_us", "reason");
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    const hap_effect_info *e = &effects[i];
    char count[24] = "-";
    if (e->of > 0) {
      snprintf(count, sizeof count, "%u/%u", e->on, e->of);
    }
    fprintf(out, "%-12s %-5s %-7s %9s", hap_effect_name((hap_effect)i),
            hap_effect_wish_name((hap_effect_wish)e->wish), state_name(e->state), count);
    print_time(e->tick_us, out);
    print_time(e->physics_ms, out);
    print_time(e->contact_us, out);
    fprintf(out, "  %s\n", hap_effect_reason_text((hap_effect_reason)e->reason));
  }
}

static void list_models(hap_effect index, FILE *out)
{
  const char *between = "";
  for (int m = 0; hap_model_name((hap_model)m) != NULL; ++m) {
    if (hap_effect_check(index, HAP_EFFECT_ON, (hap_model)m, NULL) >= HAP_OK) {
      bool must = hap_effect_check(index, HAP_EFFECT_OFF, (hap_model)m, NULL) < HAP_OK;
      fprintf(out, "%s%s%s", between, hap_model_name((hap_model)m), must ? " (never off)" : "");
      between = ", ";
    }
  }
  fputs(*between == '\0' ? "every model, by --record" : "", out);
}

void run_effects_list(FILE *out)
{
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    fprintf(out, "  %-12s %s\n%15s", hap_effect_name((hap_effect)i), hap_effect_text((hap_effect)i),
            "");
    list_models((hap_effect)i, out);
    fputc('\n', out);
  }
}
