/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "bench/accuracy.h"

#define TABLE_GROWTH 256
#define NOT_A_NUMBER 1e9 /* what a run that came to no number has in the table */

/* One line is one column of accuracy.csv, in its order, which only grows at the end. */
typedef struct column {
  const char *name;
  size_t offset;
  double scale;       /* what stands in the table / what the row has; 0: a text */
  const char *format; /* of the number */
} column;

#define TEXT(name, member)                          \
  {                                                 \
    name, offsetof(accuracy_row, member), 0.0, NULL \
  }
#define NUMBER(name, member, scale, format)             \
  {                                                     \
    name, offsetof(accuracy_row, member), scale, format \
  }

static const column columns[] = {
    TEXT("scene", scene),
    TEXT("model", model),
    NUMBER("physics_hz", physics_hz, 1.0, "%g"),
    TEXT("knob", knob),
    NUMBER("value", value, 1.0, "%g"),
    NUMBER("force_rel_rms", errors.force, 1.0, "%.6g"),
    NUMBER("impulse_ratio", errors.impulse_ratio, 1.0, "%.6g"),
    NUMBER("peak_ratio", errors.peak_ratio, 1.0, "%.6g"),
    NUMBER("tick_us", tick_us, 1.0, "%.4g"),
    NUMBER("physics_ms", physics_ms, 1.0, "%.4g"),
    NUMBER("duty", duty, 1.0, "%.4g"),
    NUMBER("haptic_hz", haptic_hz, 1.0, "%g"),
    NUMBER("noise_floor", noise_floor, 1.0, "%.6g"),
    NUMBER("estimate", estimate, 1.0, "%.6g"),
    TEXT("hand", hand),
    NUMBER("pose_error_mm", errors.pose_max, 1e3, "%.5g"),
    NUMBER("sync_line_n", errors.line_n, 1.0, "%.5g"),
    NUMBER("hand_speed", hand_speed, 1.0, "%.4g"),
    NUMBER("pose_median_mm", errors.pose_median, 1e3, "%.5g"),
    NUMBER("force_rms_n", errors.force_rms, 1.0, "%.4g"),
    NUMBER("rest_share", rest_share, 1.0, "%.3g"),
    NUMBER("start_um", start_um, 1.0, "%g"),
    NUMBER("torque_rel_rms", errors.torque, 1.0, "%.6g"),
    NUMBER("torque_floor", torque_floor, 1.0, "%.6g"),
    NUMBER("starts", starts, 1.0, "%g"),
    NUMBER("first_rel_rms", first_force, 1.0, "%.6g"),
    NUMBER("lines", errors.lines, 1.0, "%g"),
    NUMBER("front", front, 1.0, "%g"),
    NUMBER("joint_open_mm", errors.joint_loop, 1e3, "%.4g"),
    NUMBER("joint_world_mm", errors.joint_world, 1e3, "%.4g"),
    NUMBER("joint_left_mm", errors.joint_left, 1e3, "%.4g"),
    NUMBER("joint_floor_mm", joint_floor, 1e3, "%.4g"),
    NUMBER("joint_turn_deg", errors.joint_turn, 180.0 / M_PI, "%.4g"),
};

#define COLUMN_COUNT (sizeof columns / sizeof columns[0])

void accuracy_table_free(accuracy_table *table)
{
  free(table->rows);
  memset(table, 0, sizeof *table);
}

hap_status accuracy_table_add(bench *b, accuracy_table *table, const accuracy_row *row)
{
  if (table->count == table->capacity) {
    size_t capacity = table->capacity + TABLE_GROWTH;
    accuracy_row *rows = realloc(table->rows, capacity * sizeof *rows);
    if (rows == NULL) {
      return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the table");
    }
    table->rows = rows;
    table->capacity = capacity;
  }
  table->rows[table->count] = *row;
  ++table->count;
  return HAP_OK;
}

size_t accuracy_rows_of_scene(const accuracy_table *table, size_t first)
{
  size_t end = first;
  while (end < table->count && strcmp(table->rows[end].scene, table->rows[first].scene) == 0) {
    ++end;
  }
  return end - first;
}

bool accuracy_row_is(const accuracy_row *row, hap_model model, const char *knob)
{
  return strcmp(row->model, hap_model_name(model)) == 0 && strcmp(row->knob, knob) == 0;
}

/* ---- as text ---- */

void accuracy_write_header(FILE *csv)
{
  for (size_t i = 0; i < COLUMN_COUNT; ++i) {
    fprintf(csv, "%s%s", i > 0 ? "," : "", columns[i].name);
  }
  fputc('\n', csv);
}

void accuracy_write_row(FILE *csv, const accuracy_row *row)
{
  for (size_t i = 0; i < COLUMN_COUNT; ++i) {
    const column *c = &columns[i];
    const char *at = (const char *)row + c->offset;
    char number[40];
    if (c->scale != 0.0) {
      double value = c->scale * *(const double *)(const void *)at;
      /* NOLINTNEXTLINE(clang-diagnostic-format-nonliteral): from the table above */
      snprintf(number, sizeof number, c->format, isfinite(value) ? value : NOT_A_NUMBER);
      at = number;
    }
    fprintf(csv, "%s%s", i > 0 ? "," : "", at);
  }
  fputc('\n', csv);
}

/* The field up to the next comma; NULL: it does not fit, or it is not a number of its own. */
static const char *read_field(const char *text, const column *c, accuracy_row *out)
{
  char field[ACCURACY_NAME_MAX + 16];
  size_t length = strcspn(text, ",\n");
  char *to = (char *)out + c->offset;
  char *end = NULL;
  if (length == 0 || length >= (c->scale != 0.0 ? sizeof field : ACCURACY_NAME_MAX)) {
    return NULL;
  }
  memcpy(field, text, length);
  field[length] = '\0';
  if (c->scale == 0.0) {
    memcpy(to, field, length + 1);
  } else {
    double value = strtod(field, &end) / c->scale;
    memcpy(to, &value, sizeof value);
  }
  return end == NULL || *end == '\0' ? text + length : NULL;
}

bool accuracy_read_row(const char *line, accuracy_row *out)
{
  memset(out, 0, sizeof *out);
  for (size_t i = 0; i < COLUMN_COUNT; ++i) {
    line = read_field(line, &columns[i], out);
    if (line == NULL || *line != (i + 1 < COLUMN_COUNT ? ',' : '\n')) {
      return false;
    }
    ++line;
  }
  return *line == '\0';
}

bool accuracy_is_header(const char *line)
{
  for (size_t i = 0; i < COLUMN_COUNT; ++i) {
    size_t length = strlen(columns[i].name);
    if (strncmp(line, columns[i].name, length) != 0 ||
        line[length] != (i + 1 < COLUMN_COUNT ? ',' : '\n')) {
      return false;
    }
    line += length + 1;
  }
  return true;
}
