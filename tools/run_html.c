/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_html.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "base/regular.h"
#include "tools/html_columns.h"
#include "tools/run_frame.h"
#include "tools/run_history.h"
#include "tools/run_html_page.h"
#include "tools/run_scene_file.h"

#define FRAME_S 0.0195 /* the run looks every 20 ms */
#define PEAK_S (1.0 / 60.0)
#define FINEST 1e-6 /* m, 1, N: nobody sees less */
#define ROLES 6
#define COORDINATES 7 /* of a pose */

struct run_html {
  const run_options *options;
  run_frame_source source;
  hap_scene *scene;
  view_labels labels;
  view_frame now;
  run_history kept;
  double *peaks; /* N, strongest in each PEAK_S, of the strongest hand */
  size_t peak_count;
  size_t peak_capacity;
  bool no_memory;
  char part[4096]; /* the file until it is whole */
  FILE *file;
  html_bytes motion;
  html_bytes meshes;
  double *column; /* room for one */
};

/* ---- on the way ---- */

static hap_status html_make(run_html *html, hap_detail *detail)
{
  const char *why;
  const char *path = html->options->html_path;
  if (snprintf(html->part, sizeof html->part, "%s.part", path) >= (int)sizeof html->part) {
    return hapi_fail(detail, HAP_ERROR_IO, "--html: the name is too long");
  }
  if (!run_frame_reserve(&html->now, html->source.rig->scene->body_count)) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a page");
  }
  run_history_init(&html->kept);
  html->kept.interval = FRAME_S;
  HAPI_TRY(run_scene_file_again(html->options, &html->scene, detail)); /* to be read */
  html->source.scene = html->scene;
  run_frame_pointers(html->options, html->scene, &html->now);
  run_frame_labels(html->options, &html->labels);
  html->file = hapi_regular_create_stream(html->part, O_TRUNC, &why);
  return html->file != NULL ? HAP_OK
                            : hapi_fail(detail, HAP_ERROR_IO,
                                        "--html %.300s: cannot be written: %s", html->part, why);
}

static void html_free(run_html *html)
{
  if (html->file != NULL) { /* it is not whole */
    fclose(html->file);
    (void)unlink(html->part);
  }
  (void)hap_scene_destroy(html->scene);
  run_frame_free(&html->now);
  run_history_free(&html->kept);
  html_bytes_free(&html->motion);
  html_bytes_free(&html->meshes);
  free(html->peaks);
  free(html->column);
  free(html);
}

hap_status run_html_open(const run_options *options, const rig *r, size_t pointers, run_html **out,
                         hap_detail *detail)
{
  *out = NULL;
  if (options->html_path == NULL) {
    return HAP_OK;
  }
  run_html *html = calloc(1, sizeof *html);
  if (html == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a page");
  }
  html->options = options;
  html->source = (run_frame_source){
      .rig = r, .pointers = pointers < VIEW_POINTERS_MAX ? pointers : VIEW_POINTERS_MAX};
  hap_status status = html_make(html, detail);
  if (status < HAP_OK) {
    html_free(html);
    return status;
  }
  *out = html;
  return HAP_OK;
}

/* Room for the bins up to that one. */
static bool peaks_reach(run_html *html, size_t bin)
{
  if (bin >= html->peak_capacity) {
    size_t capacity = 2 * bin + 1024;
    double *more = realloc(html->peaks, capacity * sizeof *more);
    if (more == NULL) {
      return false;
    }
    html->peaks = more;
    html->peak_capacity = capacity;
  }
  while (html->peak_count <= bin) {
    html->peaks[html->peak_count++] = 0.0;
  }
  return true;
}

void run_html_add_row(run_html *html, const hap_trace_row *row)
{
  if (html == NULL) {
    return;
  }
  html->source.row = *row;
  const size_t bin = row->t > 0.0 ? (size_t)(row->t / PEAK_S) : 0;
  if (peaks_reach(html, bin)) {
    html->peaks[bin] = fmax(html->peaks[bin], run_frame_force(row));
  } else {
    html->no_memory = true;
  }
}

void run_html_look(run_html *html, double t)
{
  if (html != NULL) {
    run_frame_read(&html->source, t, &html->now);
    html->no_memory = html->no_memory || !run_history_add(&html->kept, &html->now);
  }
}

/* ---- what is in the scene, as JSON ---- */

static void numbers_write(FILE *out, const char *name, const double *values, size_t count)
{
  fprintf(out, "\"%s\":[", name);
  for (size_t i = 0; i < count; ++i) {
    fprintf(out, "%s%.9g", i > 0 ? "," : "", isfinite(values[i]) ? values[i] : 0.0);
  }
  fputc(']', out);
}

/* Its triangles go to the other bytes; "mesh" says where corners and triangles are, how many. */
static void mesh_write(run_html *html, uint32_t number, const hap_scene_geom *geom)
{
  double *corners = calloc(3 * (size_t)geom->vertex_count + 1, sizeof *corners);
  uint32_t *triangles = calloc(3 * (size_t)geom->triangle_count + 1, sizeof *triangles);
  html->no_memory = html->no_memory || corners == NULL || triangles == NULL;
  if (corners != NULL && triangles != NULL &&
      hap_scene_mesh(html->scene, number, corners, geom->vertex_count, triangles,
                     geom->triangle_count) >= HAP_OK) {
    fprintf(html->file, ",\"mesh\":[%zu,%u", html->meshes.count, geom->vertex_count);
    for (size_t i = 0; i < 3 * (size_t)geom->vertex_count; ++i) {
      float value = (float)corners[i];
      html_bytes_add(&html->meshes, &value, sizeof value);
    }
    fprintf(html->file, ",%zu,%u]", html->meshes.count, geom->triangle_count);
    html_bytes_add(&html->meshes, triangles, 3 * (size_t)geom->triangle_count * sizeof *triangles);
  }
  free(corners);
  free(triangles);
}

static void geom_write(run_html *html, uint32_t number, const hap_scene_geom *geom)
{
  const double colour[3] = {geom->colour_rgba[0], geom->colour_rgba[1], geom->colour_rgba[2]};
  const double *p = geom->pose.position;
  const double *q = geom->pose.quat_wxyz;
  const double pose[COORDINATES] = {p[0], p[1], p[2], q[0], q[1], q[2], q[3]};
  double reach = geom->radius + 0.5 * geom->length;
  reach = fmax(reach, 0.5 * sqrt(geom->edges[0] * geom->edges[0] + geom->edges[1] * geom->edges[1] +
                                 geom->edges[2] * geom->edges[2]));
  fprintf(html->file, "{\"body\":%d,\"shape\":%u,\"radius\":%.9g,\"length\":%.9g,\"reach\":%.9g,",
          geom->body == HAP_SCENE_WORLD ? -1 : (int)geom->body, geom->shape, geom->radius,
          geom->length, reach);
  numbers_write(html->file, "edges", geom->edges, 3);
  fputc(',', html->file);
  numbers_write(html->file, "pose", pose, COORDINATES);
  fputc(',', html->file);
  numbers_write(html->file, "colour", colour, 3);
  if (geom->triangle_count > 0) {
    mesh_write(html, number, geom);
  }
  fputs("}", html->file);
}

static void geoms_write(run_html *html)
{
  hap_scene_counts counts;
  bool any = false;
  fputs("\"geoms\":[", html->file);
  if (hap_scene_count(html->scene, &counts, sizeof counts) >= HAP_OK) {
    for (uint32_t i = 0; i < counts.geoms; ++i) {
      hap_scene_geom geom;
      if (hap_scene_get_geom(html->scene, i, &geom, sizeof geom) >= HAP_OK) {
        fputs(any ? ",\n" : "\n", html->file);
        geom_write(html, i, &geom);
        any = true;
      }
    }
  }
  fputs("],\n", html->file);
}

static void pointers_write(run_html *html)
{
  fputs("\"pointers\":[", html->file);
  for (size_t i = 0; i < html->now.pointer_count; ++i) {
    const view_pointer *p = &html->now.pointers[i];
    fprintf(html->file, "%s{\"radius\":%.9g,", i > 0 ? "," : "", p->radius);
    numbers_write(html->file, "half", p->half_edges, 3);
    fputc('}', html->file);
  }
  fputs("],\n\"roles\":[", html->file);
  for (int i = 0; i < ROLES; ++i) {
    static const char *const texts[ROLES] = {
        [HAP_ROLE_WORLD] = "in the world alone",   [HAP_ROLE_LOOP] = "in the haptic loop",
        [HAP_ROLE_RESTING] = "in the loop, rests", [HAP_ROLE_MEASURED] = "measured by tests",
        [HAP_ROLE_EDGE] = "at the edge",           [HAP_ROLE_DRIVEN] = "moved by the program"};
    float rgb[3];
    view_role_colour((hap_body_role)i, rgb);
    fprintf(html->file, "%s{\"text\":\"%s\",\"colour\":[%.3g,%.3g,%.3g]}", i > 0 ? "," : "",
            texts[i], (double)rgb[0], (double)rgb[1], (double)rgb[2]);
  }
  fputs("],\n", html->file);
}

/* ---- what moves ---- */

static double finite_or_zero(double value)
{
  return isfinite(value) ? value : 0.0;
}

typedef const double *(*turn_of_fn)(const view_frame *frame, size_t number);

/* q and -q are the same turn; the nearer one makes small steps. */
static void turn_column(run_html *html, size_t component, turn_of_fn of, size_t number)
{
  double sign = 1.0;
  const double *before = NULL;
  for (size_t i = 0; i < html->kept.count; ++i) {
    const double *q = of(&html->kept.list[i], number);
    if (before != NULL) {
      double along = before[0] * q[0] + before[1] * q[1] + before[2] * q[2] + before[3] * q[3];
      sign = along < 0.0 ? -sign : sign;
    }
    html->column[i] = finite_or_zero(sign * q[component]);
    before = q;
  }
}

static const double *body_turn(const view_frame *frame, size_t number)
{
  return frame->bodies[number].quat_wxyz;
}

static const double *pointer_turn(const view_frame *frame, size_t number)
{
  return frame->pointers[number].proxy.quat_wxyz;
}

static void column_put(run_html *html, size_t count)
{
  html_column_add(&html->motion, html->column, count, FINEST, html->file);
  fputs(",\n", html->file);
}

static void body_columns(run_html *html, size_t number)
{
  const run_history *kept = &html->kept;
  for (size_t k = 0; k < COORDINATES; ++k) {
    if (k < 3) {
      for (size_t i = 0; i < kept->count; ++i) {
        html->column[i] = finite_or_zero(kept->list[i].bodies[number].position[k]);
      }
    } else {
      turn_column(html, k - 3, body_turn, number);
    }
    column_put(html, kept->count);
  }
  for (size_t i = 0; i < kept->count; ++i) {
    html->column[i] = (double)kept->list[i].roles[number];
  }
  column_put(html, kept->count);
}

static void pointer_columns(run_html *html, size_t number)
{
  const run_history *kept = &html->kept;
  for (size_t k = 0; k < 3 + COORDINATES + 3; ++k) {
    if (k >= 6 && k < 3 + COORDINATES) {
      turn_column(html, k - 6, pointer_turn, number);
    } else {
      for (size_t i = 0; i < kept->count; ++i) {
        const view_pointer *p = &kept->list[i].pointers[number];
        html->column[i] = finite_or_zero(k < 3   ? p->device.position[k]
                                         : k < 6 ? p->proxy.position[k - 3]
                                                 : p->force[k - 3 - COORDINATES]);
      }
    }
    column_put(html, kept->count);
  }
}

static hap_status columns_write(run_html *html, hap_detail *detail)
{
  const run_history *kept = &html->kept;
  html->column = calloc(kept->count + 1, sizeof *html->column);
  if (html->column == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "--html: no memory for a page");
  }
  fprintf(html->file, "\"frames\":%zu,\"bodies\":%zu,\"peak_s\":%.9g,\"columns\":[\n", kept->count,
          html->now.body_count, PEAK_S);
  for (size_t i = 0; i < html->now.body_count; ++i) {
    body_columns(html, i);
  }
  for (size_t i = 0; i < html->now.pointer_count; ++i) {
    pointer_columns(html, i);
  }
  for (size_t i = 0; i < kept->count; ++i) {
    html->column[i] = kept->list[i].t;
  }
  column_put(html, kept->count);
  html_column_add(&html->motion, html->peaks, html->peak_count, FINEST, html->file);
  fputs("]}", html->file);
  return HAP_OK;
}

/* ---- the page ---- */

static void text_write(FILE *out, const char *text)
{
  for (; *text != '\0'; ++text) {
    if (strchr("<>&\"'", *text) != NULL) {
      fprintf(out, "&#%d;", *text);
    } else {
      fputc((unsigned char)*text < 0x20 ? ' ' : *text, out);
    }
  }
}

static hap_status mark_fill(run_html *html, const char *mark, size_t length, hap_detail *detail)
{
  if (strncmp(mark, "TITLE", length) == 0) {
    text_write(html->file, html->labels.title);
  } else if (strncmp(mark, "SUBTITLE", length) == 0) {
    text_write(html->file, html->labels.subtitle);
  } else if (strncmp(mark, "SCENE", length) == 0) {
    fputs("{\n", html->file);
    geoms_write(html);
    pointers_write(html);
    return columns_write(html, detail);
  } else if (strncmp(mark, "MOTION", length) == 0) {
    html->no_memory = html->no_memory || !html_bytes_write(&html->motion, html->file);
  } else {
    html->no_memory = html->no_memory || !html_bytes_write(&html->meshes, html->file);
  }
  return HAP_OK;
}

/* A mark is capitals between two @. */
static hap_status page_write(run_html *html, hap_detail *detail)
{
  for (const char *rest = run_html_page; *rest != '\0';) {
    size_t plain = strcspn(rest, "@");
    size_t length = rest[plain] == '@' ? strspn(rest + plain + 1, "ABCDEFGHIJKLMNOPQRSTUVWXYZ") : 0;
    bool is_mark = length > 0 && rest[plain + 1 + length] == '@';
    plain += rest[plain] == '@' && !is_mark;
    fwrite(rest, 1, plain, html->file);
    rest += plain;
    if (is_mark) {
      HAPI_TRY(mark_fill(html, rest + 1, length, detail));
      rest += length + 2;
    }
  }
  return HAP_OK;
}

static hap_status html_finish(run_html *html, hap_detail *detail)
{
  const char *path = html->options->html_path;
  if (html->kept.count == 0) {
    return hapi_fail(detail, HAP_ERROR_IO, "--html %.300s: the run was over before a first moment",
                     path);
  }
  HAPI_TRY(page_write(html, detail));
  if (html->no_memory) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "--html %.300s: no memory for so long a run", path);
  }
  bool good = ferror(html->file) == 0;
  good = fclose(html->file) == 0 && good;
  html->file = NULL;
  if (!good || rename(html->part, path) != 0) {
    int why = errno;
    (void)unlink(html->part);
    return hapi_fail(detail, HAP_ERROR_IO, "--html %.300s: cannot be written: %s", path,
                     strerror(why));
  }
  return HAP_OK;
}

hap_status run_html_close(run_html *html, hap_detail *detail)
{
  if (html == NULL) {
    return HAP_OK;
  }
  hap_status status = html_finish(html, detail);
  html_free(html);
  return status;
}

void run_html_drop(run_html *html)
{
  if (html != NULL) {
    html_free(html);
  }
}
