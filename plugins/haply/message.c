/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/haply/message.h"

#include <stdio.h>
#include <string.h>

#include "base/number.h"
#include "plugins/haply/json.h"

#define KEY_ROOM 32

/* An entry of a list: its name may come after its state. */
typedef struct haply_entry {
  char id[HAPI_HAPLY_ID];
  int given; /* vectors that are complete */
  double position[3];
  double velocity[3];
  double quat_wxyz[4];
  unsigned buttons;
} haply_entry;

bool hapi_haply_is_id(const char *id)
{
  static const char allowed[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.:";
  size_t length = strlen(id);
  return length > 0 && length + 1 < HAPI_HAPLY_ID && strspn(id, allowed) == length;
}

/* An object of numbers with these names, each once; others are skipped. */
static bool numbers_read(hapi_json *json, const char *names, double *out)
{
  char key[KEY_ROOM];
  size_t count = strlen(names);
  unsigned seen = 0;
  bool good = hapi_json_enter(json, '{');
  while (good && hapi_json_member(json, key, sizeof key)) {
    const char *name = key[0] != '\0' && key[1] == '\0' ? strchr(names, key[0]) : NULL;
    unsigned bit = name != NULL ? 1u << (name - names) : 0;
    if (name == NULL) {
      good = hapi_json_skip(json);
    } else {
      good = (seen & bit) == 0 && hapi_json_number(json, &out[name - names]);
      seen |= bit;
    }
  }
  return good && !json->bad && seen == (1u << count) - 1;
}

static bool buttons_read(hapi_json *json, unsigned *out)
{
  char key[KEY_ROOM];
  bool good = hapi_json_enter(json, '{');
  *out = 0;
  while (good && hapi_json_member(json, key, sizeof key)) {
    bool known = key[0] >= 'a' && key[0] <= 'c' && key[1] == '\0';
    bool pressed = false;
    good = known ? hapi_json_boolean(json, &pressed) : hapi_json_skip(json);
    *out |= pressed ? 1u << (key[0] - 'a') : 0;
  }
  return good && !json->bad;
}

static bool state_read(hapi_json *json, haply_entry *entry)
{
  char key[KEY_ROOM];
  bool good = hapi_json_enter(json, '{');
  while (good && hapi_json_member(json, key, sizeof key)) {
    if (strcmp(key, "cursor_position") == 0) {
      good = numbers_read(json, "xyz", entry->position);
      entry->given |= 1;
    } else if (strcmp(key, "cursor_velocity") == 0) {
      good = numbers_read(json, "xyz", entry->velocity);
      entry->given |= 2;
    } else if (strcmp(key, "orientation") == 0) {
      good = numbers_read(json, "wxyz", entry->quat_wxyz);
      entry->given |= 4;
    } else if (strcmp(key, "buttons") == 0) {
      good = buttons_read(json, &entry->buttons);
    } else {
      good = hapi_json_skip(json);
    }
  }
  return good && !json->bad;
}

static bool entry_read(hapi_json *json, haply_entry *entry)
{
  char key[KEY_ROOM];
  memset(entry, 0, sizeof *entry);
  bool good = hapi_json_enter(json, '{');
  while (good && hapi_json_member(json, key, sizeof key)) {
    if (strcmp(key, "device_id") == 0) {
      good = hapi_json_string(json, entry->id, sizeof entry->id) && hapi_haply_is_id(entry->id);
    } else if (strcmp(key, "state") == 0) {
      good = state_read(json, entry);
    } else {
      good = hapi_json_skip(json);
    }
  }
  return good && !json->bad && entry->id[0] != '\0';
}

static void list_add(hapi_haply_list *list, const char *id)
{
  if (list->count < HAPI_HAPLY_NAMED) {
    memcpy(list->id[list->count], id, HAPI_HAPLY_ID);
  }
  list->count += list->count < 1000000;
}

static bool is_wanted(const char *wish, const hapi_haply_list *list, const char *id)
{
  return wish[0] != '\0' ? strcmp(wish, id) == 0 : list->count == 0;
}

static void arm_take(const haply_entry *entry, hapi_haply_state *out)
{
  out->has_position = (entry->given & 3) == 3;
  memcpy(out->position, entry->position, sizeof out->position);
  memcpy(out->velocity, entry->velocity, sizeof out->velocity);
}

static void grip_take(const haply_entry *entry, hapi_haply_state *out)
{
  out->has_grip = (entry->given & 4) != 0;
  out->buttons = entry->buttons;
  memcpy(out->quat_wxyz, entry->quat_wxyz, sizeof out->quat_wxyz);
}

static bool list_read(hapi_json *json, const char *wish, bool arms, hapi_haply_state *out)
{
  hapi_haply_list *list = arms ? &out->arms : &out->grips;
  haply_entry entry;
  bool good = hapi_json_enter(json, '[');
  while (good && hapi_json_element(json)) {
    good = entry_read(json, &entry);
    if (good && is_wanted(wish, list, entry.id)) {
      arms ? arm_take(&entry, out) : grip_take(&entry, out);
    }
    if (good) {
      list_add(list, entry.id);
    }
  }
  return good && !json->bad;
}

bool hapi_haply_read(const char *text, size_t length, const hapi_haply_wish *wish,
                     hapi_haply_state *out)
{
  hapi_json json;
  char key[KEY_ROOM];
  memset(out, 0, sizeof *out);
  hapi_json_begin(&json, text, length);
  bool good = hapi_json_enter(&json, '{');
  while (good && hapi_json_member(&json, key, sizeof key)) {
    if (strcmp(key, "inverse3") == 0) {
      out->has_arms = true;
      good = list_read(&json, wish->arm, true, out);
    } else if (strcmp(key, "wireless_verse_grip") == 0) {
      good = list_read(&json, wish->grip, false, out);
    } else {
      good = hapi_json_skip(&json);
    }
  }
  return good && hapi_json_end(&json);
}

size_t hapi_haply_write_force(const char *id, const double force[3], char out[HAPI_HAPLY_TEXT])
{
  char numbers[3][32];
  for (int i = 0; i < 3; ++i) {
    hapi_number_write(numbers[i], sizeof numbers[i], force[i]);
  }
  int length =
      snprintf(out, HAPI_HAPLY_TEXT,
               "{\"inverse3\":[{\"device_id\":\"%.39s\",\"commands\":{\"set_cursor_force\":"
               "{\"values\":{\"x\":%s,\"y\":%s,\"z\":%s}}}}]}",
               id, numbers[0], numbers[1], numbers[2]);
  return length > 0 && length < HAPI_HAPLY_TEXT ? (size_t)length : 0;
}
