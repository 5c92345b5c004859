/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "view/things.h"

#include <stdio.h>
#include <stdlib.h>

#define MARKS_MAX 256      /* instances of a shared mesh beside the scene's */
#define TINT_SHARE 0.82F   /* of the treatment's colour; the rest is the body's own */
#define BEVEL_SHARE 0.05F  /* of a box's shortest edge: corners catch light */
#define ARROW_PER_N 0.045F /* of the scene's size */
#define ARROW_MAX 1.1F     /* likewise */
#define FORCE_MIN_N 0.02F
#define FLOOR_REACH 60.0F /* of the scene's size */
#define STRAY 4.0F        /* times as far from the middle as the mean: one of eight cannot be */
#define GIANT 4.0F        /* a pointer so many times as large as the scene is not drawn */

static const hap_pose identity = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};

/* ---- colours ---- */

static void colour_set(gpu_instance *io, const float srgb[3], float alpha)
{
  for (int i = 0; i < 3; ++i) {
    io->colour[i] = powf(srgb[i], 2.2F);
  }
  io->colour[3] = alpha;
}

static void colour_tint(const float own[4], hap_body_role role, gpu_instance *io)
{
  float tint[3];
  view_role_colour(role, tint);
  for (int i = 0; i < 3; ++i) {
    tint[i] = TINT_SHARE * tint[i] + (1.0F - TINT_SHARE) * own[i];
  }
  colour_set(io, tint, 1.0F);
}

/* ---- reading a scene ---- */

static hap_status memory_fails(hap_detail *detail)
{
  if (detail != NULL) {
    snprintf(detail->text, sizeof detail->text, "no memory for a picture of the scene");
  }
  return HAP_ERROR_MEMORY;
}

static bool geom_mesh(const hap_scene *scene, uint32_t number, const hap_scene_geom *geom,
                      shape_mesh *out)
{
  double *vertices = calloc(geom->vertex_count, 3 * sizeof *vertices);
  uint32_t *triangles = calloc(geom->triangle_count, 3 * sizeof *triangles);
  bool good = vertices != NULL && triangles != NULL &&
              hap_scene_mesh(scene, number, vertices, geom->vertex_count, triangles,
                             geom->triangle_count) >= HAP_OK &&
              shape_make_triangles(vertices, geom->vertex_count, triangles, geom->triangle_count,
                                   geom->shape == HAP_SHAPE_FIELD, out);
  free(vertices);
  free(triangles);
  return good;
}

static float mesh_extent(const shape_mesh *mesh)
{
  float most = 0.0F;
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    most = fmaxf(most, view_dot(mesh->vertices[i].offset, mesh->vertices[i].offset));
  }
  return sqrtf(most);
}

static void box_set(thing *io, const double half[3], float bevel)
{
  float sum = 0.0F;
  io->mesh = THING_BOX;
  io->instance.bevel = bevel;
  for (int i = 0; i < 3; ++i) {
    io->instance.extent[i] = (float)half[i] - bevel;
    sum += (float)(half[i] * half[i]);
  }
  io->extent = sqrtf(sum);
}

static void shape_set(thing *io, const hap_scene_geom *geom)
{
  gpu_instance *g = &io->instance;
  const float radius = (float)geom->radius;
  const float half = 0.5F * (float)geom->length;
  const double halves[3] = {0.5 * geom->edges[0], 0.5 * geom->edges[1], 0.5 * geom->edges[2]};
  switch ((hap_shape)geom->shape) {
    case HAP_SHAPE_SPHERE:
    case HAP_SHAPE_CAPSULE:
      io->mesh = THING_ROUND;
      g->bevel = radius;
      g->extent[2] = geom->shape == HAP_SHAPE_CAPSULE ? half : 0.0F;
      io->extent = radius + g->extent[2];
      break;
    case HAP_SHAPE_BOX:
      box_set(io, halves, 2.0F * BEVEL_SHARE * (float)fmin(halves[0], fmin(halves[1], halves[2])));
      break;
    case HAP_SHAPE_CYLINDER:
      io->mesh = THING_CYLINDER;
      g->bevel = BEVEL_SHARE * fminf(radius, half);
      g->extent[0] = g->extent[1] = radius - g->bevel;
      g->extent[2] = half - g->bevel;
      io->extent = sqrtf(radius * radius + half * half);
      break;
    case HAP_SHAPE_PLANE:
      io->mesh = THING_FLOOR;
      break;
    case HAP_SHAPE_MESH:
    case HAP_SHAPE_FIELD:
      g->extent[0] = g->extent[1] = g->extent[2] = 1.0F;
      break;
  }
}

static hap_status geom_read(const hap_scene *scene, uint32_t number, things *io)
{
  hap_scene_geom geom;
  if (hap_scene_get_geom(scene, number, &geom, sizeof geom) < HAP_OK) {
    return HAP_OK; /* it was removed */
  }
  thing *t = &io->list[io->count++];
  *t = (thing){.body = geom.body, .pose = geom.pose, .instance = {.gloss = 0.45F}};
  memcpy(t->instance.colour, geom.colour_rgba, sizeof t->instance.colour);
  shape_set(t, &geom);
  if (geom.shape == HAP_SHAPE_MESH || geom.shape == HAP_SHAPE_FIELD) {
    shape_mesh mesh;
    if (!geom_mesh(scene, number, &geom, &mesh)) {
      return HAP_ERROR_MEMORY;
    }
    t->mesh = (uint32_t)io->batch_count++;
    t->extent = mesh_extent(&mesh);
    gpu_mesh_make(&mesh, &io->batches[t->mesh].mesh);
    shape_free(&mesh);
  }
  ++io->batches[t->mesh].capacity;
  return HAP_OK;
}

/* A point or direction of the world, in a frame. */
static void vector_into(const hap_pose *frame, const double in[3], bool is_point, double out[3])
{
  hap_pose turn = {.quat_wxyz = {frame->quat_wxyz[0], -frame->quat_wxyz[1], -frame->quat_wxyz[2],
                                 -frame->quat_wxyz[3]}};
  double v[3];
  float turned[3];
  for (int i = 0; i < 3; ++i) {
    v[i] = in[i] - (is_point ? frame->position[i] : 0.0);
  }
  view_transform(&turn, v, turned);
  for (int i = 0; i < 3; ++i) {
    out[i] = (double)turned[i];
  }
}

static float body_extent(const things *of, uint32_t body)
{
  float largest = 0.0F;
  for (size_t i = 0; i < of->count; ++i) {
    const thing *t = &of->list[i];
    largest = t->body == body ? fmaxf(largest, t->extent) : largest;
  }
  return largest;
}

static void axes_read(const hap_scene *scene, uint32_t joints, things *io)
{
  for (uint32_t i = 0; i < joints; ++i) {
    hap_scene_joint joint;
    hap_scene_body body;
    bool there = hap_scene_get_joint(scene, i, &joint, sizeof joint) >= HAP_OK &&
                 hap_scene_get_body(scene, joint.body_a, &body, sizeof body) >= HAP_OK;
    for (uint32_t k = 0; there && k < joint.axes; ++k) {
      thing_axis *axis = &io->axes[io->axis_count++];
      axis->body = joint.body_a;
      vector_into(&body.pose, joint.anchor, true, axis->anchor);
      vector_into(&body.pose, joint.axis[k], false, axis->direction);
      axis->extent = body_extent(io, joint.body_a);
    }
  }
}

static bool shared_meshes_make(things *io)
{
  static const double corners[] = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
  static const uint32_t floor_triangles[] = {0, 1, 2, 0, 2, 3};
  bool good = true;
  for (int i = 0; i < THING_MESHES && good; ++i) {
    shape_mesh mesh;
    switch ((thing_mesh)i) {
      case THING_BOX:
        good = shape_make_corners(2, &mesh);
        break;
      case THING_ROUND:
        good = shape_make_corners(12, &mesh);
        break;
      case THING_CYLINDER:
        good = shape_make_cylinder(12, &mesh);
        break;
      case THING_CONE:
        good = shape_make_cone(10, &mesh);
        break;
      case THING_FLOOR:
      case THING_MESHES:
        good = shape_make_triangles(corners, 4, floor_triangles, 2, false, &mesh);
        break;
    }
    if (good) {
      gpu_mesh_make(&mesh, &io->batches[i].mesh);
      shape_free(&mesh);
    }
  }
  return good;
}

hap_status things_read(const hap_scene *scene, things *out, hap_detail *detail)
{
  hap_scene_counts counts = {0};
  memset(out, 0, sizeof *out);
  if (scene != NULL) {
    (void)hap_scene_count(scene, &counts, sizeof counts);
  }
  out->batch_count = THING_MESHES;
  out->list = calloc(counts.geoms + 1, sizeof *out->list);
  out->axes = calloc(2 * (size_t)counts.joints + 1, sizeof *out->axes);
  out->balls = calloc(counts.geoms + 2 * VIEW_POINTERS_MAX, sizeof *out->balls);
  out->batches = calloc(THING_MESHES + counts.geoms, sizeof *out->batches);
  if (out->list == NULL || out->axes == NULL || out->balls == NULL || out->batches == NULL ||
      !shared_meshes_make(out)) {
    return memory_fails(detail);
  }
  for (uint32_t i = 0; i < counts.geoms; ++i) {
    if (geom_read(scene, i, out) < HAP_OK) {
      return memory_fails(detail);
    }
  }
  axes_read(scene, counts.joints, out);
  for (size_t i = 0; i < out->batch_count; ++i) {
    out->batches[i].capacity += MARKS_MAX + out->axis_count;
    out->batches[i].list = calloc(out->batches[i].capacity, sizeof *out->batches[i].list);
    if (out->batches[i].list == NULL) {
      return memory_fails(detail);
    }
  }
  return HAP_OK;
}

void things_free(things *of)
{
  for (size_t i = 0; i < of->batch_count && of->batches != NULL; ++i) {
    gpu_mesh_free(&of->batches[i].mesh);
    free(of->batches[i].list);
  }
  free(of->batches);
  free(of->list);
  free(of->axes);
  free(of->balls);
  memset(of, 0, sizeof *of);
}

/* ---- a frame ---- */

static const hap_pose *frame_of(const view_frame *frame, uint32_t body)
{
  return body < frame->body_count ? &frame->bodies[body] : &identity;
}

static float pointer_extent(const view_pointer *pointer)
{
  const double *h = pointer->half_edges;
  return (float)(pointer->radius + sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]));
}

static float ball_distance(const camera_ball *ball, const float from[3])
{
  const float *c = ball->centre;
  const float v[3] = {c[0] - from[0], c[1] - from[1], c[2] - from[2]};
  return sqrtf(view_dot(v, v));
}

/* Leaves out the few that have rolled or flown away: all others would be specks. */
static size_t strays_drop(camera_ball *balls, size_t count)
{
  float middle[3] = {0.0F, 0.0F, 0.0F};
  float mean = 0.0F;
  size_t kept = 0;
  for (size_t i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) {
      middle[k] += balls[i].centre[k] / (float)count;
    }
  }
  for (size_t i = 0; i < count; ++i) {
    mean += ball_distance(&balls[i], middle) / (float)count;
  }
  for (size_t i = 0; i < count; ++i) {
    if (ball_distance(&balls[i], middle) <= STRAY * mean + balls[i].radius) {
      balls[kept++] = balls[i];
    }
  }
  return kept;
}

/* All that moves, then what stands about and is not much larger. Gives the largest that moves. */
static size_t bodies_balls(const things *of, const view_frame *frame, float *out_largest)
{
  size_t count = 0;
  float largest = 0.0F;
  for (int standing = 0; standing < 2; ++standing) {
    count = strays_drop(of->balls, count); /* of what moves */
    for (size_t i = 0; i < of->count; ++i) {
      const thing *t = &of->list[i];
      bool stands = t->body == HAP_SCENE_WORLD;
      if (stands != (standing == 1) || t->extent <= 0.0F ||
          (stands && largest > 0.0F && t->extent > 6.0F * largest)) {
        continue;
      }
      camera_ball *ball = &of->balls[count++];
      view_transform(frame_of(frame, t->body), t->pose.position, ball->centre);
      ball->radius = t->extent;
      largest = stands ? largest : fmaxf(largest, t->extent);
    }
  }
  *out_largest = largest;
  return count;
}

size_t things_balls(const things *of, const view_frame *frame, float *out_size)
{
  float from[3];
  float largest;
  size_t count = bodies_balls(of, frame, &largest);
  for (size_t i = 0; i < frame->pointer_count; ++i) {
    float extent = pointer_extent(&frame->pointers[i]);
    if (count == 0 || extent < 2.0F * GIANT * largest) {
      camera_ball *ball = &of->balls[count++];
      view_transform(&frame->pointers[i].proxy, (const double[3]){0.0, 0.0, 0.0}, ball->centre);
      ball->radius = 2.0F * extent;
    }
  }
  *out_size = camera_bound(of->balls, count);
  for (size_t i = 0; i < frame->pointer_count; ++i) {
    camera_ball *ball = &of->balls[count];
    count += things_arrow(&frame->pointers[i], *out_size, from, ball->centre);
    ball->radius = 0.02F * *out_size;
  }
  return count;
}

static gpu_instance *instance_add(things *io, uint32_t mesh)
{
  thing_batch *batch = &io->batches[mesh];
  if (batch->count == batch->capacity) {
    return &batch->list[batch->count - 1]; /* too many marks: the last one gives way */
  }
  gpu_instance *g = &batch->list[batch->count++];
  memset(g, 0, sizeof *g);
  g->turn[0] = 1.0F;
  return g;
}

static void bodies_place(things *io, const view_frame *frame, float size)
{
  static const float floor_colour[3] = {0.84F, 0.84F, 0.83F};
  for (size_t i = 0; i < io->count; ++i) {
    const thing *t = &io->list[i];
    const hap_pose *body = frame_of(frame, t->body);
    gpu_instance *g = instance_add(io, t->mesh);
    *g = t->instance;
    view_transform(body, t->pose.position, g->place);
    view_quat_product(body->quat_wxyz, t->pose.quat_wxyz, g->turn);
    if (t->extent <= 0.0F) {
      g->extent[0] = g->extent[1] = FLOOR_REACH * size;
      g->gloss = -2.0F;
      colour_set(g, floor_colour, 1.0F);
    } else if (t->body < frame->body_count) {
      colour_tint(t->instance.colour, frame->roles[t->body], g);
    } else {
      colour_set(g, t->instance.colour, 1.0F);
    }
  }
}

static void pointer_place(things *io, const view_pointer *p, const hap_pose *pose,
                          const float colour[4])
{
  const bool is_box = p->half_edges[0] > 0.0;
  gpu_instance *g = instance_add(io, is_box ? THING_BOX : THING_ROUND);
  view_transform(pose, (const double[3]){0.0, 0.0, 0.0}, g->place);
  for (int i = 0; i < 4; ++i) {
    g->turn[i] = (float)pose->quat_wxyz[i];
  }
  for (int i = 0; i < 3; ++i) {
    g->extent[i] = (float)p->half_edges[i];
  }
  g->bevel = (float)p->radius;
  g->gloss = 0.8F;
  colour_set(g, colour, colour[3]);
}

/* A stick from a to b. */
static void stick_place(things *io, const float a[3], const float b[3], float radius,
                        const float colour[3])
{
  gpu_instance *g = instance_add(io, THING_CYLINDER);
  float along[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const float length = sqrtf(view_dot(along, along));
  view_normalize(along);
  view_quat_from_z(along, g->turn);
  for (int i = 0; i < 3; ++i) {
    g->place[i] = 0.5F * (a[i] + b[i]);
  }
  g->extent[0] = g->extent[1] = radius;
  g->extent[2] = 0.5F * length;
  g->gloss = -1.0F;
  colour_set(g, colour, 1.0F);
}

bool things_arrow(const view_pointer *pointer, float size, float out_from[3], float out_to[3])
{
  float way[3] = {(float)pointer->force[0], (float)pointer->force[1], (float)pointer->force[2]};
  const float force = sqrtf(view_dot(way, way));
  /* of one that is much larger than the scene at the side that is pushed */
  const float begin =
      (pointer_extent(pointer) > GIANT * size ? -1.0F : 1.0F) * (float)pointer->radius;
  view_normalize(way);
  for (int i = 0; i < 3; ++i) {
    out_from[i] = (float)pointer->proxy.position[i] + begin * way[i];
    out_to[i] = out_from[i] + size * fminf(ARROW_PER_N * force, ARROW_MAX) * way[i];
  }
  return force > FORCE_MIN_N;
}

static void arrow_place(things *io, const view_pointer *pointer, float size)
{
  static const float colour[3] = {0.05F, 0.68F, 0.32F};
  float from[3];
  float to[3];
  float neck[3];
  if (!things_arrow(pointer, size, from, to)) {
    return;
  }
  float way[3] = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
  const float length = sqrtf(view_dot(way, way));
  const float head = fminf(0.075F * size, 0.5F * length);
  view_normalize(way);
  for (int i = 0; i < 3; ++i) {
    neck[i] = to[i] - head * way[i];
  }
  stick_place(io, from, neck, 0.19F * head, colour);
  gpu_instance *tip = instance_add(io, THING_CONE);
  memcpy(tip->place, neck, sizeof neck);
  view_quat_from_z(way, tip->turn);
  tip->extent[0] = tip->extent[1] = 0.46F * head;
  tip->extent[2] = head;
  tip->gloss = -1.0F;
  colour_set(tip, colour, 1.0F);
}

static void touch_place(things *io, const view_touch *touch, float size)
{
  static const float colour[3] = {1.0F, 0.93F, 0.30F};
  float from[3];
  float to[3];
  for (int i = 0; i < 3; ++i) {
    from[i] = (float)touch->point[i];
    to[i] = from[i] + 0.10F * size * (float)touch->normal[i];
  }
  stick_place(io, from, to, 0.006F * size, colour);
  gpu_instance *dot = instance_add(io, THING_ROUND);
  memcpy(dot->place, from, sizeof from);
  dot->bevel = 0.016F * size;
  dot->gloss = -1.0F;
  colour_set(dot, colour, 1.0F);
}

/* Through the body and not much longer, so that of a long chain more is seen than its axes. */
static void axis_place(things *io, const thing_axis *axis, const view_frame *frame, float size)
{
  static const float colour[3] = {0.16F, 0.18F, 0.22F};
  const float through = 1.2F * axis->extent;
  const float half = through > 0.0F ? fminf(0.09F * size, through) : 0.09F * size;
  const hap_pose *body = frame_of(frame, axis->body);
  double ends[2][3];
  float world[2][3];
  for (int k = 0; k < 2; ++k) {
    for (int i = 0; i < 3; ++i) {
      ends[k][i] = axis->anchor[i] + (k == 0 ? -1.0 : 1.0) * (double)half * axis->direction[i];
    }
    view_transform(body, ends[k], world[k]);
  }
  stick_place(io, world[0], world[1], 0.08F * half, colour);
}

/* The string that a hand is pulled by, and its end. */
static void pull_place(things *io, const view_pointer *pointer, float size)
{
  static const float colour[3] = {0.16F, 0.18F, 0.22F};
  float from[3];
  float to[3];
  for (int i = 0; i < 3; ++i) {
    from[i] = (float)pointer->device.position[i];
    to[i] = (float)pointer->pull[i];
  }
  stick_place(io, from, to, 0.0035F * size, colour);
  gpu_instance *end = instance_add(io, THING_ROUND);
  memcpy(end->place, to, sizeof to);
  end->bevel = 0.011F * size;
  end->gloss = -1.0F;
  colour_set(end, colour, 1.0F);
}

static bool device_differs(const view_pointer *p)
{
  const double *a = p->proxy.position;
  const double *b = p->device.position;
  return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]) > 0.02 * p->radius + 1e-6;
}

static void marks_place(things *io, const view_frame *frame, float size)
{
  for (size_t i = 0; i < frame->pointer_count; ++i) {
    arrow_place(io, &frame->pointers[i], size);
    if (frame->pointers[i].is_pulled) {
      pull_place(io, &frame->pointers[i], size);
    }
  }
  for (size_t i = 0; i < frame->touch_count; ++i) {
    touch_place(io, &frame->touches[i], size);
  }
  for (size_t i = 0; i < io->axis_count; ++i) {
    axis_place(io, &io->axes[i], frame, size);
  }
}

void things_place(things *io, const view_frame *frame, float size)
{
  static const float hand[4] = {0.86F, 0.13F, 0.17F, 1.0F};
  static const float ghost[4] = {0.86F, 0.13F, 0.17F, 0.30F};
  for (size_t i = 0; i < io->batch_count; ++i) {
    io->batches[i].count = 0;
  }
  bodies_place(io, frame, size);
  for (size_t i = 0; i < frame->pointer_count; ++i) {
    if (pointer_extent(&frame->pointers[i]) < GIANT * size) {
      pointer_place(io, &frame->pointers[i], &frame->pointers[i].proxy, hand);
    }
  }
  for (size_t i = 0; i < io->batch_count; ++i) {
    io->batches[i].solid = io->batches[i].count;
  }
  marks_place(io, frame, size);
  for (size_t i = 0; i < io->batch_count; ++i) {
    io->batches[i].marked = io->batches[i].count;
  }
  for (size_t i = 0; i < frame->pointer_count; ++i) {
    const view_pointer *p = &frame->pointers[i];
    if (pointer_extent(p) < GIANT * size && device_differs(p)) {
      pointer_place(io, p, &p->device, ghost);
    }
  }
  for (size_t i = 0; i < io->batch_count; ++i) {
    gpu_mesh_load(&io->batches[i].mesh, io->batches[i].list, io->batches[i].count);
  }
}

/* ---- what is seen where ---- */

/* Half the edges of the box around it, in the geom's frame. */
static void thing_box(const thing *t, double out[3])
{
  for (int i = 0; i < 3; ++i) {
    const bool own = t->mesh >= THING_MESHES;
    out[i] = (double)(own ? t->extent : t->instance.extent[i] + t->instance.bevel);
  }
}

/* How far along a line the box is entered; negative: it is not met. */
static double box_depth(const double half[3], const double from[3], const double way[3])
{
  double near = 0.0;
  double far = INFINITY;
  for (int i = 0; i < 3; ++i) {
    const double slope = fabs(way[i]) > 1e-12 ? way[i] : 1e-12;
    const double a = (-half[i] - from[i]) / slope;
    const double b = (half[i] - from[i]) / slope;
    near = fmax(near, fmin(a, b));
    far = fmin(far, fmax(a, b));
  }
  return near <= far ? near : -1.0;
}

uint32_t things_hit(const things *of, const view_frame *frame, const double eye[3],
                    const double way[3], double *out_depth)
{
  uint32_t body = HAP_SCENE_WORLD;
  double best = INFINITY;
  for (size_t i = 0; i < of->count; ++i) {
    const thing *t = &of->list[i];
    double half[3];
    double points[2][2][3];
    if (t->extent <= 0.0F) {
      continue;
    }
    thing_box(t, half);
    vector_into(frame_of(frame, t->body), eye, true, points[0][0]);
    vector_into(frame_of(frame, t->body), way, false, points[0][1]);
    vector_into(&t->pose, points[0][0], true, points[1][0]);
    vector_into(&t->pose, points[0][1], false, points[1][1]);
    const double depth = box_depth(half, points[1][0], points[1][1]);
    if (depth > 0.0 && depth < best) {
      best = depth;
      body = t->body;
    }
  }
  *out_depth = best < INFINITY ? best : 0.0;
  return body;
}
