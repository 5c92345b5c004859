/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_stage.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/log.h"
#include "device/device.h"
#include "tools/run_frame.h"
#include "tools/run_hand.h"
#include "tools/run_history.h"
#include "tools/run_scene_file.h"

#define WISHES_MAX 32
#define STRIP_S 8.0
#define NOTICE_S 3.0
#define GRAB_WAIT_S 0.7  /* for the hand to come to the end of a leg */
#define FLIGHT_SPEED 1.0 /* m/s */
#define FLIGHT_EASE 9.0  /* 1/s, of the way that is left */
#define GRAB_NEAR 0.012  /* m, beyond the pointer's radius */
#define SCALE_LEAST (1.0 / 64.0)

/* A body that the mouse's hand is on its way to: away from where it is, over there, and down to
 * it, so that it pushes nothing aside. */
typedef struct stage_grab {
  bool wanted;
  uint32_t body;
  double path[3][3]; /* m; the last one is on the body */
  int leg;
  double until; /* s, of the run: when the leg is given up */
} stage_grab;

/* What the run's thread alone knows. */
typedef struct stage_run {
  const run_options *options;
  const rig *rig;
  run_frame_source source;
  view_frame frame;
  double begun; /* s, clock on the wall, of the time 0 of the run */
  double t;
  double scale;        /* of time; 0: it is paused */
  double scale_kept;   /* before the pause */
  uint64_t step_until; /* steps of physics, after which it is paused again; 0: not */
  double physics_hz;
  hap_model model;
  double accuracy;
  size_t hand;
  bool pulled[RIG_POINTERS_MAX];
  double targets[RIG_POINTERS_MAX][3];
  stage_grab grab;
  char notice[128];
  double notice_until; /* s, clock on the wall */
} stage_run;

/* What both threads know, under the mutex. */
typedef struct stage_shared {
  view_frame frame;
  view_strips strips;
  view_labels labels;
  run_history history;
  hap_scene *scene;
  unsigned scene_count;
  stage_wish wishes[WISHES_MAX];
  size_t wish_count;
  bool pull;
  double target[3];
  stage_grab grab;
  size_t hand;
  bool can_pull;
  bool is_held;
  bool is_over;
} stage_shared;

struct run_stage {
  pthread_mutex_t mutex;
  stage_shared shared;
  stage_run run;
  run_hand hands[RIG_POINTERS_MAX];
  rig_around around;
  int scene_step; /* to the scene of the next run */
  bool goes_on;
};

static double wall_clock(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

run_stage *run_stage_create(void)
{
  run_stage *stage = calloc(1, sizeof *stage);
  if (stage != NULL && pthread_mutex_init(&stage->mutex, NULL) != 0) {
    free(stage);
    return NULL;
  }
  return stage;
}

void run_stage_destroy(run_stage *stage)
{
  if (stage == NULL) {
    return;
  }
  run_frame_free(&stage->shared.frame);
  run_history_free(&stage->shared.history);
  pthread_mutex_destroy(&stage->mutex);
  free(stage);
}

/* ---- the begin of a run ---- */

static hap_status hand_put(void *user, size_t index, hap_device **io, hap_detail *detail)
{
  run_stage *stage = user;
  if (hapi_device_ops(*io)->pacing != HAP_PACING_VIRTUAL) {
    return HAP_OK; /* a person has it in the hand */
  }
  return run_hand_open(&stage->hands[index], *io, io, detail);
}

void run_stage_prepare(run_stage *stage, run_options *io)
{
  if (stage != NULL) {
    memset(stage->hands, 0, sizeof stage->hands);
    stage->around = (rig_around){hand_put, stage};
    io->rig.around = &stage->around;
  }
}

static hap_status shared_enter(run_stage *stage, hap_scene *other, double seconds,
                               hap_detail *detail)
{
  stage_shared *s = &stage->shared;
  const size_t bodies = stage->run.rig->scene->body_count;
  run_frame_free(&s->frame);
  run_history_free(&s->history);
  run_history_init(&s->history);
  s->scene = other;
  memset(&s->frame, 0, sizeof s->frame);
  view_strips_init(&s->strips, seconds > 0.0 ? seconds : STRIP_S);
  ++s->scene_count;
  return run_frame_reserve(&s->frame, bodies) && run_frame_reserve(&stage->run.frame, bodies)
             ? HAP_OK
             : hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a picture");
}

hap_status run_stage_enter(run_stage *stage, const run_options *options, const rig *r,
                           size_t pointers, double seconds, hap_detail *detail)
{
  hap_scene *other;
  if (stage == NULL) {
    return HAP_OK;
  }
  HAPI_TRY(run_scene_file_again(options, &other, detail)); /* to be read */
  stage->run = (stage_run){
      .options = options,
      .rig = r,
      .source = {.rig = r,
                 .scene = other,
                 .pointers = pointers < VIEW_POINTERS_MAX ? pointers : VIEW_POINTERS_MAX},
      .begun = wall_clock(),
      .scale = 1.0,
      .scale_kept = 1.0,
      .physics_hz = options->rig.def.physics_hz,
      .model = options->rig.def.model,
      .accuracy = options->rig.def.accuracy};
  run_frame_pointers(options, other, &stage->run.frame);
  pthread_mutex_lock(&stage->mutex);
  hap_status status = shared_enter(stage, other, seconds, detail);
  pthread_mutex_unlock(&stage->mutex);
  return status;
}

void run_stage_leave(run_stage *stage)
{
  if (stage != NULL) {
    run_frame_free(&stage->run.frame);
    stage->run.rig = NULL;
    pthread_mutex_lock(&stage->mutex);
    (void)hap_scene_destroy(stage->shared.scene);
    stage->shared.scene = NULL;
    pthread_mutex_unlock(&stage->mutex);
  }
}

/* ---- what is wished ---- */

static void notice_set(stage_run *r, const char *text)
{
  snprintf(r->notice, sizeof r->notice, "%.120s", text);
  r->notice_until = wall_clock() + NOTICE_S;
}

/* What came of a wish: the text, or why not. */
static bool wish_done(stage_run *r, hap_status status, const char *text)
{
  hap_detail why = {""};
  if (status < HAP_OK) {
    (void)hap_session_detail(r->rig->session, &why);
  }
  notice_set(r, status >= HAP_OK ? text : why.text[0] != '\0' ? why.text : hap_status_text(status));
  return status >= HAP_OK;
}

static void model_wish(stage_run *r)
{
  char text[64];
  hap_model next = (hap_model)(r->model + 1);
  next = hap_model_name(next) != NULL ? next : (hap_model)0;
  snprintf(text, sizeof text, "model %s", hap_model_name(next));
  if (wish_done(r, hap_session_set_model(r->rig->session, next), text)) {
    r->model = next;
  }
}

static void rate_wish(stage_run *r, bool up)
{
  static const double usual[] = {5, 10, 15, 20, 30, 45, 60, 90, 120, 180, 240, 360, 500, 1000};
  char text[64];
  double next = r->physics_hz;
  for (size_t i = 0; i < sizeof usual / sizeof usual[0]; ++i) {
    const size_t k = up ? i : sizeof usual / sizeof usual[0] - 1 - i;
    if (up ? usual[k] > 1.01 * r->physics_hz : usual[k] < 0.99 * r->physics_hz) {
      next = usual[k];
      break;
    }
  }
  snprintf(text, sizeof text, "physics %g Hz", next);
  if (wish_done(r, hap_session_set_physics_hz(r->rig->session, next), text)) {
    r->physics_hz = next;
  }
}

static void accuracy_wish(stage_run *r, double by)
{
  char text[64];
  const double next = fmin(fmax(round(10.0 * (r->accuracy + by)) / 10.0, 0.0), 1.0);
  snprintf(text, sizeof text, "accuracy %.1f", next);
  if (wish_done(r, hap_session_set_accuracy(r->rig->session, next), text)) {
    r->accuracy = next;
  }
}

static void scale_wish(stage_run *r, double scale, const char *text)
{
  if (wish_done(r, hap_session_set_time_scale(r->rig->session, scale), text)) {
    r->scale_kept = scale > 0.0 ? scale : r->scale_kept;
    r->scale = scale;
  }
}

static void slower_wish(stage_run *r, double by)
{
  char text[64];
  const double next = fmin(fmax(r->scale_kept * by, SCALE_LEAST), 1.0);
  snprintf(text, sizeof text, next < 1.0 ? "slow motion, 1/%g" : "full speed", 1.0 / next);
  scale_wish(r, next, text);
}

static void step_wish(stage_run *r)
{
  hap_stats stats;
  if (hap_session_stats(r->rig->session, &stats, sizeof stats) >= HAP_OK) {
    scale_wish(r, r->scale_kept, "one step");
    r->step_until = stats.physics.steps + 1;
  }
}

static const hap_pointer_id *hand_id(const stage_run *r)
{
  return r->hand < r->rig->pointer_count ? &r->rig->pointers[r->hand] : NULL;
}

/* The device of a pointer: simulated ones have one hand each. */
static bool hand_can_be_pulled(const run_stage *stage)
{
  const stage_run *r = &stage->run;
  return r->rig->pointer_count == r->rig->device_count && r->hand < r->rig->device_count &&
         stage->hands[r->hand].inner != NULL;
}

static void hand_pull(run_stage *stage, const double target[3])
{
  stage_run *r = &stage->run;
  if (hand_can_be_pulled(stage)) {
    r->pulled[r->hand] = true;
    memcpy(r->targets[r->hand], target, sizeof r->targets[0]);
    run_hand_pull(&stage->hands[r->hand], RUN_HAND_PULLED, target);
  }
}

static void hand_wish(run_stage *stage)
{
  stage_run *r = &stage->run;
  char text[48];
  r->hand = r->rig->pointer_count > 0 ? (r->hand + 1) % r->rig->pointer_count : 0;
  snprintf(text, sizeof text, "the mouse moves hand %zu of %zu", r->hand + 1,
           r->rig->pointer_count);
  notice_set(r, text);
}

static void script_wish(run_stage *stage)
{
  stage_run *r = &stage->run;
  if (hand_can_be_pulled(stage) && r->pulled[r->hand]) {
    run_hand_pull(&stage->hands[r->hand], RUN_HAND_HOME, r->targets[r->hand]);
    r->pulled[r->hand] = false;
    notice_set(r, "the hand goes its own way");
  }
}

static void let_go(stage_run *r)
{
  const hap_pointer_id *id = hand_id(r);
  r->grab.wanted = false;
  if (id != NULL) {
    (void)hap_pointer_release(r->rig->session, *id);
  }
}

/* Scenes are those of hap_scene_name_at; the run that is there ends. */
static hap_status wish_do(run_stage *stage, stage_wish wish)
{
  stage_run *r = &stage->run;
  switch (wish) {
    case STAGE_END:
      return HAP_END;
    case STAGE_AGAIN:
    case STAGE_SCENE_NEXT:
    case STAGE_SCENE_BEFORE:
      if (wish != STAGE_AGAIN && r->options->far.connect != NULL) {
        notice_set(r, "the scene is that of the world, which another process has");
        break;
      }
      stage->goes_on = true;
      stage->scene_step = wish == STAGE_AGAIN ? 0 : wish == STAGE_SCENE_NEXT ? 1 : -1;
      return HAP_END;
    case STAGE_MODEL:
      model_wish(r);
      break;
    case STAGE_RATE_UP:
    case STAGE_RATE_DOWN:
      rate_wish(r, wish == STAGE_RATE_UP);
      break;
    case STAGE_FINER:
    case STAGE_COARSER:
      accuracy_wish(r, wish == STAGE_FINER ? 0.1 : -0.1);
      break;
    case STAGE_SLOWER:
    case STAGE_FASTER:
      slower_wish(r, wish == STAGE_FASTER ? 2.0 : 0.5);
      break;
    case STAGE_PAUSE:
      r->step_until = 0;
      scale_wish(r, r->scale > 0.0 ? 0.0 : r->scale_kept, r->scale > 0.0 ? "paused" : "goes on");
      break;
    case STAGE_STEP:
      step_wish(r);
      break;
    case STAGE_RESET:
      (void)wish_done(r, hap_session_reset_fault(r->rig->session), "the fault is cleared");
      break;
    case STAGE_HAND:
      hand_wish(stage);
      break;
    case STAGE_SCRIPT:
      script_wish(stage);
      break;
    case STAGE_LET_GO:
      let_go(r);
      break;
    case STAGE_WISHES:
      break;
  }
  return HAP_OK;
}

/* ---- a look ---- */

static double distance_of(const double a[3], const double b[3])
{
  return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
              (a[2] - b[2]) * (a[2] - b[2]));
}

/* Moves the hand's target on a leg, slower as it comes near: the hand's mass swings less then. */
static void leg_go_on(run_stage *stage, const double to[3], double step_s)
{
  stage_run *r = &stage->run;
  double *at = r->targets[r->hand];
  const double left = distance_of(at, to);
  const double share =
      left > 0.0 ? fmin(fmin(FLIGHT_SPEED / left, FLIGHT_EASE) * step_s, 1.0) : 0.0;
  double next[3];
  for (int i = 0; i < 3; ++i) {
    next[i] = at[i] + share * (to[i] - at[i]);
  }
  hand_pull(stage, next);
}

/* The hand takes hold where it has come to the body, or as near as it can. */
static void grab_go_on(run_stage *stage, double step_s)
{
  stage_run *r = &stage->run;
  const hap_pointer_id *id = hand_id(r);
  if (!r->grab.wanted || id == NULL) {
    return;
  }
  const view_pointer *p = &r->frame.pointers[r->hand];
  const double *to = r->grab.path[r->grab.leg];
  leg_go_on(stage, to, step_s);
  const bool last = r->grab.leg == 2;
  const double near = GRAB_NEAR + (last ? p->radius : 0.0);
  if (distance_of(p->proxy.position, to) > near && r->t < r->grab.until) {
    return;
  }
  r->grab.until = r->t + GRAB_WAIT_S;
  if (!last) {
    ++r->grab.leg;
    return;
  }
  r->grab.wanted = false;
  (void)wish_done(
      r, hap_pointer_attach(r->rig->session, *id, r->rig->scene->bodies[r->grab.body], NULL),
      "held");
}

/* Where it is to go, by the line of sight that was clicked. */
static void grab_begin(stage_run *r, const stage_grab *wanted)
{
  const view_pointer *p = &r->frame.pointers[r->hand];
  r->grab = *wanted;
  r->grab.until = r->t + GRAB_WAIT_S;
  if (!r->pulled[r->hand]) {
    memcpy(r->targets[r->hand], p->device.position, sizeof r->targets[0]);
  }
  for (int i = 0; i < 3; ++i) {
    r->grab.path[0][i] = p->device.position[i] + wanted->path[0][i];
    r->grab.path[1][i] = wanted->path[2][i] + wanted->path[0][i];
  }
}

static void step_go_on(stage_run *r, const hap_stats *stats)
{
  if (r->step_until > 0 && stats->physics.steps >= r->step_until) {
    r->step_until = 0;
    (void)hap_session_set_time_scale(r->rig->session, 0.0);
    r->scale = 0.0;
  }
}

static void effects_describe(const stage_run *r, view_panel *out)
{
  static const char *const states[] = {"off", "on", "partly"};
  hap_effect_info effects[HAP_EFFECTS];
  snprintf(out->title, sizeof out->title, "effects");
  out->row_count = 0;
  if (hap_session_effects(r->rig->session, effects, HAP_EFFECTS, sizeof effects[0]) < HAP_OK) {
    return;
  }
  for (size_t i = 0; i < HAP_EFFECTS; ++i) {
    char(*row)[72] = out->rows[out->row_count++];
    const hap_effect_info *e = &effects[i];
    int used = snprintf(row[1], sizeof row[1], "%s", e->state < 3 ? states[e->state] : "?");
    snprintf(row[0], sizeof row[0], "%s", hap_effect_name((hap_effect)i));
    if (e->state != HAP_EFFECT_IS_OFF && e->tick_us > 0.0) {
      used += snprintf(row[1] + used, sizeof row[1] - (size_t)used, "  %.2f \x7fs", e->tick_us);
    }
    if (e->state != HAP_EFFECT_IS_OFF && e->physics_ms > 0.0) {
      snprintf(row[1] + used, sizeof row[1] - (size_t)used, "  %.2f ms a step", e->physics_ms);
    }
  }
}

static void labels_describe(const stage_run *r, const hap_stats *stats, view_labels *out)
{
  memset(out, 0, sizeof *out);
  run_frame_labels(r->options, out);
  snprintf(out->subtitle, sizeof out->subtitle, "model %s, physics %g Hz, haptic %g Hz",
           hap_model_name(r->model), r->physics_hz, r->options->rig.def.haptic_hz);
  const size_t used = strlen(out->subtitle);
  snprintf(out->subtitle + used, sizeof out->subtitle - used, ", accuracy %.1f%s", r->accuracy,
           r->scale == 0.0  ? ", paused"
           : r->scale < 1.0 ? ", slow motion"
                            : "");
  if (stats->faults.fault != HAP_FAULT_NONE) {
    snprintf(out->notice, sizeof out->notice, "%.110s",
             hap_fault_text((hap_fault)stats->faults.fault));
  } else if (wall_clock() < r->notice_until) {
    snprintf(out->notice, sizeof out->notice, "%s", r->notice);
  }
  effects_describe(r, &out->panels[0]);
}

/* Under the mutex. */
static bool shared_publish(run_stage *stage, const view_labels *labels)
{
  stage_shared *s = &stage->shared;
  const stage_run *r = &stage->run;
  const hap_pointer_id *id = hand_id(r);
  hap_pointer_state state;
  run_frame_copy(&r->frame, &s->frame);
  s->labels = *labels;
  s->hand = r->hand;
  s->can_pull = hand_can_be_pulled(stage);
  s->is_held = id != NULL &&
               hap_pointer_get(r->rig->session, *id, &state, sizeof state) >= HAP_OK &&
               state.held != NULL;
  return r->options->play_path == NULL || run_history_add(&s->history, &r->frame);
}

static void pulls_mark(stage_run *r)
{
  for (size_t i = 0; i < r->frame.pointer_count; ++i) {
    view_pointer *p = &r->frame.pointers[i];
    p->is_pulled = r->pulled[i];
    memcpy(p->pull, r->targets[i], sizeof p->pull);
  }
}

hap_status run_stage_look(run_stage *stage, double t)
{
  stage_wish wishes[WISHES_MAX];
  view_labels labels;
  hap_stats stats = {0};
  if (stage == NULL) {
    return HAP_OK;
  }
  stage_run *r = &stage->run;
  const double step_s = t - r->t;
  r->t = t;
  (void)hap_session_stats(r->rig->session, &stats, sizeof stats);
  run_frame_read(&r->source, t, &r->frame);
  pulls_mark(r);
  labels_describe(r, &stats, &labels);
  pthread_mutex_lock(&stage->mutex);
  bool good = shared_publish(stage, &labels);
  const size_t wish_count = stage->shared.wish_count;
  memcpy(wishes, stage->shared.wishes, wish_count * sizeof *wishes);
  const bool pull = stage->shared.pull;
  const double *at = stage->shared.target;
  const double target[3] = {at[0], at[1], at[2]};
  const stage_grab grab = stage->shared.grab;
  stage->shared.wish_count = 0;
  stage->shared.pull = stage->shared.grab.wanted = false;
  pthread_mutex_unlock(&stage->mutex);
  if (pull && !r->grab.wanted && !grab.wanted) {
    hand_pull(stage, target);
  }
  if (grab.wanted && hand_can_be_pulled(stage)) {
    grab_begin(r, &grab);
  }
  grab_go_on(stage, fmin(fmax(step_s, 0.0), 0.05));
  step_go_on(r, &stats);
  hap_status status = good ? HAP_OK : HAP_ERROR_MEMORY;
  for (size_t i = 0; i < wish_count && status == HAP_OK; ++i) {
    status = wish_do(stage, wishes[i]);
  }
  return status;
}

void run_stage_add_row(run_stage *stage, const hap_trace_row *row)
{
  if (stage != NULL) {
    stage->run.source.row = *row;
    pthread_mutex_lock(&stage->mutex);
    view_strips_add(&stage->shared.strips, row->t, run_frame_force(row), row->tick_us);
    pthread_mutex_unlock(&stage->mutex);
  }
}

void run_stage_pace(run_stage *stage, double t)
{
  if (stage == NULL || stage->run.options->play_path != NULL) {
    return;
  }
  const double ahead = stage->run.begun + t - wall_clock();
  if (ahead > 0.0) {
    const struct timespec pause = {(time_t)ahead, (long)(1e9 * (ahead - floor(ahead)))};
    (void)nanosleep(&pause, NULL);
  } else if (ahead < -0.1) {
    stage->run.begun -= ahead; /* slower than the wall's: what is lost is not caught up */
  }
}

bool run_stage_goes_on(run_stage *stage, run_options *io)
{
  if (!stage->goes_on) {
    return false;
  }
  stage->goes_on = false;
  if (stage->scene_step == 0) {
    return true;
  }
  size_t count = 0;
  size_t now = 0;
  const size_t length = strcspn(io->rig.scene, ":");
  for (const char *name; (name = hap_scene_name_at(count, NULL)) != NULL; ++count) {
    if (strlen(name) == length && memcmp(name, io->rig.scene, length) == 0) {
      now = count;
    }
  }
  if (count == 0) {
    return true;
  }
  io->rig.scene =
      hap_scene_name_at((now + count + (stage->scene_step > 0 ? 1 : count - 1)) % count, NULL);
  return true;
}

void run_stage_finish(run_stage *stage)
{
  pthread_mutex_lock(&stage->mutex);
  stage->shared.is_over = true;
  pthread_mutex_unlock(&stage->mutex);
}

/* ---- the window's thread ---- */

void run_stage_wish(run_stage *stage, stage_wish wish)
{
  pthread_mutex_lock(&stage->mutex);
  stage_shared *s = &stage->shared;
  if (s->wish_count < WISHES_MAX) {
    s->wishes[s->wish_count++] = wish;
  }
  pthread_mutex_unlock(&stage->mutex);
}

void run_stage_pull(run_stage *stage, const double target[3])
{
  pthread_mutex_lock(&stage->mutex);
  stage->shared.pull = true;
  memcpy(stage->shared.target, target, sizeof stage->shared.target);
  pthread_mutex_unlock(&stage->mutex);
}

void run_stage_grab(run_stage *stage, uint32_t body, const double point[3], const double lift[3])
{
  pthread_mutex_lock(&stage->mutex);
  stage->shared.grab = (stage_grab){.wanted = true, .body = body};
  memcpy(stage->shared.grab.path[0], lift, sizeof stage->shared.grab.path[0]);
  memcpy(stage->shared.grab.path[2], point, sizeof stage->shared.grab.path[2]);
  pthread_mutex_unlock(&stage->mutex);
}

hap_status run_stage_scene(run_stage *stage, view *v, stage_picture *io, hap_detail *detail)
{
  hap_status status = HAP_OK;
  pthread_mutex_lock(&stage->mutex);
  const stage_shared *s = &stage->shared;
  if (s->scene != NULL && io->scene != s->scene_count) {
    status = view_take_scene(v, s->scene, detail);
    run_frame_free(&io->frame);
    memset(&io->frame, 0, sizeof io->frame);
    if (status >= HAP_OK && !run_frame_reserve(&io->frame, s->frame.body_count)) {
      status = HAP_ERROR_MEMORY;
    }
    io->scene = s->scene_count;
    status = status < HAP_OK ? status : HAP_STALE;
  }
  pthread_mutex_unlock(&stage->mutex);
  return status;
}

bool run_stage_take(run_stage *stage, double t, stage_picture *io)
{
  pthread_mutex_lock(&stage->mutex);
  const stage_shared *s = &stage->shared;
  const view_frame *frame = t >= 0.0 ? run_history_at(&s->history, t) : &s->frame;
  const size_t kept = s->history.count;
  io->is_over = s->is_over;
  bool good = io->scene == s->scene_count && frame != NULL && frame->pointer_count > 0 &&
              frame->body_count == io->frame.body_count;
  if (good) {
    run_frame_copy(frame, &io->frame);
    io->strips = s->strips;
    io->labels = s->labels;
    io->hand = s->hand;
    io->can_pull = s->can_pull;
    io->is_held = s->is_held;
    io->end = kept > 0 ? s->history.list[kept - 1].t : 0.0;
  }
  pthread_mutex_unlock(&stage->mutex);
  return good;
}
