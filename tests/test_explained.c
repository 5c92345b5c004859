/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A device that is moved over a washboard: what motion explains is not held back. By the public
 * headers, against the closed form. */

#include "tests/tap.h"

#include <math.h>

#include "tests/ode_world.h"

#define RADIUS 0.01
#define HEIGHT 0.001 /* m, of a wave */
#define LENGTH 0.004 /* m, of it */
#define DEPTH 0.002  /* m, of the hand in the middle of the wave */
#define WAY 0.3      /* m, along */
#define DIP 0.003    /* m, that a hand which taps goes up and down */
#define DOWN_S 0.5
#define WAVE (2.0 * M_PI / LENGTH)

typedef struct board {
  const char *name;
  double speed;     /* m/s, on the whole */
  double stiffness; /* N/m, of the pointer */
  double surface;   /* N/m, of the board; 0: the pointer's */
  double damping;   /* N s/m */
  int taps;         /* on the way */
} board;

static const board boards[] = {
    {"a_slow_hand_on_a_washboard", 0.1, 1000.0, 0.0, 0.0, 0},
    {"a_fast_one", 0.5, 1000.0, 0.0, 0.0, 0},
    {"one_of_a_metre_a_second", 1.0, 1000.0, 0.0, 0.0, 0},
    {"a_damper_on_a_washboard", 0.3, 1000.0, 0.0, 5.0, 0},
    {"a_strong_damper", 0.1, 500.0, 0.0, 20.0, 0},
    {"a_board_that_is_stiffer_than_the_hand", 0.2, 500.0, 3000.0, 0.0, 0},
    {"one_that_is_softer_with_a_damper", 0.3, 3000.0, 500.0, 3.0, 0},
    {"taps_on_a_slope", 0.05, 2000.0, 0.0, 3.0, 100},
    {"quick_taps", 0.05, 1000.0, 0.0, 6.0, 200},
};

typedef struct board_stage {
  dWorldID world;
  dSpaceID space;
  hap_session *session;
  hap_device *device;
  const board *row;
  uint32_t texture;
} board_stage;

static double board_height(void *unused, const double point[3])
{
  (void)unused;
  return HEIGHT * sin(WAVE * point[0]);
}

static void board_feel(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  const board_stage *s = user;
  (void)pointer;
  (void)geom;
  io->texture = s->texture;
  if (s->row->surface > 0.0) {
    io->stiffness = s->row->surface;
  }
}

static void board_end(void *owned)
{
  board_stage *s = owned;
  ode_world_end(s->session, s->world, s->space);
  hap_device_close(s->device);
}

/* Down, then along, with taps. */
static const char *board_path(const board *b)
{
  static char spec[16384];
  double seconds = WAY / b->speed;
  int parts = 2 * b->taps + 1;
  int used = snprintf(spec, sizeof spec, "virtual:max_force=20,path=0:0/0/0.02");
  for (int i = 0; i <= parts; ++i) {
    double share = (double)i / parts;
    double z = RADIUS - DEPTH + (i % 2 == 1 && i < parts ? DIP : 0.0);
    used += snprintf(spec + used, sizeof spec - (size_t)used, ";%.6f:%.6f/0/%.6f",
                     DOWN_S + share * seconds, share * WAY, z);
  }
  return spec;
}

static hap_pointer_id board_start(board_stage *s)
{
  hap_detail detail = {""};
  hap_session_def def;
  hap_ode_def ode;
  hap_texture_def texture;
  hap_pointer_def hand;
  hap_pointer_id id;
  ode_world_make(9.81, &s->world, &s->space);
  (void)dCreatePlane(s->space, 0.0, 0.0, 1.0, 0.0);
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  hap_texture_def_init(&texture, sizeof texture);
  hap_pointer_def_init(&hand, sizeof hand);
  def.drive = HAP_DRIVE_LOCKSTEP;
  ode.world = s->world;
  ode.space = s->space;
  ode.pointer_surface = board_feel;
  ode.user = s;
  s->session = session_make(&def, &ode);
  texture.height = board_height;
  REQUIRE(hap_session_add_texture(s->session, &texture, &s->texture) == HAP_OK);
  REQUIRE_SAY(hap_device_open(board_path(s->row), &hand.device, &detail) == HAP_OK, "%s",
              detail.text);
  s->device = hand.device;
  hand.radius = RADIUS;
  hand.stiffness = s->row->stiffness;
  hand.damping = s->row->damping;
  REQUIRE(hap_pointer_add(s->session, &hand, &id) == HAP_OK);
  session_run(s->session);
  return id;
}

/* N, up, of a ball that goes along x at that place: spring and damper push along n - grad h. */
static double board_force(const board *b, double x, double depth, const double v[3])
{
  double k = b->surface > 0.0 ? b->surface : b->stiffness;
  double slope = HEIGHT * WAVE * cos(WAVE * x);
  double spring = k * (depth + HEIGHT * sin(WAVE * x));
  if (!(spring > 0.0)) {
    return 0.0;
  }
  return fmax(spring + b->damping * (v[0] * slope - v[2]), 0.0);
}

TEST_EACH(boards, const board *row)
{
  board_stage *s = tap_own(sizeof *s, board_end);
  s->row = row;
  hap_pointer_id hand = board_start(s);
  unsigned held = 0;
  double off = 0.0;
  double most = 0.0;
  int ticks = (int)lround(1e3 * (DOWN_S + WAY / row->speed));
  for (int i = 0; i < ticks; ++i) {
    hap_pointer_state state;
    REQUIRE(hap_session_advance(s->session, 1) == HAP_OK);
    REQUIRE(hap_pointer_get(s->session, hand, &state, sizeof state) == HAP_OK);
    held += (state.guard & HAP_GUARD_INPUT) != 0;
    if (i > 1e3 * DOWN_S + 5.0) {
      double depth = RADIUS - state.proxy.position[2];
      double right = board_force(row, state.proxy.position[0], depth, state.twist.linear);
      off = fmax(off, fabs(state.wrench.force[2] - right));
      most = fmax(most, right);
    }
  }
  printf("# %u of %d ticks held back, off by %.3g of %.3g N\n", held, ticks, off, most);
  CHECK(held == 0);
  CHECK(most > 0.5 && off <= 1e-4 * most); /* the twist is an estimate */
}
