/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The reference: the whole world at 2 kHz or more in a plain ODE loop, and a sphere on a spring.
 * Nearest points are found here and not by dCollide. Of the library nothing is used. */

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/faults.h"

#define CONTACTS_PER_PAIR 8
#define SAME_POINT 1e-5 /* m */
#define TOUCHES_MAX 2048
#define GEOMS_MAX 2048

/* ---- vectors ---- */

static double vector_dot(const double a[3], const double b[3])
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double vector_length(const double a[3])
{
  return sqrt(vector_dot(a, a));
}

static void vector_between(const double from[3], const double to[3], double out[3])
{
  for (int i = 0; i < 3; ++i) {
    out[i] = to[i] - from[i];
  }
}

static void vector_along(const double from[3], double s, const double direction[3], double out[3])
{
  for (int i = 0; i < 3; ++i) {
    out[i] = from[i] + s * direction[i];
  }
}

static void vector_cross(const double a[3], const double b[3], double out[3])
{
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

static double clamp_to(double x, double least, double most)
{
  return x < least ? least : x > most ? most : x;
}

/* ---- the sphere and one geom ---- */

/* Where a sphere meets a surface. */
typedef struct touch {
  dBodyID body; /* NULL: it is fixed */
  double point[3];
  double normal[3]; /* out of the geom */
  double depth;     /* m */
} touch;

/* The side on which the sphere came to a box: beyond its middle the nearest face is another one. */
typedef struct side {
  bool held;
  int axis;
  double sign;
} side;

typedef struct pointer {
  double centre[3];
  double radius;
  touch touches[TOUCHES_MAX];
  size_t count;
  side sides[GEOMS_MAX]; /* of boxes, by number of the geom */
  double anchor[3];      /* of friction: where the pointer would be without slip */
  bool sticks;
} pointer;

static void touch_add(pointer *p, dGeomID geom, const double surface[3], const double normal[3],
                      double distance)
{
  if (distance >= p->radius || p->count == TOUCHES_MAX) {
    return;
  }
  touch *t = &p->touches[p->count++];
  t->body = dGeomGetBody(geom);
  memcpy(t->point, surface, sizeof t->point);
  memcpy(t->normal, normal, sizeof t->normal);
  t->depth = p->radius - distance;
}

/* A touch by the nearest point of a line or middle, from which the surface has a distance. */
static void touch_add_round(pointer *p, dGeomID geom, const double middle[3], double round)
{
  double normal[3];
  double surface[3];
  vector_between(middle, p->centre, normal);
  double length = vector_length(normal);
  if (length < 1e-12) {
    return; /* the middle has no nearest side */
  }
  for (int i = 0; i < 3; ++i) {
    normal[i] /= length;
  }
  vector_along(middle, round, normal, surface);
  touch_add(p, geom, surface, normal, length - round);
}

static void geom_to_local(dGeomID geom, const double at[3], double out[3])
{
  const dReal *x = dGeomGetPosition(geom);
  const dReal *R = dGeomGetRotation(geom);
  for (int i = 0; i < 3; ++i) {
    out[i] = R[i] * (at[0] - x[0]) + R[4 + i] * (at[1] - x[1]) + R[8 + i] * (at[2] - x[2]);
  }
}

static void geom_turn(dGeomID geom, const double local[3], double out[3])
{
  const dReal *R = dGeomGetRotation(geom);
  for (int i = 0; i < 3; ++i) {
    out[i] = R[4 * i] * local[0] + R[4 * i + 1] * local[1] + R[4 * i + 2] * local[2];
  }
}

static void touch_add_local(pointer *p, dGeomID geom, const double surface[3],
                            const double normal[3], double distance)
{
  const dReal *x = dGeomGetPosition(geom);
  double world_surface[3];
  double world_normal[3];
  geom_turn(geom, surface, world_surface);
  geom_turn(geom, normal, world_normal);
  vector_along(world_surface, 1.0, x, world_surface);
  touch_add(p, geom, world_surface, world_normal, distance);
}

/* The sphere keeps the side on which it came until its centre is outside again on that side, or
 * beside the face. */
static void box_touch(pointer *p, dGeomID geom, side *s)
{
  dVector3 sides;
  double c[3];
  double surface[3];
  double normal[3] = {0.0, 0.0, 0.0};
  double h[3];
  bool outside = false;
  bool behind = s->held;
  dGeomBoxGetLengths(geom, sides);
  geom_to_local(geom, p->centre, c);
  for (int i = 0; i < 3; ++i) {
    h[i] = 0.5 * sides[i];
    surface[i] = clamp_to(c[i], -h[i], h[i]);
    outside = outside || fabs(c[i]) > h[i];
    behind = behind && (i == s->axis ? s->sign * c[i] < h[i] : fabs(c[i]) <= h[i]);
  }
  if (outside && !behind) {
    vector_between(surface, c, normal);
    double distance = vector_length(normal);
    s->held = distance < p->radius;
    for (int i = 0; i < 3; ++i) {
      normal[i] /= distance;
      if (i == 0 || fabs(normal[i]) > fabs(normal[s->axis])) {
        s->axis = i;
        s->sign = normal[i] < 0.0 ? -1.0 : 1.0;
      }
    }
    touch_add_local(p, geom, surface, normal, distance);
    return;
  }
  if (!s->held) { /* the run begins inside */
    double nearest = -DBL_MAX;
    for (int i = 0; i < 3; ++i) {
      if (fabs(c[i]) - h[i] > nearest) {
        nearest = fabs(c[i]) - h[i];
        s->axis = i;
        s->sign = c[i] < 0.0 ? -1.0 : 1.0;
      }
    }
    s->held = true;
  }
  surface[s->axis] = s->sign * h[s->axis];
  normal[s->axis] = s->sign;
  touch_add_local(p, geom, surface, normal, s->sign * c[s->axis] - h[s->axis]);
}

static void capsule_touch(pointer *p, dGeomID geom)
{
  dReal radius;
  dReal length;
  double c[3];
  dGeomCapsuleGetParams(geom, &radius, &length);
  geom_to_local(geom, p->centre, c);
  double local[3] = {0.0, 0.0, clamp_to(c[2], -0.5 * length, 0.5 * length)};
  double middle[3];
  geom_turn(geom, local, middle);
  vector_along(middle, 1.0, dGeomGetPosition(geom), middle);
  touch_add_round(p, geom, middle, radius);
}

static void cylinder_touch(pointer *p, dGeomID geom)
{
  dReal radius;
  dReal length;
  double c[3];
  dGeomCylinderGetParams(geom, &radius, &length);
  geom_to_local(geom, p->centre, c);
  double rho = hypot(c[0], c[1]);
  const double x[2] = {rho > 0.0 ? c[0] / rho : 1.0, rho > 0.0 ? c[1] / rho : 0.0};
  double end = c[2] < 0.0 ? -1.0 : 1.0;
  double beside = rho - radius;
  double above = fabs(c[2]) - 0.5 * length;
  double surface[3] = {c[0], c[1], end * 0.5 * length};
  double normal[3] = {0.0, 0.0, end};
  double distance = above;
  if (beside > 0.0 && above > 0.0) {
    distance = hypot(beside, above);
    surface[0] = x[0] * radius;
    surface[1] = x[1] * radius;
    normal[0] = x[0] * beside / distance;
    normal[1] = x[1] * beside / distance;
    normal[2] = end * above / distance;
  } else if (beside > above) {
    distance = beside;
    surface[0] = x[0] * radius;
    surface[1] = x[1] * radius;
    surface[2] = c[2];
    normal[0] = x[0];
    normal[1] = x[1];
    normal[2] = 0.0;
  }
  touch_add_local(p, geom, surface, normal, distance);
}

/* ---- the sphere and a surface of triangles ---- */

typedef struct nearest {
  double point[3];
  double distance;  /* signed where the point is inside of the triangle */
  double normal[3]; /* of the triangle */
  bool inside;      /* not on an edge */
} nearest;

static void segment_nearest(const double a[3], const double b[3], const double c[3], double out[3])
{
  double along[3];
  double to[3];
  vector_between(a, b, along);
  vector_between(a, c, to);
  double s = clamp_to(vector_dot(along, to) / vector_dot(along, along), 0.0, 1.0);
  vector_along(a, s, along, out);
}

static void triangle_nearest(const double *v[3], const double c[3], nearest *out)
{
  double ab[3];
  double ac[3];
  double to[3];
  vector_between(v[0], v[1], ab);
  vector_between(v[0], v[2], ac);
  vector_between(v[0], c, to);
  vector_cross(ab, ac, out->normal);
  double area = vector_length(out->normal);
  for (int i = 0; i < 3; ++i) {
    out->normal[i] /= area;
  }
  double height = vector_dot(out->normal, to);
  vector_along(c, -height, out->normal, out->point);
  out->inside = true;
  out->distance = height;
  for (int i = 0; i < 3; ++i) {
    double edge[3];
    double in[3];
    double from[3];
    vector_between(v[i], v[(i + 1) % 3], edge);
    vector_cross(out->normal, edge, in);
    vector_between(v[i], out->point, from);
    out->inside = out->inside && vector_dot(in, from) > 0.0;
  }
  if (out->inside) {
    return;
  }
  out->distance = DBL_MAX;
  for (int i = 0; i < 3; ++i) {
    double q[3];
    double d[3];
    segment_nearest(v[i], v[(i + 1) % 3], c, q);
    vector_between(q, c, d);
    if (vector_length(d) < out->distance) {
      out->distance = vector_length(d);
      memcpy(out->point, q, sizeof q);
    }
  }
}

static void mesh_corners(const faults_mesh *m, size_t triangle, const double *out[3])
{
  for (int i = 0; i < 3; ++i) {
    out[i] = &m->vertices[3 * m->indices[3 * triangle + (size_t)i]];
  }
}

/* A point of an edge or corner is a place where the surface is nearest only when no triangle that
 * it belongs to comes nearer. */
static bool mesh_point_holds(const faults_mesh *m, const nearest *n, const double centre[3])
{
  for (size_t i = 0; i < m->triangle_count; ++i) {
    const double *v[3];
    nearest at_point;
    nearest other;
    mesh_corners(m, i, v);
    triangle_nearest(v, n->point, &at_point);
    if (fabs(at_point.distance) < 1e-9) {
      triangle_nearest(v, centre, &other);
      if (fabs(other.distance) < n->distance - 1e-12) {
        return false;
      }
    }
  }
  return true;
}

static bool mesh_point_known(const pointer *p, size_t first, const double point[3])
{
  for (size_t i = first; i < p->count; ++i) {
    double d[3];
    vector_between(p->touches[i].point, point, d);
    if (vector_length(d) < SAME_POINT) {
      return true;
    }
  }
  return false;
}

/* Faces first: a point close to an edge is the face's alone. */
static void mesh_touch(pointer *p, const faults_mesh *m)
{
  size_t first = p->count;
  for (int edges = 0; edges < 2; ++edges) {
    for (size_t i = 0; i < m->triangle_count; ++i) {
      const double *v[3];
      nearest n;
      mesh_corners(m, i, v);
      triangle_nearest(v, p->centre, &n);
      if (n.inside != (edges == 0) || fabs(n.distance) >= p->radius) {
        continue;
      }
      if (mesh_point_known(p, first, n.point)) {
        continue;
      }
      if (n.inside) {
        touch_add(p, m->geom, n.point, n.normal, n.distance);
      } else if (mesh_point_holds(m, &n, p->centre)) {
        touch_add_round(p, m->geom, n.point, 0.0);
      }
    }
  }
}

/* ---- the sphere and the world ---- */

static void geom_touch(pointer *p, const faults_world *w, dGeomID geom, side *s)
{
  if (w->mesh.geom == geom) {
    mesh_touch(p, &w->mesh);
    return;
  }
  switch (dGeomGetClass(geom)) {
    case dSphereClass:
      touch_add_round(p, geom, dGeomGetPosition(geom), dGeomSphereGetRadius(geom));
      break;
    case dBoxClass:
      box_touch(p, geom, s);
      break;
    case dCapsuleClass:
      capsule_touch(p, geom);
      break;
    case dCylinderClass:
      cylinder_touch(p, geom);
      break;
    case dPlaneClass: {
      dVector4 plane;
      double surface[3];
      dGeomPlaneGetParams(geom, plane);
      double distance = vector_dot(plane, p->centre) - plane[3];
      vector_along(p->centre, -distance, plane, surface);
      touch_add(p, geom, surface, plane, distance);
      break;
    }
    default:
      break; /* no scene has others */
  }
}

static void pointer_look(pointer *p, const faults_world *w)
{
  p->count = 0;
  int geoms = dSpaceGetNumGeoms(w->space);
  for (int i = 0; i < geoms && i < GEOMS_MAX; ++i) {
    /* ODE hands geoms out in another order when one has moved: the number is in the data. */
    dGeomID geom = dSpaceGetGeom(w->space, i);
    size_t number = (size_t)dGeomGetData(geom);
    geom_touch(p, w, geom, &p->sides[number]);
  }
}

/* Force of Coulomb friction on the hand: a spring to where it stuck, as stiff as the contact. */
static void pointer_rub(pointer *p, const faults_motion *m, double pushed, double out[3])
{
  const double *n = p->touches[0].normal;
  if (!p->sticks) {
    memcpy(p->anchor, p->centre, sizeof p->anchor);
    p->sticks = true;
  }
  double stretch[3];
  vector_between(p->centre, p->anchor, stretch);
  vector_along(stretch, -vector_dot(stretch, n), n, stretch);
  double length = vector_length(stretch);
  double most = m->friction * pushed / m->stiffness;
  double kept = length > most ? most / length : 1.0;
  for (int i = 0; i < 3; ++i) {
    out[i] = m->stiffness * kept * stretch[i];
    p->anchor[i] = p->centre[i] + kept * stretch[i];
  }
}

/* Of spring and damper along the normal; they do not pull. */
static double touch_push(const touch *t, const faults_motion *m, const double velocity[3])
{
  dVector3 body = {0.0, 0.0, 0.0};
  double to_body[3];
  if (t->body != NULL) {
    dBodyGetPointVel(t->body, t->point[0], t->point[1], t->point[2], body);
  }
  vector_between(velocity, body, to_body);
  return fmax(0.0, m->stiffness * t->depth + m->damping * vector_dot(t->normal, to_body));
}

/* Force on the hand; the bodies get the opposite. */
static void pointer_push(pointer *p, const faults_motion *m, const double velocity[3],
                         double out_force[3])
{
  double rub[3] = {0.0, 0.0, 0.0};
  if (p->count == 0) {
    p->sticks = false;
  } else if (m->friction > 0.0) {
    pointer_rub(p, m, touch_push(&p->touches[0], m, velocity), rub);
  }
  memset(out_force, 0, 3 * sizeof *out_force);
  for (size_t i = 0; i < p->count; ++i) {
    const touch *t = &p->touches[i];
    double push = touch_push(t, m, velocity);
    double f[3];
    for (int k = 0; k < 3; ++k) {
      f[k] = push * t->normal[k] + (i == 0 ? rub[k] : 0.0);
      out_force[k] += f[k];
    }
    if (t->body != NULL) {
      dBodyAddForceAtPos(t->body, -f[0], -f[1], -f[2], t->point[0], t->point[1], t->point[2]);
    }
  }
}

/* ---- the world ---- */

static void geoms_collide(void *data, dGeomID a, dGeomID b)
{
  faults_world *w = data;
  dContact contacts[CONTACTS_PER_PAIR];
  dBodyID x = dGeomGetBody(a);
  dBodyID y = dGeomGetBody(b);
  bool is_x_fixed = x == NULL || dBodyIsKinematic(x) != 0;
  bool is_y_fixed = y == NULL || dBodyIsKinematic(y) != 0;
  if ((is_x_fixed && is_y_fixed) || (x != NULL && x == y)) {
    return;
  }
  memset(contacts, 0, sizeof contacts);
  int count = dCollide(a, b, CONTACTS_PER_PAIR, &contacts[0].geom, sizeof contacts[0]);
  for (int i = 0; i < count; ++i) {
    if (fabs(vector_length(contacts[i].geom.normal) - 1.0) > 0.01) {
      continue;
    }
    contacts[i].surface.mode = dContactApprox1;
    contacts[i].surface.mu = w->mu;
    dJointID joint = dJointCreateContact(w->world, w->own_contacts, &contacts[i]);
    dJointAttach(joint, x, y);
  }
}

void faults_world_collide(faults_world *w)
{
  dJointGroupEmpty(w->own_contacts);
  dSpaceCollide(w->space, w, geoms_collide);
}

/* Energy of motion and height [J]. */
static double world_energy(const faults_world *w)
{
  dVector3 gravity;
  double sum = 0.0;
  dWorldGetGravity(w->world, gravity);
  for (size_t i = 0; i < w->body_count; ++i) {
    dMass mass;
    dVector3 turn;
    double momentum[3];
    if (dBodyIsKinematic(w->bodies[i])) {
      continue;
    }
    dBodyGetMass(w->bodies[i], &mass);
    const dReal *v = dBodyGetLinearVel(w->bodies[i]);
    const dReal *o = dBodyGetAngularVel(w->bodies[i]);
    dBodyVectorFromWorld(w->bodies[i], o[0], o[1], o[2], turn);
    for (int k = 0; k < 3; ++k) {
      momentum[k] = vector_dot(&mass.I[4 * k], turn);
    }
    sum += 0.5 * mass.mass * vector_dot(v, v) + 0.5 * vector_dot(turn, momentum) -
           mass.mass * vector_dot(gravity, dBodyGetPosition(w->bodies[i]));
  }
  return sum;
}

static double pointer_energy(const pointer *p, const faults_motion *m)
{
  double sum = 0.0;
  for (size_t i = 0; i < p->count; ++i) {
    sum += 0.5 * m->stiffness * p->touches[i].depth * p->touches[i].depth;
  }
  return sum;
}

bool faults_reference_run(const faults_scene *scene, double rate_hz, faults_run *out)
{
  faults_world w;
  pointer *p = calloc(1, sizeof *p);
  double h = 1.0 / rate_hz;
  double body_h = scene->slow > 0.0 ? scene->slow * h : h;
  if (p == NULL || !faults_run_create(scene, out) || !faults_world_create(scene, true, &w)) {
    free(p);
    return false;
  }
  dRandSetSeed(1);
  int geoms = dSpaceGetNumGeoms(w.space);
  for (int i = 0; i < geoms; ++i) {
    dGeomSetData(dSpaceGetGeom(w.space, i), (void *)(size_t)i);
  }
  p->radius = scene->motion.radius;
  dWorldSetQuickStepNumIterations(w.world, scene->check.iterations);
  size_t steps = (size_t)lround(scene->seconds * rate_hz);
  size_t per_tick = (size_t)lround(FAULTS_TICK_S * rate_hz);
  double force[3] = {0.0, 0.0, 0.0};
  double before[3] = {0.0, 0.0, 0.0};
  double work = 0.0; /* of the hand, on top of the energy at the begin */
  for (size_t n = 0; n < steps; ++n) {
    double t = (double)n * h;
    double velocity[3];
    double moved[3];
    faults_hand(&scene->motion, t, p->centre, velocity);
    vector_between(before, p->centre, moved);
    memcpy(before, p->centre, sizeof before);
    pointer_look(p, &w);
    double energy = world_energy(&w) + pointer_energy(p, &scene->motion);
    work -= 0.5 * vector_dot(force, moved);
    pointer_push(p, &scene->motion, velocity, force);
    if (n == 0) {
      work = energy;
    } else {
      work -= 0.5 * vector_dot(force, moved);
    }
    out->energy_off = fmax(out->energy_off, fabs(energy - work));
    if (n % per_tick == 0) {
      memcpy(out->force[n / per_tick], force, sizeof force);
      out->told[n / per_tick] = w.told;
    }
    if (scene->before != NULL) {
      scene->before(&w, t, t + h);
    }
    faults_world_collide(&w);
    if (scene->check.iterations > 0) {
      dWorldQuickStep(w.world, body_h);
    } else {
      dWorldStep(w.world, body_h);
    }
    if (scene->after != NULL) {
      scene->after(&w, t, t + h);
    }
    out->joint_open = fmax(out->joint_open, faults_world_open(&w));
  }
  faults_world_destroy(&w);
  free(p);
  return true;
}
