/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/log.h"
#include "base/number.h"
#include "tools/spidar-emulator/emulator.h"

#define WORDS_MAX 6

const char emulator_help[] =
    "lose|double reply|command [N]   the byte of that direction after N others, padding counted\n"
    "stray reply|command N BYTE      BYTE comes before it\n"
    "silent BOARD|all 0|1            hears and says nothing\n"
    "late SECONDS                    every reply, from now on\n"
    "garbage N                       bytes on the reply line\n"
    "report BOARD B3M                what it says it is\n"
    "false STRING|all COUNTS         its encoder is off by so much, -32768 to 32767\n"
    "stuck STRING|all 0|1            its encoder stands still\n"
    "saturate CURRENT                currents are clipped to it, 0 to 4095\n"
    "power                           off and on: counts and lengths begin anew\n"
    "unplug [SECONDS], plug          the cable\n"
    "push X Y Z                      N on the grip, beside the hand\n"
    "hand push|hold|none\n"
    "state                           a line about all that\n"
    "quit\n";

typedef struct word {
  const char *text;
  size_t length;
} word;

static int line_split(const char *line, word words[WORDS_MAX])
{
  int count = 0;
  const char *at = line + strspn(line, " \t\r\n");
  while (*at != '\0' && count < WORDS_MAX) {
    words[count] = (word){at, strcspn(at, " \t\r\n")};
    at += words[count].length;
    at += strspn(at, " \t\r\n");
    ++count;
  }
  return *at == '\0' ? count : WORDS_MAX + 1;
}

static bool word_is(const word *w, const char *text)
{
  return strlen(text) == w->length && memcmp(text, w->text, w->length) == 0;
}

static bool read_number(const word *w, double least, double most, double *out)
{
  const char *end = hapi_number_read(w->text, out);
  return end == w->text + w->length && *out >= least && *out <= most;
}

/* Behind "lose", "double", "stray". */
static bool read_fault(const word *words, int count, wire_fault *out)
{
  double skip = 0.0;
  double value = 0.0;
  bool stray = out->kind == WIRE_STRAY;
  if (count < 2 || count > (stray ? 4 : 3) || (stray && count < 4)) {
    return false;
  }
  bool command = word_is(&words[1], "command");
  out->direction = command ? HAPI_SPIDAR_TO_BOARD : HAPI_SPIDAR_FROM_BOARD;
  if ((!command && !word_is(&words[1], "reply")) ||
      (count > 2 && !read_number(&words[2], 0.0, 1e9, &skip)) ||
      (stray && !read_number(&words[3], 0.0, 255.0, &value))) {
    return false;
  }
  out->skip = (unsigned)skip;
  out->value = (uint8_t)value;
  return true;
}

static bool read_silent(const word *words, int count, emulator_action *out)
{
  out->kind = EMULATOR_SILENT;
  out->number[0] = -1.0;
  return count == 3 &&
         (word_is(&words[1], "all") || read_number(&words[1], 0.0, 7.0, out->number)) &&
         read_number(&words[2], 0.0, 1.0, &out->number[1]);
}

/* Of a string or all: "false" and "stuck". */
static bool read_encoder(const word *words, int count, emulator_action *out)
{
  bool stuck = word_is(&words[0], "stuck");
  out->kind = stuck ? EMULATOR_STUCK : EMULATOR_FALSE;
  out->number[0] = -1.0;
  return count == 3 &&
         (word_is(&words[1], "all") || read_number(&words[1], 0.0, 7.0, out->number)) &&
         read_number(&words[2], stuck ? 0.0 : -32768.0, stuck ? 1.0 : 32767.0, &out->number[1]);
}

static bool read_report(const word *words, int count, emulator_action *out)
{
  out->kind = EMULATOR_REPORT;
  if (count != 3 || !read_number(&words[1], 0.0, 7.0, out->number)) {
    return false;
  }
  out->number[1] = hapi_spidar_kind_number(words[2].text, words[2].length);
  return out->number[1] > 0.0;
}

static bool read_hand(const word *words, int count, emulator_action *out)
{
  static const char *const names[] = {
      [EMULATOR_HAND_PUSH] = "push", [EMULATOR_HAND_HOLD] = "hold", [EMULATOR_HAND_NONE] = "none"};
  out->kind = EMULATOR_HAND;
  for (int i = 0; count == 2 && i < 3; ++i) {
    if (word_is(&words[1], names[i])) {
      out->number[0] = i;
      return true;
    }
  }
  return false;
}

static bool read_push(const word *words, int count, emulator_action *out)
{
  out->kind = EMULATOR_PUSH;
  bool good = count == 4;
  for (int k = 0; good && k < 3; ++k) {
    good = read_number(&words[1 + k], -100.0, 100.0, &out->number[k]);
  }
  return good;
}

static bool read_unplug(const word *words, int count, emulator_action *out)
{
  out->kind = EMULATOR_UNPLUG;
  out->number[0] = -1.0;
  return count == 1 || (count == 2 && read_number(&words[1], 0.0, 1e6, out->number));
}

/* Commands with no argument or with one number. */
static bool read_simple(const word *words, int count, emulator_action *out)
{
  static const struct {
    const char *name;
    emulator_action_kind kind;
    double most; /* of the number; < 0: there is none */
  } known[] = {{"late", EMULATOR_LATE, 10.0},
               {"garbage", EMULATOR_GARBAGE, 1000.0},
               {"saturate", EMULATOR_SATURATE, 4095.0},
               {"power", EMULATOR_POWER, -1.0},
               {"plug", EMULATOR_PLUG, -1.0},
               {"state", EMULATOR_STATE, -1.0},
               {"quit", EMULATOR_QUIT, -1.0}};
  for (size_t i = 0; i < sizeof known / sizeof known[0]; ++i) {
    if (word_is(&words[0], known[i].name)) {
      out->kind = known[i].kind;
      return known[i].most < 0.0
                 ? count == 1
                 : count == 2 && read_number(&words[1], 0.0, known[i].most, out->number);
    }
  }
  return false;
}

static bool read_action(const word *words, int count, emulator_action *out)
{
  static const struct {
    const char *name;
    wire_fault_kind kind;
  } faults[] = {{"lose", WIRE_LOSE}, {"double", WIRE_DOUBLE}, {"stray", WIRE_STRAY}};
  static const struct {
    const char *name;
    bool (*read)(const word *words, int count, emulator_action *out);
  } others[] = {{"silent", read_silent}, {"report", read_report}, {"hand", read_hand},
                {"push", read_push},     {"false", read_encoder}, {"stuck", read_encoder},
                {"unplug", read_unplug}};
  for (size_t i = 0; i < sizeof faults / sizeof faults[0]; ++i) {
    if (word_is(&words[0], faults[i].name)) {
      out->kind = EMULATOR_FAULT;
      out->fault.kind = faults[i].kind;
      return read_fault(words, count, &out->fault);
    }
  }
  for (size_t i = 0; i < sizeof others / sizeof others[0]; ++i) {
    if (word_is(&words[0], others[i].name)) {
      return others[i].read(words, count, out);
    }
  }
  return read_simple(words, count, out);
}

static bool has_board(const emulator *e, const emulator_action *action)
{
  bool asks = action->kind == EMULATOR_REPORT ||
              (action->kind == EMULATOR_SILENT && action->number[0] >= 0.0);
  for (int i = 0; asks && i < e->wire.count; ++i) {
    asks = e->wire.boards[i].id != (int)action->number[0];
  }
  return !asks;
}

hap_status emulator_parse(const emulator *e, const char *line, emulator_action *out,
                          hap_detail *detail)
{
  word words[WORDS_MAX];
  int count = line_split(line, words);
  memset(out, 0, sizeof *out);
  if (count == 0 || count > WORDS_MAX || !read_action(words, count, out)) {
    return hapi_fail(detail, HAP_ERROR_FORMAT, "not a command: \"%.60s\"; --help lists them", line);
  }
  if (!has_board(e, out)) {
    return hapi_fail(detail, HAP_ERROR_FORMAT, "\"%.60s\": there is no such board", line);
  }
  return HAP_OK;
}

hap_status emulator_plan_line(emulator *e, const char *line, hap_detail *detail)
{
  emulator_action action;
  double time = 0.0;
  line += strspn(line, " \t\r\n");
  if (*line == '\0' || *line == '#') {
    return HAP_OK;
  }
  const char *end = hapi_number_read(line, &time);
  if (end == NULL || (*end != ' ' && *end != '\t') || time < 0.0) {
    return hapi_fail(detail, HAP_ERROR_FORMAT, "expected SECONDS COMMAND, not \"%.60s\"", line);
  }
  hap_status status = emulator_parse(e, end, &action, detail);
  if (status < HAP_OK) {
    return status;
  }
  if (!emulator_plan(e, time, &action)) {
    return hapi_fail(detail, HAP_ERROR_FORMAT,
                     "\"%.60s\": times must not go back, and at most %d commands fit", line,
                     EMULATOR_EVENTS_MAX);
  }
  return HAP_OK;
}
