/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_keys.h"

#include <stdio.h>
#include <string.h>

static const struct {
  const char *name;
  const char *key;
  const char *text;
} acts[ACT_COUNT] = {
    [ACT_HELP] = {"help", "F1", "this list"},
    [ACT_QUIT] = {"quit", "escape", "end"},
    [ACT_PAUSE] = {"pause", "space", "pause, go on"},
    [ACT_STEP] = {"step", ".", "one step of physics, then pause"},
    [ACT_AGAIN] = {"again", "r", "the scene from its beginning"},
    [ACT_SCENE_NEXT] = {"scene-next", "n", "next scene"},
    [ACT_SCENE_BEFORE] = {"scene-before", "b", "scene before"},
    [ACT_MODEL] = {"model", "m", "next model"},
    [ACT_RATE_UP] = {"rate-up", "up", "more steps of physics a second"},
    [ACT_RATE_DOWN] = {"rate-down", "down", "fewer"},
    [ACT_FINER] = {"finer", "+", "dial of accuracy up"},
    [ACT_COARSER] = {"coarser", "-", "dial of accuracy down"},
    [ACT_SLOWER] = {"slower", "left", "slow motion; recording: back"},
    [ACT_FASTER] = {"faster", "right", "faster; recording: on"},
    [ACT_HAND] = {"hand", "tab", "the mouse moves the next hand"},
    [ACT_SCRIPT] = {"script", "h", "the hand goes back to its own motion"},
    [ACT_LET_GO] = {"let-go", "g", "let go of the held body"},
    [ACT_RESET] = {"reset", "c", "clear a fault"},
    [ACT_CAMERA] = {"camera", "f", "frame the whole scene"},
    [ACT_PLOTS] = {"plots", "p", "strips of force and tick time"},
    [ACT_EFFECTS] = {"effects", "e", "effects with state and time"},
    [ACT_LABELS] = {"labels", "l", "all text"},
};

static const char *const named_keys[] = {
    "space", "comma", "escape", "enter", "tab", "left", "right", "up",  "down", "F1", "F2",
    "F3",    "F4",    "F5",     "F6",    "F7",  "F8",   "F9",    "F10", "F11",  "F12"};

const char *run_act_name(run_act act)
{
  return acts[act].name;
}

const char *run_act_text(run_act act)
{
  return acts[act].text;
}

void run_keys_init(run_keys *out)
{
  for (size_t i = 0; i < ACT_COUNT; ++i) {
    snprintf(out->key[i], RUN_KEY_MAX, "%s", acts[i].key);
  }
}

run_act run_keys_find(const run_keys *keys, const char *key)
{
  for (int i = 0; i < ACT_COUNT; ++i) {
    if (strcmp(keys->key[i], key) == 0) {
      return (run_act)i;
    }
  }
  return ACT_COUNT;
}

/* A sign that is printed, a name, or off. */
static bool key_is_known(const char *key)
{
  bool found = strcmp(key, "off") == 0 || (key[0] > ' ' && key[0] < 127 && key[1] == '\0');
  for (size_t i = 0; i < sizeof named_keys / sizeof named_keys[0]; ++i) {
    found = found || strcmp(key, named_keys[i]) == 0;
  }
  return found;
}

static bool key_set(const char *name, const char *key, run_keys *io)
{
  const bool all = strcmp(name, "all") == 0 && strcmp(key, "off") == 0;
  bool found = false;
  for (int i = 0; i < ACT_COUNT; ++i) {
    if (all || strcmp(acts[i].name, name) == 0) {
      snprintf(io->key[i], RUN_KEY_MAX, "%s", strcmp(key, "off") == 0 ? "" : key);
      found = true;
    }
  }
  return found;
}

static hap_status item_refuse(const char *item, size_t length, hap_detail *detail)
{
  int used = snprintf(detail->text, sizeof detail->text,
                      "\"%.*s\" is not NAME=KEY, KEY a sign, space, comma, escape, enter, tab, "
                      "left, right, up, down, F1 to F12 or off; names: all",
                      length < 40 ? (int)length : 40, item);
  for (int i = 0; i < ACT_COUNT && used < (int)sizeof detail->text; ++i) {
    used += snprintf(detail->text + used, sizeof detail->text - (size_t)used, " %s", acts[i].name);
  }
  return HAP_ERROR_ARGUMENT;
}

/* No key does two things. */
static hap_status keys_check(const run_keys *keys, hap_detail *detail)
{
  for (int i = 0; i < ACT_COUNT; ++i) {
    const run_act first = run_keys_find(keys, keys->key[i]);
    if (keys->key[i][0] != '\0' && first != (run_act)i) {
      snprintf(detail->text, sizeof detail->text, "the key %s would do two things: %s and %s",
               keys->key[i], acts[first].name, acts[i].name);
      return HAP_ERROR_ARGUMENT;
    }
  }
  return HAP_OK;
}

hap_status run_keys_parse(const char *list, run_keys *io, hap_detail *detail)
{
  for (;;) {
    const size_t length = strcspn(list, ",");
    const size_t name = strcspn(list, "=");
    char words[2][24] = {"", ""};
    if (name < length && name < sizeof words[0] && length - name - 1 < RUN_KEY_MAX) {
      memcpy(words[0], list, name);
      memcpy(words[1], list + name + 1, length - name - 1);
    }
    if (!key_is_known(words[1]) || !key_set(words[0], words[1], io)) {
      return item_refuse(list, length, detail);
    }
    if (list[length] == '\0') {
      return keys_check(io, detail);
    }
    list += length + 1;
  }
}
