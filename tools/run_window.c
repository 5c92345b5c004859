/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_window.h"

#include <math.h>
#include <pthread.h>
#include <string.h>

#include <epoxy/gl.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include "base/log.h"
#include "tools/run_frame.h"
#include "tools/run_loop.h"
#include "tools/run_spacemouse.h"

#define PICTURE_S (1.0 / 60.0)
#define DOUBLE_CLICK_S 0.35
#define DOUBLE_CLICK_PX 8.0
#define HINT_S 7.0
#define ORBIT_PER_PX 0.006 /* rad */
#define STEEP_MAX 1.5      /* rad, of the eye above and below what it looks at */
#define ZOOM 0.9           /* of the distance, for a notch of the wheel */
#define DEPTH 0.03         /* of the distance, likewise, while the hand is pulled */
#define LIFT 0.14          /* likewise, of a hand that flies to a body */
#define CALM_S 0.25        /* in which the view follows what moves */
#define SEEK_S 0.1         /* of a recording, for a key */
#define PUSH_SPEED 0.5     /* of the distance a second, for a SpaceMouse pushed to its end */
#define TURN_SPEED 1.5     /* rad/s, for one turned to its end */

typedef enum window_drag {
  DRAG_NONE = 0,
  DRAG_HAND,
  DRAG_ORBIT,
  DRAG_PAN,
  DRAG_SLIDER
} window_drag;

/* Where the window's picture is in a recording. */
typedef struct window_play {
  bool wanted; /* it shows a recording */
  bool runs;
  double t; /* s */
} window_play;

/* The mouse. */
typedef struct window_mouse {
  window_drag drag;
  double at[2];     /* px of the picture */
  double press_s;   /* of the last press of the left button */
  double press[2];  /* px */
  double target[3]; /* m, where it pulls the hand */
} window_mouse;

typedef struct run_window_state {
  GLFWwindow *window;
  view *view;
  run_stage *stage;
  const run_options *options;
  stage_picture picture;
  bool has_picture;
  bool camera_free; /* the view frames what moves, until the mouse is used */
  window_mouse mouse;
  run_spacemouse spacemouse;
  bool is_pushed; /* the SpaceMouse has the hand */
  window_play play;
  bool help;
  bool plots;
  bool effects;
  bool labels;
  double begun;  /* s */
  double step_s; /* since the picture before */
} run_window_state;

/* ---- the camera ---- */

static double vector_dot(const double a[3], const double b[3])
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The camera as it is: eye, what it looks at, unit direction between, distance. */
typedef struct window_camera {
  double eye[3];
  double target[3];
  double way[3];
  double distance;
} window_camera;

static void camera_get(const run_window_state *w, window_camera *out)
{
  view_get_camera(w->view, out->eye, out->target);
  for (int i = 0; i < 3; ++i) {
    out->way[i] = out->target[i] - out->eye[i];
  }
  out->distance = fmax(sqrt(vector_dot(out->way, out->way)), 1e-9);
  for (int i = 0; i < 3; ++i) {
    out->way[i] /= out->distance;
  }
}

/* From one pixel to another, m, in the plane across the view that goes through a point. */
static void plane_move(const run_window_state *w, const double through[3],
                       const double pixels[2][2], double out[3])
{
  window_camera c;
  double ends[2][3];
  double depth = 0.0;
  camera_get(w, &c);
  for (int i = 0; i < 3; ++i) {
    depth += (through[i] - c.eye[i]) * c.way[i];
  }
  for (int k = 0; k < 2; ++k) {
    double eye[3];
    view_ray(w->view, pixels[k], eye, ends[k]);
    const double slope = fmax(vector_dot(ends[k], c.way), 1e-3);
    for (int i = 0; i < 3; ++i) {
      ends[k][i] *= depth / slope;
    }
  }
  for (int i = 0; i < 3; ++i) {
    out[i] = ends[1][i] - ends[0][i];
  }
}

static void camera_orbit(run_window_state *w, double dx, double dy)
{
  window_camera c;
  camera_get(w, &c);
  const double turn = atan2(-c.way[1], -c.way[0]) - ORBIT_PER_PX * dx;
  double steep = asin(fmin(fmax(-c.way[2], -1.0), 1.0)) + ORBIT_PER_PX * dy;
  steep = fmin(fmax(steep, -STEEP_MAX), STEEP_MAX);
  c.eye[0] = c.target[0] + c.distance * cos(steep) * cos(turn);
  c.eye[1] = c.target[1] + c.distance * cos(steep) * sin(turn);
  c.eye[2] = c.target[2] + c.distance * sin(steep);
  view_set_camera(w->view, c.eye, c.target);
}

static void camera_pan(run_window_state *w, const double pixels[2][2])
{
  window_camera c;
  double way[3];
  camera_get(w, &c);
  plane_move(w, c.target, pixels, way);
  for (int i = 0; i < 3; ++i) {
    c.eye[i] -= way[i];
    c.target[i] -= way[i];
  }
  view_set_camera(w->view, c.eye, c.target);
}

static void camera_zoom(run_window_state *w, double notches)
{
  window_camera c;
  camera_get(w, &c);
  for (int i = 0; i < 3; ++i) {
    c.eye[i] = c.target[i] - pow(ZOOM, notches) * c.distance * c.way[i];
  }
  view_set_camera(w->view, c.eye, c.target);
}

/* ---- the hand ---- */

static void hand_deepen(run_window_state *w, double notches)
{
  window_camera c;
  camera_get(w, &c);
  for (int i = 0; i < 3; ++i) {
    w->mouse.target[i] += DEPTH * notches * c.distance * c.way[i];
  }
  run_stage_pull(w->stage, w->mouse.target);
}

static void hand_move(run_window_state *w, const double pixels[2][2], bool deep)
{
  double way[3];
  if (deep) {
    hand_deepen(w, (pixels[0][1] - pixels[1][1]) / 15.0);
    return;
  }
  plane_move(w, w->mouse.target, pixels, way);
  for (int i = 0; i < 3; ++i) {
    w->mouse.target[i] += way[i];
  }
  run_stage_pull(w->stage, w->mouse.target);
}

static void hand_target(run_window_state *w)
{
  const view_pointer *p = &w->picture.frame.pointers[w->picture.hand];
  memcpy(w->mouse.target, p->is_pulled ? p->pull : p->device.position, sizeof w->mouse.target);
}

static void hand_take(run_window_state *w)
{
  hand_target(w);
  w->mouse.drag = DRAG_HAND;
}

/* Grabs the body that is seen there, or lets go of what is held. */
static void hand_grab(run_window_state *w)
{
  double point[3];
  double lift[3];
  window_camera c;
  if (w->picture.is_held) {
    run_stage_wish(w->stage, STAGE_LET_GO);
    return;
  }
  uint32_t body = view_pick(w->view, &w->picture.frame, w->mouse.at, point);
  if (body < w->picture.frame.body_count) {
    camera_get(w, &c);
    for (int i = 0; i < 3; ++i) {
      lift[i] = -LIFT * c.distance * c.way[i];
    }
    memcpy(w->mouse.target, point, sizeof point);
    run_stage_grab(w->stage, body, point, lift);
  }
}

/* ---- a recording ---- */

static double play_length(const run_window_state *w)
{
  return w->picture.is_over ? w->picture.end : w->picture.strips.seconds;
}

static void play_seek(run_window_state *w, double t)
{
  w->play.t = fmin(fmax(t, 0.0), w->picture.end);
}

static bool slider_drag(run_window_state *w, bool begins)
{
  double share = 0.0;
  const bool on = w->play.wanted && view_slider_at(w->view, w->mouse.at, &share);
  if (!on && (begins || w->mouse.drag != DRAG_SLIDER)) {
    return false;
  }
  play_seek(w, share * play_length(w));
  w->play.runs = false;
  return true;
}

/* ---- events ---- */

static run_window_state *state_of(GLFWwindow *window)
{
  return glfwGetWindowUserPointer(window);
}

static void on_cursor(GLFWwindow *window, double x, double y)
{
  run_window_state *w = state_of(window);
  int size[2];
  int pixels[2];
  glfwGetWindowSize(window, &size[0], &size[1]);
  glfwGetFramebufferSize(window, &pixels[0], &pixels[1]);
  const double now[2] = {x * pixels[0] / fmax(size[0], 1.0), y * pixels[1] / fmax(size[1], 1.0)};
  const double ends[2][2] = {{w->mouse.at[0], w->mouse.at[1]}, {now[0], now[1]}};
  memcpy(w->mouse.at, now, sizeof now);
  const bool shift = glfwGetKey(window, GLFW_KEY_LEFT_SHIFT) == GLFW_PRESS ||
                     glfwGetKey(window, GLFW_KEY_RIGHT_SHIFT) == GLFW_PRESS;
  switch (w->mouse.drag) {
    case DRAG_NONE:
      break;
    case DRAG_HAND:
      hand_move(w, ends, shift);
      break;
    case DRAG_ORBIT:
      camera_orbit(w, ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
      break;
    case DRAG_PAN:
      camera_pan(w, ends);
      break;
    case DRAG_SLIDER:
      (void)slider_drag(w, false);
      break;
  }
}

/* A hand that pulls needs an eye that stays. */
static void camera_hold(run_window_state *w)
{
  window_camera c;
  if (w->camera_free) {
    camera_get(w, &c);
    view_set_camera(w->view, c.eye, c.target);
    w->camera_free = false;
  }
}

static void left_press(run_window_state *w)
{
  const double now = glfwGetTime();
  const double way = hypot(w->mouse.at[0] - w->mouse.press[0], w->mouse.at[1] - w->mouse.press[1]);
  const bool twice = now - w->mouse.press_s < DOUBLE_CLICK_S && way < DOUBLE_CLICK_PX;
  if (slider_drag(w, true)) {
    w->mouse.drag = DRAG_SLIDER;
  } else if (w->picture.can_pull) {
    hand_take(w);
    if (twice) {
      hand_grab(w);
    }
  }
  w->mouse.press_s = twice ? 0.0 : now;
  memcpy(w->mouse.press, w->mouse.at, sizeof w->mouse.press);
}

static void on_button(GLFWwindow *window, int button, int action, int mods)
{
  run_window_state *w = state_of(window);
  (void)mods;
  if (!w->has_picture) {
    return;
  }
  camera_hold(w);
  if (action == GLFW_RELEASE) {
    w->mouse.drag = DRAG_NONE;
  } else if (button == GLFW_MOUSE_BUTTON_LEFT) {
    left_press(w);
  } else {
    w->mouse.drag = button == GLFW_MOUSE_BUTTON_RIGHT ? DRAG_ORBIT : DRAG_PAN;
  }
}

static void on_wheel(GLFWwindow *window, double x, double y)
{
  run_window_state *w = state_of(window);
  (void)x;
  if (w->has_picture) {
    camera_hold(w);
  }
  if (w->has_picture && w->mouse.drag == DRAG_HAND) {
    hand_deepen(w, y);
  } else if (w->has_picture) {
    camera_zoom(w, y);
  }
}

/* A SpaceMouse pushes the hand along the axes of the picture, and turns the view. */
static void spacemouse_act(run_window_state *w)
{
  double d[6];
  window_camera c;
  const bool moves = w->has_picture && run_spacemouse_read(&w->spacemouse, d);
  if (!moves || !w->picture.can_pull || (d[0] == 0.0 && d[1] == 0.0 && d[2] == 0.0)) {
    w->is_pushed = false;
  }
  if (!moves) {
    return;
  }
  camera_hold(w);
  camera_get(w, &c);
  if (w->picture.can_pull && (d[0] != 0.0 || d[1] != 0.0 || d[2] != 0.0)) {
    const double level = fmax(hypot(c.way[0], c.way[1]), 1e-6);
    const double right[3] = {c.way[1] / level, -c.way[0] / level, 0.0};
    const double up[3] = {right[1] * c.way[2], -right[0] * c.way[2],
                          right[0] * c.way[1] - right[1] * c.way[0]};
    if (!w->is_pushed && w->mouse.drag != DRAG_HAND) {
      hand_target(w);
    }
    for (int i = 0; i < 3; ++i) {
      w->mouse.target[i] +=
          PUSH_SPEED * c.distance * w->step_s * (d[0] * right[i] + d[1] * up[i] + d[2] * c.way[i]);
    }
    w->is_pushed = true;
    run_stage_pull(w->stage, w->mouse.target);
  }
  camera_orbit(w, TURN_SPEED * w->step_s * d[4] / ORBIT_PER_PX,
               TURN_SPEED * w->step_s * d[3] / ORBIT_PER_PX);
}

/* What the window does itself; false: the run does it. */
static bool act_here(run_window_state *w, run_act act)
{
  const bool plays = w->play.wanted;
  switch ((int)act) {
    case ACT_HELP:
      w->help = !w->help;
      return true;
    case ACT_QUIT:
      glfwSetWindowShouldClose(w->window, GLFW_TRUE);
      return true;
    case ACT_PLOTS:
      w->plots = !w->plots;
      return true;
    case ACT_EFFECTS:
      w->effects = !w->effects;
      return true;
    case ACT_LABELS:
      w->labels = !w->labels;
      return true;
    case ACT_CAMERA:
      w->camera_free = true;
      view_free_camera(w->view);
      return true;
    case ACT_PAUSE:
      w->play.runs = !w->play.runs;
      return plays;
    case ACT_SLOWER:
    case ACT_FASTER:
      play_seek(w, w->play.t + (act == ACT_FASTER ? SEEK_S : -SEEK_S));
      return plays;
    default:
      return false;
  }
}

static void act_do(run_window_state *w, run_act act)
{
  static const stage_wish wishes[ACT_COUNT] = {
      [ACT_HELP] = STAGE_WISHES,     [ACT_QUIT] = STAGE_WISHES,
      [ACT_PAUSE] = STAGE_PAUSE,     [ACT_STEP] = STAGE_STEP,
      [ACT_AGAIN] = STAGE_AGAIN,     [ACT_SCENE_NEXT] = STAGE_SCENE_NEXT,
      [ACT_MODEL] = STAGE_MODEL,     [ACT_SCENE_BEFORE] = STAGE_SCENE_BEFORE,
      [ACT_RATE_UP] = STAGE_RATE_UP, [ACT_RATE_DOWN] = STAGE_RATE_DOWN,
      [ACT_FINER] = STAGE_FINER,     [ACT_COARSER] = STAGE_COARSER,
      [ACT_SLOWER] = STAGE_SLOWER,   [ACT_FASTER] = STAGE_FASTER,
      [ACT_HAND] = STAGE_HAND,       [ACT_SCRIPT] = STAGE_SCRIPT,
      [ACT_LET_GO] = STAGE_LET_GO,   [ACT_RESET] = STAGE_RESET,
      [ACT_CAMERA] = STAGE_WISHES,   [ACT_PLOTS] = STAGE_WISHES,
      [ACT_EFFECTS] = STAGE_WISHES,  [ACT_LABELS] = STAGE_WISHES};
  if (act < ACT_COUNT && !act_here(w, act) && !w->play.wanted) {
    run_stage_wish(w->stage, wishes[act]);
  }
}

static void on_sign(GLFWwindow *window, unsigned code)
{
  run_window_state *w = state_of(window);
  char key[RUN_KEY_MAX] = "";
  if (code == ' ' || code == ',') {
    snprintf(key, sizeof key, "%s", code == ' ' ? "space" : "comma");
  } else if (code > ' ' && code < 127) {
    key[0] = (char)code;
  }
  if (key[0] != '\0') {
    act_do(w, run_keys_find(&w->options->window.keys, key));
  }
}

static void on_key(GLFWwindow *window, int code, int scan, int action, int mods)
{
  static const struct {
    int code;
    const char *name;
  } named[] = {{GLFW_KEY_ESCAPE, "escape"}, {GLFW_KEY_ENTER, "enter"}, {GLFW_KEY_TAB, "tab"},
               {GLFW_KEY_LEFT, "left"},     {GLFW_KEY_RIGHT, "right"}, {GLFW_KEY_UP, "up"},
               {GLFW_KEY_DOWN, "down"}};
  run_window_state *w = state_of(window);
  char key[RUN_KEY_MAX] = "";
  (void)scan;
  (void)mods;
  for (size_t i = 0; i < sizeof named / sizeof named[0]; ++i) {
    if (named[i].code == code) {
      snprintf(key, sizeof key, "%s", named[i].name);
    }
  }
  if (code >= GLFW_KEY_F1 && code <= GLFW_KEY_F12) {
    snprintf(key, sizeof key, "F%d", code - GLFW_KEY_F1 + 1);
  }
  if (key[0] != '\0' && action != GLFW_RELEASE) {
    act_do(w, run_keys_find(&w->options->window.keys, key));
  }
}

static void on_size(GLFWwindow *window, int width, int height)
{
  run_window_state *w = state_of(window);
  hap_detail why = {""};
  if (width < VIEW_PIXELS_MIN || height < VIEW_PIXELS_MIN) {
    return; /* an icon: it goes on with what it was */
  }
  if (view_resize(w->view, width, height, &why) < HAP_OK) {
    fprintf(stderr, "hapode-run: --view: %s\n", why.text);
    glfwSetWindowShouldClose(window, GLFW_TRUE);
  }
}

/* ---- opening ---- */

static hap_status window_refuse(hap_detail *detail)
{
  const char *why = "";
  (void)glfwGetError(&why);
  glfwTerminate();
  return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                   "--view needs a display with OpenGL 3.3: %.200s; --shot FILE draws without one",
                   why != NULL ? why : "");
}

static hap_status window_open(run_window_state *w, hap_detail *detail)
{
  const int *size = w->options->shot.size;
  int pixels[2];
  if (!glfwInit()) {
    return window_refuse(detail);
  }
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
  w->window = glfwCreateWindow(size[0], size[1], "hapode", NULL, NULL);
  if (w->window == NULL) {
    return window_refuse(detail);
  }
  glfwMakeContextCurrent(w->window);
  glfwSwapInterval(1);
  glfwGetFramebufferSize(w->window, &pixels[0], &pixels[1]);
  glfwSetWindowUserPointer(w->window, w);
  glfwSetCursorPosCallback(w->window, on_cursor);
  glfwSetMouseButtonCallback(w->window, on_button);
  glfwSetScrollCallback(w->window, on_wheel);
  glfwSetCharCallback(w->window, on_sign);
  glfwSetKeyCallback(w->window, on_key);
  glfwSetFramebufferSizeCallback(w->window, on_size);
  return view_create_here(pixels[0], pixels[1], &w->view, detail);
}

static void window_close(run_window_state *w)
{
  run_frame_free(&w->picture.frame);
  view_destroy(w->view);
  if (w->window != NULL) {
    glfwDestroyWindow(w->window);
    glfwTerminate();
  }
}

/* ---- pictures ---- */

static void help_describe(const run_window_state *w, view_panel *out)
{
  static const char *const mouse[][2] = {{"left button", "pulls the hand; shift, wheel: depth"},
                                         {"double click", "the hand grabs a body, or lets go"},
                                         {"right button", "turns the view"},
                                         {"middle button", "moves the view"},
                                         {"wheel", "nearer, farther"},
                                         {"SpaceMouse", "pushes the hand, turns the view"}};
  const size_t count = sizeof mouse / sizeof mouse[0] - (w->spacemouse.library == NULL);
  out->row_count = 0;
  snprintf(out->title, sizeof out->title, "keys and mouse");
  for (size_t i = 0; i < count; ++i) {
    char(*row)[72] = out->rows[out->row_count++];
    snprintf(row[0], sizeof row[0], "%s", mouse[i][0]);
    snprintf(row[1], sizeof row[1], "%s", mouse[i][1]);
  }
  for (int i = 0; i < ACT_COUNT; ++i) {
    const char *key = w->options->window.keys.key[i];
    if (key[0] != '\0') {
      char(*row)[72] = out->rows[out->row_count++];
      snprintf(row[0], sizeof row[0], "%s", key);
      snprintf(row[1], sizeof row[1], "%s", run_act_text((run_act)i));
    }
  }
}

static void labels_finish(run_window_state *w)
{
  view_labels *l = &w->picture.labels;
  const double length = play_length(w);
  const char *help = w->options->window.keys.key[ACT_HELP];
  if (!w->effects) {
    l->panels[0].row_count = 0;
  }
  l->panels[1].row_count = 0;
  if (w->help) {
    help_describe(w, &l->panels[1]);
    l->panels[0].row_count = 0;
  } else if (l->notice[0] == '\0' && glfwGetTime() - w->begun < HINT_S && help[0] != '\0') {
    snprintf(l->notice, sizeof l->notice, "%s: all keys%s", help,
             w->picture.can_pull ? "   left button: pull the hand" : "");
  }
  if (w->help) {
    l->notice[0] = '\0';
  }
  l->has_slider = w->play.wanted && length > 0.0;
  l->slider[0] = length > 0.0 ? fmin(w->play.t / length, 1.0) : 0.0;
  l->slider[1] = length > 0.0 ? fmin(w->picture.end / length, 1.0) : 0.0;
}

static void play_go_on(run_window_state *w, double step_s)
{
  if (w->play.wanted && w->play.runs) {
    play_seek(w, w->play.t + step_s);
  }
}

/* False: there is no memory for it. */
static bool picture_show(run_window_state *w)
{
  hap_detail why = {""};
  hap_status status = run_stage_scene(w->stage, w->view, &w->picture, &why);
  if (status < HAP_OK) {
    fprintf(stderr, "hapode-run: --view: %s\n", why.text);
    return false;
  }
  if (status == HAP_STALE) { /* another scene */
    w->has_picture = false;
    w->mouse.drag = DRAG_NONE;
    w->camera_free = !w->options->shot.camera_given;
    view_free_camera(w->view);
    if (!w->camera_free) {
      view_set_camera(w->view, w->options->shot.camera, &w->options->shot.camera[3]);
    }
  }
  if (!run_stage_take(w->stage, w->play.wanted ? w->play.t : -1.0, &w->picture)) {
    return true;
  }
  labels_finish(w);
  view_show(w->view, &w->picture.frame, w->plots ? &w->picture.strips : NULL,
            w->labels ? &w->picture.labels : NULL);
  glfwSwapBuffers(w->window);
  w->has_picture = true;
  /* where the mouse has the view, marks keep their size */
  view_set_calm(w->view, w->camera_free ? exp(-w->step_s / CALM_S) : 1.0);
  return true;
}

/* Until the window is closed, or the run is over: a recording can still be looked at then. */
static void window_loop(run_window_state *w)
{
  double last = glfwGetTime();
  w->begun = last;
  while (!glfwWindowShouldClose(w->window) && !run_loop_stop_wanted() &&
         (!w->picture.is_over || (w->play.wanted && w->picture.end > 0.0))) {
    const double now = glfwGetTime();
    w->step_s = now - last;
    play_go_on(w, w->step_s);
    spacemouse_act(w);
    last = now;
    if (!picture_show(w)) {
      break;
    }
    const double took = glfwGetTime() - now; /* a driver of software leaves the processor free */
    glfwWaitEventsTimeout(fmax(PICTURE_S - took, fmax(0.3 * took, 1e-3)));
  }
}

typedef struct window_run {
  run_options *options;
  int (*run)(run_options *options);
  int code;
} window_run;

static void *run_in_thread(void *arg)
{
  window_run *r = arg;
  r->code = r->run(r->options);
  run_stage_finish(r->options->window.stage);
  return NULL;
}

hap_status run_window(run_options *options, int (*run)(run_options *options), int *out_code,
                      hap_detail *detail)
{
  run_window_state w = {.options = options,
                        .plots = true,
                        .effects = false,
                        .labels = true,
                        .play = {.wanted = options->play_path != NULL, .runs = true}};
  window_run r = {options, run, 0};
  pthread_t thread = 0;
  hap_status status = window_open(&w, detail);
  w.stage = options->window.stage = status >= HAP_OK ? run_stage_create() : NULL;
  if (status >= HAP_OK &&
      (w.stage == NULL || pthread_create(&thread, NULL, run_in_thread, &r) != 0)) {
    status = hapi_fail(detail, HAP_ERROR_MEMORY, "--view: no memory for the run");
  }
  if (status >= HAP_OK) {
    run_spacemouse_open(&w.spacemouse);
    window_loop(&w);
    run_spacemouse_close(&w.spacemouse);
    run_stage_wish(w.stage, STAGE_END);
    pthread_join(thread, NULL);
    *out_code = r.code;
  }
  window_close(&w);
  run_stage_destroy(w.stage);
  options->window.stage = NULL;
  return status;
}
