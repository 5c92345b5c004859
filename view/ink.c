/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "view/ink.h"

#include <string.h>

#include "view/font.h"
#include "view/shaders.h"

hap_status ink_make(ink *out, hap_detail *detail)
{
  out->program = gpu_program(shader_ink_vertex, shader_ink_pixel, detail);
  glGenVertexArrays(1, &out->array);
  glGenBuffers(1, &out->buffer);
  glBindVertexArray(out->array);
  glBindBuffer(GL_ARRAY_BUFFER, out->buffer);
  glBufferData(GL_ARRAY_BUFFER, sizeof out->marks, NULL, GL_STREAM_DRAW);
  const GLint sizes[] = {4, 4, 2};
  size_t offset = 0;
  for (GLuint i = 0; i < 3; ++i) {
    glEnableVertexAttribArray(i);
    glVertexAttribPointer(i, sizes[i], GL_FLOAT, GL_FALSE, sizeof(ink_mark), (const void *)offset);
    glVertexAttribDivisor(i, 1);
    offset += (size_t)sizes[i] * sizeof(float);
  }
  return out->program != 0 ? HAP_OK : HAP_ERROR_UNSUPPORTED;
}

void ink_free(ink *of)
{
  glDeleteProgram(of->program);
  glDeleteVertexArrays(1, &of->array);
  glDeleteBuffers(1, &of->buffer);
}

static void mark_add(ink *io, const float ends[4], const float colour[4], const float how[2])
{
  if (io->count == INK_MAX) {
    return;
  }
  ink_mark *m = &io->marks[io->count++];
  memcpy(m->ends, ends, sizeof m->ends);
  memcpy(m->colour, colour, sizeof m->colour);
  m->radius = how[0];
  m->is_panel = how[1];
}

void ink_line(ink *io, const float ends[4], float radius, const float colour[4])
{
  mark_add(io, ends, colour, (const float[2]){radius, 0.0F});
}

void ink_panel(ink *io, const float corners[4], float radius, const float colour[4])
{
  mark_add(io, corners, colour, (const float[2]){radius, 1.0F});
}

float ink_text_width(const char *text, float height)
{
  return font_width(text) * height / FONT_CAPITAL;
}

static void letter_add(ink *io, const float origin[3], const float colour[4], char letter)
{
  const char *s = font_strokes(letter);
  const float scale = origin[2] / FONT_CAPITAL;
  const float pen = 0.46F * scale;
  float last[2] = {0.0F, 0.0F};
  bool down = false;
  while (s[0] != '\0' && s[1] != '\0') {
    if (s[0] == ' ') {
      down = false;
      ++s;
      continue;
    }
    const float next[2] = {origin[0] + scale * (float)(s[0] - '0'),
                           origin[1] - scale * ((float)(s[1] - '0') - FONT_BASELINE)};
    if (down) {
      ink_line(io, (const float[4]){last[0], last[1], next[0], next[1]}, pen, colour);
    }
    memcpy(last, next, sizeof last);
    down = true;
    s += 2;
  }
}

void ink_text(ink *io, const float at_and_height[3], ink_side side, const float colour[4],
              const char *text)
{
  float origin[3] = {at_and_height[0], at_and_height[1], at_and_height[2]};
  origin[0] -= 0.5F * (float)side * ink_text_width(text, origin[2]);
  for (; *text != '\0'; ++text) {
    letter_add(io, origin, colour, *text);
    origin[0] += font_advance(*text) * origin[2] / FONT_CAPITAL;
  }
}

void ink_draw(ink *io, int width, int height)
{
  glUseProgram(io->program);
  glUniform2f(glGetUniformLocation(io->program, "size"), (float)width, (float)height);
  glBindVertexArray(io->array);
  glBindBuffer(GL_ARRAY_BUFFER, io->buffer);
  glBufferSubData(GL_ARRAY_BUFFER, 0, (GLsizeiptr)(io->count * sizeof(ink_mark)), io->marks);
  glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, (GLsizei)io->count);
  io->count = 0;
}
