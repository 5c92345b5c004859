/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/mesh_file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/alloc.h"
#include "base/number.h"
#include "base/regular.h"

#define BYTES_MOST (64u << 20)
#define TRIANGLES_MOST 1000000u

typedef struct mesh_reading {
  import_work *work;
  import_mesh *mesh;
  double *vertices;
  uint32_t *triangles;
  const char *why;
} mesh_reading;

static const char no_mesh[] = "no such mesh can be";
static const char no_memory[] = "no memory";

static bool room_make(mesh_reading *r, size_t vertices, size_t triangles)
{
  r->why = no_mesh;
  if (vertices > 3 * TRIANGLES_MOST || triangles > TRIANGLES_MOST || vertices < 3) {
    return false;
  }
  r->why = no_memory;
  r->mesh = import_take(r->work, sizeof *r->mesh);
  r->vertices = import_take(r->work, 3 * vertices * sizeof *r->vertices);
  r->triangles = import_take(r->work, (3 * triangles + 1) * sizeof *r->triangles);
  if (r->mesh == NULL || r->vertices == NULL || r->triangles == NULL) {
    r->mesh = NULL;
    return false;
  }
  r->mesh->vertices_xyz = r->vertices;
  r->mesh->triangles = r->triangles;
  return true;
}

static double float_at(const unsigned char *bytes)
{
  float value;
  memcpy(&value, bytes, sizeof value);
  return (double)value;
}

static uint32_t word_at(const unsigned char *bytes)
{
  uint32_t value;
  memcpy(&value, bytes, sizeof value);
  return value;
}

/* Each triangle has corners of its own. */
static void soup_number(mesh_reading *r, size_t triangles)
{
  for (size_t i = 0; i < 3 * triangles; ++i) {
    r->triangles[i] = (uint32_t)i;
  }
  r->mesh->vertex_count = 3 * triangles;
  r->mesh->triangle_count = triangles;
}

static void stl_binary(mesh_reading *r, const unsigned char *bytes, size_t size)
{
  const size_t count = word_at(bytes + 80);
  if (count > (size - 84) / 50 || !room_make(r, 3 * count, count)) {
    r->why = r->why != NULL ? r->why : "it is shorter than it says";
    return;
  }
  for (size_t i = 0; i < 9 * count; ++i) {
    r->vertices[i] = float_at(bytes + 84 + 50 * (i / 9) + 12 + 4 * (i % 9));
  }
  soup_number(r, count);
}

/* Numbers behind a word. */
static bool numbers_take(const char *at, int count, double *out)
{
  for (int k = 0; k < count; ++k) {
    at += strspn(at, " \t");
    at = hapi_number_read(at, &out[k]);
    if (at == NULL) {
      return false;
    }
  }
  return true;
}

static size_t lines_of(const char *text, const char *word)
{
  size_t count = 0;
  for (const char *at = text; at != NULL; at = strchr(at, '\n')) {
    at += strspn(at, " \t\r\n");
    count += strncmp(at, word, strlen(word)) == 0 ? 1 : 0;
  }
  return count;
}

static void stl_text(mesh_reading *r, const char *text)
{
  size_t corners = lines_of(text, "vertex ");
  size_t used = 0;
  if (!room_make(r, corners, corners / 3)) {
    return;
  }
  for (const char *at = text; at != NULL; at = strchr(at, '\n')) {
    at += strspn(at, " \t\r\n");
    if (strncmp(at, "vertex ", 7) == 0) {
      if (!numbers_take(at + 7, 3, r->vertices + 3 * used++)) {
        r->mesh = NULL;
        r->why = no_mesh;
        return;
      }
    }
  }
  soup_number(r, corners / 3);
}

/* Corners of a face "f 1/2/3 4 -1": from 1, or from the newest back. False: there is none such. */
static bool face_take(mesh_reading *r, const char *at, size_t vertices, size_t most)
{
  uint32_t corner[3];
  size_t have = 0;
  for (at += strspn(at, " \t"); *at != '\0' && *at != '\n' && *at != '\r';) {
    char *end;
    long number = strtol(at, &end, 10);
    if (end == at || number == 0 || labs(number) > (long)vertices) {
      return false;
    }
    corner[have < 2 ? have : 2] = (uint32_t)(number > 0 ? number - 1 : (long)vertices + number);
    if (++have >= 3) {
      if (r->mesh->triangle_count == most) {
        return false;
      }
      memcpy(r->triangles + 3 * r->mesh->triangle_count++, corner, sizeof corner);
      corner[1] = corner[2];
    }
    at = end + strcspn(end, " \t\r\n");
    at += strspn(at, " \t");
  }
  return true;
}

static void obj_read(mesh_reading *r, const char *text)
{
  const size_t vertices = lines_of(text, "v ");
  const size_t most = 4 * lines_of(text, "f ");
  if (!room_make(r, vertices, most < TRIANGLES_MOST ? most : TRIANGLES_MOST)) {
    return;
  }
  bool good = true;
  for (const char *at = text; at != NULL && good; at = strchr(at, '\n')) {
    at += strspn(at, " \t\r\n");
    if (strncmp(at, "v ", 2) == 0) {
      good = numbers_take(at + 2, 3, r->vertices + 3 * r->mesh->vertex_count++);
    } else if (strncmp(at, "f ", 2) == 0) {
      good = face_take(r, at + 2, r->mesh->vertex_count,
                       most < TRIANGLES_MOST ? most : TRIANGLES_MOST);
    }
  }
  if (!good) {
    r->mesh = NULL;
    r->why = no_mesh;
  }
}

static void msh_read(mesh_reading *r, const unsigned char *bytes, size_t size)
{
  size_t counts[4];
  for (size_t i = 0; i < 4; ++i) {
    counts[i] = size >= 16 ? word_at(bytes + 4 * i) : SIZE_MAX;
    if (counts[i] > 3 * (size_t)TRIANGLES_MOST) {
      r->why = no_mesh;
      return;
    }
  }
  const size_t faces = 16 + 12 * counts[0] + 12 * counts[1] + 8 * counts[2];
  if (faces + 12 * counts[3] > size) {
    r->why = "it is shorter than it says";
    return;
  }
  if (!room_make(r, counts[0], counts[3])) {
    return;
  }
  for (size_t i = 0; i < 3 * counts[0]; ++i) {
    r->vertices[i] = float_at(bytes + 16 + 4 * i);
  }
  for (size_t i = 0; i < 3 * counts[3]; ++i) {
    r->triangles[i] = word_at(bytes + faces + 4 * i);
  }
  r->mesh->vertex_count = counts[0];
  r->mesh->triangle_count = counts[3];
}

static bool mesh_sound(const import_mesh *mesh)
{
  for (size_t i = 0; i < 3 * mesh->vertex_count; ++i) {
    if (!(fabs(mesh->vertices_xyz[i]) <= 1e6)) {
      return false;
    }
  }
  for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
    if (mesh->triangles[i] >= mesh->vertex_count) {
      return false;
    }
  }
  return true;
}

static void bytes_read(mesh_reading *r, const char *end, const unsigned char *bytes, size_t size)
{
  if (strcasecmp(end, ".obj") == 0) {
    obj_read(r, (const char *)bytes);
  } else if (strcasecmp(end, ".msh") == 0) {
    msh_read(r, bytes, size);
  } else if (strcasecmp(end, ".stl") != 0) {
    r->why = "neither STL, OBJ nor MSH";
  } else if (size >= 84 && (size - 84) / 50 >= word_at(bytes + 80) && (size - 84) % 50 == 0) {
    stl_binary(r, bytes, size);
  } else {
    stl_text(r, (const char *)bytes);
  }
  if (r->mesh != NULL && !mesh_sound(r->mesh)) {
    r->mesh = NULL;
    r->why = no_mesh;
  }
}

import_mesh *import_mesh_file(import_work *work, const char *path, const char **out_why)
{
  mesh_reading r = {.work = work};
  const char *end = strrchr(path, '.');
  FILE *file = hapi_regular_open(path, out_why);
  if (file == NULL) {
    return NULL;
  }
  *out_why = "it has more than 64 MiB";
  long size = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
  if (size >= 0 && size <= (long)BYTES_MOST && fseek(file, 0, SEEK_SET) == 0) {
    unsigned char *bytes = hapi_alloc((size_t)size + 1);
    r.why = bytes == NULL ? no_memory : NULL;
    work->starved = work->starved || bytes == NULL;
    if (bytes != NULL && fread(bytes, 1, (size_t)size, file) == (size_t)size) {
      bytes_read(&r, end != NULL ? end : "", bytes, (size_t)size);
    }
    hapi_free(bytes);
    *out_why = r.why != NULL ? r.why : "it cannot be read";
  }
  fclose(file);
  return r.mesh;
}
