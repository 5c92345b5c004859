/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/virtual/delay.h"

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"

bool hapi_delay_init(hapi_delay *line, uint64_t delay_ns)
{
  *line = (hapi_delay){.delay_ns = delay_ns};
  if (delay_ns > 0) {
    line->commands = hapi_alloc_array(HAPI_DELAY_COMMANDS, sizeof *line->commands);
  }
  return delay_ns == 0 || line->commands != NULL;
}

void hapi_delay_finish(hapi_delay *line)
{
  hapi_free(line->commands);
  *line = (hapi_delay){.delay_ns = 0};
}

void hapi_delay_clear(hapi_delay *line)
{
  line->first = 0;
  line->count = 0;
  hapi_v3_set(line->acting, 0.0, 0.0, 0.0);
}

void hapi_delay_give(hapi_delay *line, uint64_t now_ns, const double force[3])
{
  HAPI_ASSERT(line->count <= HAPI_DELAY_COMMANDS);
  if (line->commands == NULL) {
    hapi_v3_copy(force, line->acting);
    return;
  }
  line->count += line->count < HAPI_DELAY_COMMANDS;
  uint32_t last = (line->first + line->count - 1) % HAPI_DELAY_COMMANDS;
  line->commands[last].due_ns = now_ns + line->delay_ns;
  hapi_v3_copy(force, line->commands[last].force);
}

uint64_t hapi_delay_take(hapi_delay *line, uint64_t now_ns)
{
  HAPI_ASSERT(line->first < HAPI_DELAY_COMMANDS);
  while (line->count > 0 && line->commands[line->first].due_ns <= now_ns) {
    hapi_v3_copy(line->commands[line->first].force, line->acting);
    line->first = (line->first + 1) % HAPI_DELAY_COMMANDS;
    --line->count;
  }
  return line->count > 0 ? line->commands[line->first].due_ns : UINT64_MAX;
}
