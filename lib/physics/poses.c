/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/pose.h"
#include "physics/physics_internal.h"

/* The world's poses for those who draw: a frame of all bodies at each step, and the time that is
 * drawn.
 *
 * What is drawn lies behind by a delay: one step H, so that there is a frame after it as well as
 * one before, or as much longer as frames really come late: physics needs its time to compute
 * them, a frame loop asks for them when it draws, a world that is too large takes longer than H.
 * A single hitch does not count. The delay follows slowly, so that the time that is drawn runs
 * neither back nor visibly faster. */

#define DELAY_MOST 6.0         /* H */
#define HITCH 0.5              /* H, that a single wait is longer than all others */
#define DELAY_RISES 0.25       /* s a second: drawn time goes at three quarters of its pace */
#define DELAY_SINKS 0.05       /* s a second */
#define FRAMES_APART 0.25      /* H: frames of model SINGLE are kept no closer */
#define TIME_LIMIT (1LL << 61) /* ns */

static double delay_at(const hapi_frames *frames, int64_t time_ns)
{
  double since = time_ns > frames->delay_from_ns ? (double)(time_ns - frames->delay_from_ns) : 0.0;
  double gap = frames->delay_wanted_ns - frames->delay_ns;
  double way = since * (gap > 0.0 ? DELAY_RISES : DELAY_SINKS);
  return fabs(gap) <= way ? frames->delay_wanted_ns : frames->delay_ns + copysign(way, gap);
}

/* Number of the frame for stamp_ns. One that is not later than those before takes their place,
 * as a change of model leads to. In model SINGLE, whose steps would soon use up the ring, a
 * frame goes when the next one comes unless it is some way behind the one before; elsewhere that
 * would show, where a late frame loop leaves two steps close together. */
static uint64_t next_frame(hapi_frames *frames, const hapi_cycle *cycle, int64_t stamp_ns,
                           int64_t known_ns)
{
  double step = frames->step_ns = 1e9 * cycle->physics_s;
  if (frames->count == 0) {
    frames->delay_ns = frames->delay_wanted_ns = step;
    frames->delay_from_ns = known_ns;
  } else {
    double wait = (double)(known_ns - frames->stamps[(frames->count - 1) % HAPI_FRAMES]);
    frames->waits_ns[frames->wait_count++ % HAPI_WAITS] = wait;
    frames->delay_ns = delay_at(frames, known_ns);
    frames->delay_from_ns = known_ns;
    /* The largest wait for a frame among the last ones; one that stands out is a hitch and does not
     * count. */
    double largest = 0.0;
    double second = 0.0;
    for (unsigned i = 0; i < HAPI_WAITS; ++i) {
      double one = frames->waits_ns[i];
      second = hapi_max(second, hapi_min(one, largest));
      largest = hapi_max(largest, one);
    }
    double usual = largest - second > HITCH * step ? second : largest;
    frames->delay_wanted_ns = fmin(fmax(usual, step), DELAY_MOST * step);
  }
  while (frames->count > frames->oldest &&
         frames->stamps[(frames->count - 1) % HAPI_FRAMES] >= stamp_ns) {
    --frames->count;
  }
  if (cycle->model == HAP_MODEL_SINGLE && frames->count >= frames->oldest + 2) {
    int64_t newest = frames->stamps[(frames->count - 1) % HAPI_FRAMES];
    int64_t before = frames->stamps[(frames->count - 2) % HAPI_FRAMES];
    frames->count -= (double)(newest - before) < FRAMES_APART * step;
  }
  uint64_t frame = frames->count++;
  frames->stamps[frame % HAPI_FRAMES] = stamp_ns;
  HAPI_ASSERT(frame == 0 || frame == frames->oldest ||
              frames->stamps[(frame - 1) % HAPI_FRAMES] < stamp_ns);
  if (frame >= frames->oldest + HAPI_FRAMES) {
    frames->oldest = frame + 1 - HAPI_FRAMES;
  }
  return frame;
}

static void note_slot(const hapi_known_body *known, const hapi_slots *slots, hapi_drawn *drawn)
{
  if (known->slot == HAPI_NONE) {
    return;
  }
  uint32_t generation = slots->bodies[known->slot].generation;
  if (drawn->slots[0] != known->slot || drawn->generations[0] != generation) {
    drawn->slots[1] = drawn->slots[0];
    drawn->generations[1] = drawn->generations[0];
    drawn->slots[0] = known->slot;
    drawn->generations[0] = generation;
  }
}

static hap_body_role role_of(const hapi_body_slot *slot, hap_model model)
{
  bool local = slot->phase == HAPI_SLOT_LIVE &&
               (model == HAP_MODEL_CONTACT || model == HAP_MODEL_ACCELERANCE);
  bool rests = (slot->flags & HAPI_BODY_RESTING) != 0;
  return !local                                    ? HAP_ROLE_WORLD
         : (slot->flags & HAPI_BODY_DRIVEN) != 0   ? HAP_ROLE_DRIVEN
         : model == HAP_MODEL_ACCELERANCE          ? HAP_ROLE_MEASURED
         : (slot->flags & HAPI_BODY_OWNED) != 0    ? rests ? HAP_ROLE_RESTING : HAP_ROLE_LOOP
         : (slot->flags & HAPI_BODY_MEASURED) != 0 ? HAP_ROLE_MEASURED
                                                   : HAP_ROLE_EDGE;
}

static hap_pose *pose_in(const hapi_drawing *drawing, const hapi_drawn *drawn, uint64_t frame)
{
  HAPI_ASSERT_INDEX(drawn - drawing->drawn, drawing->capacity);
  return &drawing
              ->poses[(frame % HAPI_FRAMES) * drawing->capacity + (size_t)(drawn - drawing->drawn)];
}

static void add_pose(const hapi_drawing *drawing, const hapi_known_body *known, uint32_t index,
                     uint64_t frame)
{
  HAPI_ASSERT_INDEX(index, drawing->capacity);
  HAPI_ASSERT(frame >= drawing->frames.oldest && frame < drawing->frames.count);
  hapi_drawn *drawn = &drawing->drawn[index];
  if (hapi_pose_is_sound(known->body)) {
    hapi_pose_read(known->body, pose_in(drawing, drawn, frame));
    drawn->first = drawn->first > frame ? frame : drawn->first;
  } else if (drawn->first < frame) {
    *pose_in(drawing, drawn, frame) = *pose_in(drawing, drawn, frame - 1);
  }
}

void hapi_poses_publish(hapi_drawing *drawing, const hapi_world *world, const hapi_slots *slots,
                        const hapi_cycle *cycle, const int64_t times_ns[2])
{
  pthread_mutex_lock(&drawing->lock);
  uint64_t frame = next_frame(&drawing->frames, cycle, times_ns[0], times_ns[1]);
  for (uint32_t i = 0; i < world->bodies.high; ++i) {
    hapi_known_body *known = &world->bodies.entries[i];
    if (known->body != NULL) {
      add_pose(drawing, known, i, frame);
      hapi_drawn *drawn = &drawing->drawn[i];
      uint32_t bit = 1u << ((drawing->frames.count - 1) % HAPI_FRAMES);
      /* Whether the pose in ODE is only the loop's, of a time near the frame's: the trail has it
       * exactly. */
      bool pushed = cycle->model == HAP_MODEL_ACCELERANCE || cycle->model == HAP_MODEL_CONTACT;
      pushed = pushed && known->slot != HAPI_NONE && slots->bodies[known->slot].pushed;
      drawn->led = known->loop_owned || pushed ? drawn->led | bit : drawn->led & ~bit;
      note_slot(known, slots, drawn);
      drawn->role = known->slot != HAPI_NONE ? role_of(&slots->bodies[known->slot], cycle->model)
                                             : HAP_ROLE_WORLD;
      if (cycle->step_s > 0.0) { /* here, as each body is at hand */
        hapi_sleep_note(known);
      }
    }
  }
  pthread_mutex_unlock(&drawing->lock);
}

/* ---- of a world that is elsewhere ---- */

void hapi_poses_tell(hapi_drawing *drawing, const hapi_body_table *table, uint32_t first,
                     uint32_t count, hapi_told_body *out)
{
  memset(out, 0, count * sizeof *out);
  pthread_mutex_lock(&drawing->lock);
  for (uint32_t i = first; i < first + count && i < table->high; ++i) {
    const hapi_known_body *known = &table->entries[i];
    const hapi_drawn *drawn = &drawing->drawn[i];
    if (known->body != NULL && known->rest->geom == NULL && drawn->first < drawing->frames.count) {
      out[i - first] =
          (hapi_told_body){.name = known->rest->name,
                           .birth = known->rest->birth,
                           .owned = known->loop_owned,
                           .slot = known->slot,
                           .pose = *pose_in(drawing, drawn, drawing->frames.count - 1)};
    }
  }
  pthread_mutex_unlock(&drawing->lock);
}

uint32_t hapi_poses_places(hapi_drawing *drawing, const hapi_body_table *table)
{
  pthread_mutex_lock(&drawing->lock);
  uint32_t high = table->high;
  pthread_mutex_unlock(&drawing->lock);
  return high;
}

void hapi_poses_hear(hapi_drawing *drawing, const hapi_body_table *table, uint64_t number,
                     const hapi_told_body *bodies, uint32_t count)
{
  pthread_mutex_lock(&drawing->lock);
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t index = hapi_bodies_find_name(table, bodies[i].name);
    if (index != HAPI_NONE && drawing->told[index].number < number) {
      drawing->told[index] = (hapi_drawn_told){number, bodies[i].birth, bodies[i].pose};
    }
  }
  pthread_mutex_unlock(&drawing->lock);
}

uint32_t hapi_poses_find(const hapi_drawing *drawing, const hapi_body_table *table, uint64_t birth)
{
  if (birth > 0 && birth <= table->high && drawing->told[birth - 1].birth == birth &&
      table->entries[birth - 1].body != NULL) {
    return (uint32_t)(birth - 1); /* as long as nothing was put elsewhere or destroyed */
  }
  for (uint32_t i = 0; i < table->high; ++i) {
    if (table->entries[i].body != NULL && drawing->told[i].birth == birth) {
      return i;
    }
  }
  return HAPI_NONE;
}

static hap_body_role role_in(const hapi_model_body *in)
{
  bool rests = (in->flags & HAPI_BODY_RESTING) != 0;
  return (in->flags & HAPI_BODY_DRIVEN) != 0     ? HAP_ROLE_DRIVEN
         : (in->flags & HAPI_BODY_OWNED) != 0    ? rests ? HAP_ROLE_RESTING : HAP_ROLE_LOOP
         : (in->flags & HAPI_BODY_MEASURED) != 0 ? HAP_ROLE_MEASURED
                                                 : HAP_ROLE_EDGE;
}

/* What the loop moves itself is in its trail, by slot, and newer there. */
static void draw_in_model(hapi_drawing *drawing, uint32_t index, uint64_t frame,
                          const hapi_model_body *in)
{
  hapi_drawn *drawn = &drawing->drawn[index];
  bool owned = (in->flags & HAPI_BODY_OWNED) != 0;
  *pose_in(drawing, drawn, frame) = drawing->told[index].pose = in->pose;
  drawn->led |= owned ? 1u << (frame % HAPI_FRAMES) : 0;
  drawn->role = role_in(in);
  if (drawn->slots[0] != in->slot || drawn->generations[0] != in->generation) {
    drawn->slots[1] = drawn->slots[0];
    drawn->generations[1] = drawn->generations[0];
    drawn->slots[0] = in->slot;
    drawn->generations[0] = in->generation;
  }
}

void hapi_poses_publish_told(hapi_drawing *drawing, const hapi_body_table *table,
                             const hapi_cycle *cycle, hapi_model *model, const int64_t times_ns[2])
{
  pthread_mutex_lock(&drawing->lock);
  uint64_t frame = next_frame(&drawing->frames, cycle, times_ns[0], times_ns[1]);
  for (uint32_t i = 0; i < table->high; ++i) {
    hapi_drawn *drawn = &drawing->drawn[i];
    if (table->entries[i].body != NULL) {
      *pose_in(drawing, drawn, frame) = drawing->told[i].pose;
      drawn->first = drawn->first > frame ? frame : drawn->first;
      drawn->led &= ~(1u << (frame % HAPI_FRAMES));
      drawn->role = HAP_ROLE_WORLD;
    }
  }
  for (uint32_t i = 0; model != NULL && i < model->body_count; ++i) {
    const hapi_model_body *in = &hapi_model_bodies(model)[i];
    uint32_t index = in->tag != NULL ? hapi_poses_find(drawing, table, in->birth) : HAPI_NONE;
    if (index != HAPI_NONE) {
      draw_in_model(drawing, index, frame, in);
    }
  }
  pthread_mutex_unlock(&drawing->lock);
}

bool hapi_poses_grow(hapi_drawing *drawing, uint32_t capacity)
{
  if (capacity <= drawing->capacity) {
    return true;
  }
  hapi_drawn *drawn = hapi_alloc_array(capacity, sizeof *drawn);
  hap_pose *poses = hapi_alloc_array((size_t)capacity * HAPI_FRAMES, sizeof *poses);
  hapi_drawn_told *told = hapi_alloc_array(capacity, sizeof *told);
  if (drawn == NULL || poses == NULL || told == NULL) {
    hapi_free(drawn);
    hapi_free(poses);
    hapi_free(told);
    return false;
  }
  uint32_t old = drawing->capacity;
  if (old > 0) {
    memcpy(drawn, drawing->drawn, old * sizeof *drawn);
    memcpy(told, drawing->told, old * sizeof *told);
    for (size_t i = 0; i < HAPI_FRAMES; ++i) {
      memcpy(poses + i * capacity, drawing->poses + i * old, old * sizeof *poses);
    }
  }
  hapi_poses_finish(drawing);
  drawing->drawn = drawn;
  drawing->poses = poses;
  drawing->told = told;
  drawing->capacity = capacity;
  return true;
}

void hapi_poses_finish(hapi_drawing *drawing)
{
  hapi_free(drawing->drawn);
  hapi_free(drawing->poses);
  hapi_free(drawing->told);
  drawing->drawn = NULL;
  drawing->poses = NULL;
  drawing->told = NULL;
  drawing->capacity = 0;
}

void hapi_poses_begin(hapi_drawing *drawing, const hapi_known_body *known, uint32_t index)
{
  hapi_drawn *drawn = &drawing->drawn[index];
  uint64_t count = drawing->frames.count;
  HAPI_ASSERT(known->slot == HAPI_NONE); /* new: the loop does not lead it */
  memset(drawn, 0, sizeof *drawn);
  drawing->told[index] = (hapi_drawn_told){
      .birth = known->rest->name, /* until it is told otherwise */
      .pose = {.quat_wxyz = {1.0}},
  };
  if (hapi_pose_is_sound(known->body)) {
    hapi_pose_read(known->body, &drawing->told[index].pose);
  }
  drawn->first = count;
  if (count > 0) {
    add_pose(drawing, known, index, count - 1);
  }
}

void hapi_poses_reset(hapi_drawing *drawing)
{
  pthread_mutex_lock(&drawing->lock);
  memset(&drawing->frames, 0, sizeof drawing->frames);
  memset(drawing->drawn, 0, drawing->capacity * sizeof *drawing->drawn);
  pthread_mutex_unlock(&drawing->lock);
}

/* ---- drawing ---- */

typedef struct scene {
  const hapi_drawing *drawing;
  const hapi_frames *frames;
  double step_ns;
  hapi_trail_view rows;
  int64_t time_ns;
  uint64_t row;         /* first one later than time_ns */
  uint64_t frame;       /* the same of the frames */
  uint64_t frame_first; /* that is kept */
  bool newest;          /* beyond the last frame bodies go on as they went */
} scene;

typedef struct sample {
  int64_t time_ns;
  uint64_t frame; /* count: not of a frame but of the trail */
  hap_pose pose;
} sample;

static int64_t stamp_of(const scene *d, uint64_t frame)
{
  return d->frames->stamps[frame % HAPI_FRAMES];
}

static bool is_led(const hapi_drawn *drawn, uint64_t frame)
{
  return (drawn->led >> (frame % HAPI_FRAMES) & 1u) != 0;
}

static void sample_frame(const scene *d, const hapi_drawn *drawn, uint64_t frame, sample *out)
{
  out->time_ns = stamp_of(d, frame);
  out->frame = frame;
  out->pose = *pose_in(d->drawing, drawn, frame);
}

static bool sample_row(scene *d, const hapi_drawn *drawn, uint64_t row, sample *out)
{
  for (int i = 0; i < 2; ++i) {
    if (drawn->generations[i] != 0 &&
        hapi_trail_body_at(&d->rows, row, drawn->slots[i], drawn->generations[i], &out->pose)) {
      out->time_ns = hapi_trail_time(&d->rows, row, HAPI_TRAIL_BODIES);
      out->frame = d->frames->count;
      return true;
    }
  }
  return false;
}

/* The newest that is known of the body up to the time: in the trail, or in a frame where that is
 * later. A frame that only repeats the loop is no better than the trail; it stands in where that
 * does not reach. */
static bool find_before(scene *d, const hapi_drawn *drawn, sample *out)
{
  uint64_t first = drawn->first > d->frame_first ? drawn->first : d->frame_first;
  uint64_t frame = d->frame;
  while (frame > first && is_led(drawn, frame - 1)) {
    --frame;
  }
  int64_t floor_ns = frame > first ? stamp_of(d, frame - 1) : INT64_MIN;
  for (uint64_t row = drawn->generations[0] != 0 ? d->row : d->rows.first;
       row > d->rows.first && hapi_trail_time(&d->rows, row - 1, HAPI_TRAIL_BODIES) > floor_ns;
       --row) {
    if (sample_row(d, drawn, row - 1, out)) {
      return true;
    }
  }
  if (d->frame > first) {
    sample_frame(d, drawn, d->frame - 1, out);
  }
  return d->frame > first;
}

/* The next that is known of it after the time, in the same way. */
static bool find_after(scene *d, const hapi_drawn *drawn, sample *out)
{
  uint64_t next = d->frame > drawn->first ? d->frame : drawn->first;
  uint64_t frame = next;
  while (frame < d->frames->count && is_led(drawn, frame)) {
    ++frame;
  }
  int64_t ceiling_ns = frame < d->frames->count ? stamp_of(d, frame) : INT64_MAX;
  for (uint64_t row = drawn->generations[0] != 0 ? d->row : d->rows.end;
       row < d->rows.end && hapi_trail_time(&d->rows, row, HAPI_TRAIL_BODIES) < ceiling_ns; ++row) {
    if (sample_row(d, drawn, row, out)) {
      return true;
    }
  }
  if (next < d->frames->count) {
    sample_frame(d, drawn, frame < d->frames->count ? frame : next, out);
  }
  return next < d->frames->count;
}

/* From the last but one frame through the last one, for one step at most. */
static void go_on(const scene *d, const hapi_drawn *drawn, const sample *last, hap_pose *out)
{
  uint64_t before = last->frame - 1;
  bool known = d->newest && last->frame < d->frames->count && last->frame > d->frame_first &&
               last->frame > drawn->first && !is_led(drawn, before);
  if (!known) {
    *out = last->pose;
    return;
  }
  double interval = (double)(last->time_ns - stamp_of(d, before));
  double since = fmin((double)(d->time_ns - last->time_ns), d->step_ns);
  hapi_pose_slerp(pose_in(d->drawing, drawn, before), &last->pose, 1.0 + since / interval, out);
}

static void scene_draw(scene *d, const hapi_drawn *drawn, hap_pose *out)
{
  sample before = {0};
  sample after = {0};
  bool has_before = find_before(d, drawn, &before);
  if (!find_after(d, drawn, &after)) {
    go_on(d, drawn, &before, out); /* a body has one sample at least */
    return;
  }
  if (!has_before) {
    *out = after.pose;
    return;
  }
  double way = (double)(after.time_ns - before.time_ns);
  double share = way > 0.0 ? (double)(d->time_ns - before.time_ns) / way : 0.0;
  hapi_pose_slerp(&before.pose, &after.pose, fmin(fmax(share, 0.0), 1.0), out);
}

static int64_t drawn_time(const hapi_frames *frames, int64_t time_ns)
{
  int64_t time = time_ns > TIME_LIMIT ? TIME_LIMIT : time_ns < -TIME_LIMIT ? -TIME_LIMIT : time_ns;
  return time - (int64_t)llround(delay_at(frames, time));
}

/* late_steps: from the last frame, that are in order. */
static hap_status scene_judge(const scene *d, double late_steps)
{
  const hapi_frames *frames = d->frames;
  double late = (double)(d->time_ns - stamp_of(d, frames->count - 1));
  if (late > late_steps * d->step_ns) {
    return HAP_STALE;
  }
  int64_t oldest_ns = stamp_of(d, d->frame_first);
  /* At the start what lies a delay behind is before the first frame, and the same as it. */
  double slack = d->frame_first == 0 ? delay_at(frames, oldest_ns) : 0.0;
  return (double)(oldest_ns - d->time_ns) > slack ? HAP_CLAMPED : HAP_OK;
}

/* NULL: there is nothing to draw of it yet. */
static const hapi_drawn *drawn_of(const hapi_drawing *drawing, const hapi_body_table *table,
                                  struct dxBody *body)
{
  uint32_t index = hapi_bodies_find(table, body);
  bool known = index != HAPI_NONE && drawing->drawn[index].first < drawing->frames.count;
  return known ? &drawing->drawn[index] : NULL;
}

/* HAPI_ALL_KNOWN, or the place of the first one that is not. */
static size_t first_unknown(const hapi_drawing *drawing, const hapi_body_table *table,
                            struct dxBody *const *bodies, size_t count)
{
  for (size_t i = 0; i < count; ++i) {
    if (drawn_of(drawing, table, bodies[i]) == NULL) {
      return i;
    }
  }
  return HAPI_ALL_KNOWN;
}

/* False: the trail went on so far meanwhile that what was read of it may be torn. */
static bool scene_draw_all(scene *d, const hapi_body_table *table, struct dxBody *const *bodies,
                           size_t count, hap_pose *out)
{
  const hapi_frames *frames = d->frames;
  d->frame_first = frames->oldest;
  d->frame = frames->count;
  while (d->frame > d->frame_first && stamp_of(d, d->frame - 1) > d->time_ns) {
    --d->frame;
  }
  d->row = hapi_trail_after(&d->rows, d->time_ns, HAPI_TRAIL_BODIES);
  for (size_t i = 0; i < count; ++i) {
    const hapi_drawn *drawn = drawn_of(d->drawing, table, bodies[i]);
    if (drawn != NULL) {
      scene_draw(d, drawn, &out[i]);
    }
  }
  return hapi_trail_is_whole(&d->rows);
}

static scene scene_begin(const hapi_physics *physics)
{
  return (scene){.drawing = &physics->drawing,
                 .frames = &physics->drawing.frames,
                 .step_ns = physics->drawing.frames.step_ns,
                 .rows = hapi_trail_look(hapi_exchange_trail(physics->config.exchange))};
}

/* time_ns NULL: newest of all, where a frame may be two steps old. */
static hap_status poses_draw(hapi_physics *physics, const int64_t *time_ns,
                             struct dxBody *const *bodies, size_t count, hap_pose *out,
                             size_t *out_unknown)
{
  hap_status status = HAP_OK;
  pthread_mutex_lock(&physics->drawing.lock);
  *out_unknown = first_unknown(&physics->drawing, &physics->world.bodies, bodies, count);
  for (bool whole = physics->drawing.frames.count == 0 || count == 0; !whole;) {
    scene d = scene_begin(physics);
    d.newest = time_ns == NULL;
    d.time_ns = time_ns != NULL ? drawn_time(d.frames, *time_ns)
                : d.rows.end > d.rows.first
                    ? hapi_trail_time(&d.rows, d.rows.end - 1, HAPI_TRAIL_BODIES)
                    : stamp_of(&d, d.frames->count - 1);
    whole = scene_draw_all(&d, &physics->world.bodies, bodies, count, out);
    status = scene_judge(&d, d.newest ? 2.0 : 1.0);
  }
  pthread_mutex_unlock(&physics->drawing.lock);
  return *out_unknown == HAPI_ALL_KNOWN ? status : HAP_ERROR_NOT_FOUND;
}

hap_status hapi_physics_poses(hapi_physics *physics, int64_t time_ns, struct dxBody *const *bodies,
                              size_t count, hap_pose *out, size_t *out_unknown)
{
  return poses_draw(physics, &time_ns, bodies, count, out, out_unknown);
}

hap_status hapi_physics_poses_now(hapi_physics *physics, struct dxBody *const *bodies, size_t count,
                                  hap_pose *out, size_t *out_unknown)
{
  return poses_draw(physics, NULL, bodies, count, out, out_unknown);
}

hap_status hapi_physics_roles(hapi_physics *physics, struct dxBody *const *bodies, size_t count,
                              hap_body_role *out, size_t *out_unknown)
{
  const hapi_body_table *table = &physics->world.bodies;
  pthread_mutex_lock(&physics->drawing.lock);
  *out_unknown = first_unknown(&physics->drawing, table, bodies, count);
  for (size_t i = 0; i < count; ++i) {
    const hapi_drawn *drawn = drawn_of(&physics->drawing, table, bodies[i]);
    if (drawn != NULL) {
      out[i] = drawn->role;
    }
  }
  pthread_mutex_unlock(&physics->drawing.lock);
  return *out_unknown == HAPI_ALL_KNOWN ? HAP_OK : HAP_ERROR_NOT_FOUND;
}

int64_t hapi_physics_drawn_time(hapi_physics *physics, int64_t time_ns, int64_t *out_step_ns)
{
  pthread_mutex_lock(&physics->drawing.lock);
  int64_t time = drawn_time(&physics->drawing.frames, time_ns);
  *out_step_ns = (int64_t)physics->drawing.frames.step_ns;
  pthread_mutex_unlock(&physics->drawing.lock);
  return time;
}

double hapi_poses_delay(hapi_drawing *drawing)
{
  pthread_mutex_lock(&drawing->lock);
  double delay = 1e-9 * drawing->frames.delay_ns;
  pthread_mutex_unlock(&drawing->lock);
  return delay;
}
