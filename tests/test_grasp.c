/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Two fingers hold a box: by how much grip, for how long, and with the motion of recorded
 * fingers. */

#include "tests/tap.h"

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "tests/owned_rig.h"

#define MASS 0.3
#define GRAVITY 9.81
#define MU 0.5
#define STIFFNESS 2000.0
#define EDGE 0.06
#define RADIUS 0.01
#define HEIGHT 0.08 /* m, of the hands when they hold */

typedef struct hold {
  hap_model model;
  double physics_hz;
  double grip;   /* of what is needed */
  double beside; /* m, of the middle */
  double finger; /* m */
  const char *device;
  hap_coupling coupling;
} hold;

typedef struct held {
  double lost;  /* m, by which the box came down while it was held */
  double last;  /* m, height of the box at the end */
  double turn;  /* rad, about x, in that time */
  double force; /* N, largest */
} held;

static scene_parameters cube_grasp(void)
{
  size_t i = 0;
  while (strcmp(scene_table_at(i)->name, "grasp") != 0) {
    ++i;
  }
  return *scene_table_at(i);
}

/* "hand" of one side: from apart to a depth, up, and still. */
static void write_hand(const hold *h, double side, char *out, size_t size)
{
  double depth = h->grip * MASS * GRAVITY / (2.0 * MU) / STIFFNESS;
  double open = side * (EDGE / 2 + RADIUS + 0.001);
  double close = side * (EDGE / 2 + RADIUS - depth);
  snprintf(out, size,
           "virtual:%spath=0:%g/%g/0.03;0.3:%.9g/%g/0.03;1.2:%.9g/%g/%g,blend=smooth,hand=rigid",
           h->device != NULL ? h->device : "", open, h->beside, close, h->beside, close, h->beside,
           HEIGHT);
}

static void read_row(const rig *r, hap_trace_row *out)
{
  size_t count = 0;
  CHECK(hap_session_trace_read(r->session, out, 1, sizeof(hap_trace_row), &count) == HAP_OK &&
        count == 1);
}

/* Held from 2 s on, for that long. */
static held hold_box(const hold *h, double seconds)
{
  held out = {0};
  char hands[2][256];
  rig_options options;
  hap_trace_row row;
  scene_parameters parameters = cube_grasp();
  rig_options_init(&options);
  parameters.friction = MU;
  parameters.finger_radius = h->finger;
  parameters.mass = MASS;
  for (int i = 0; i < 2; ++i) {
    write_hand(h, i == 0 ? -1.0 : 1.0, hands[i], sizeof hands[i]);
    parameters.hands[i] = hands[i];
  }
  options.parameters = &parameters;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.model = h->model;
  options.def.physics_hz = h->physics_hz;
  options.expert.trace_rows = 4;
  options.coupling = h->coupling;
  options.coupling_stiffness = h->coupling == HAP_COUPLING_PROXY ? 5000.0 : 0.0;
  rig *r = rig_own(&options);
  REQUIRE(hap_session_start(r->session) >= HAP_OK);
  double before = 0.0;
  for (int i = 0; i < (int)(1000.0 * (2.0 + seconds)); ++i) {
    CHECK(hap_session_advance(r->session, 1) == HAP_OK);
    read_row(r, &row);
    out.last = row.body_position[0][2];
    if (i == 2000) {
      before = out.last;
      out.turn = 2.0 * dBodyGetQuaternion(r->scene->bodies[0])[1];
    }
    for (int k = 0; k < 2; ++k) {
      const double *f = row.pointers[k].force;
      out.force = fmax(out.force, sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]));
    }
  }
  out.lost = before - out.last;
  out.turn = 2.0 * dBodyGetQuaternion(r->scene->bodies[0])[1] - out.turn;
  tap_release(r);
  return out;
}

TEST(a_box_that_is_held_does_not_creep)
{
  static const hold all[] = {
      {HAP_MODEL_CONTACT, 60.0, 1.5, 0.0, 0.0, NULL, HAP_COUPLING_AUTO},
      {HAP_MODEL_CONTACT, 20.0, 1.5, 0.0, 0.0, "quantum=3e-5,delay=0.001,", HAP_COUPLING_DIRECT},
      {HAP_MODEL_CONTACT, 60.0, 1.5, 0.0, 0.0, "quantum=3e-5,", HAP_COUPLING_PROXY},
      {HAP_MODEL_CONTACT, 60.0, 1.5, 0.002, 0.006, "dof=6,quantum=3e-5,", HAP_COUPLING_AUTO},
      {HAP_MODEL_SINGLE, 60.0, 1.5, 0.0, 0.0, NULL, HAP_COUPLING_AUTO},
      {HAP_MODEL_ACCELERANCE, 60.0, 1.5, 0.0, 0.0, NULL, HAP_COUPLING_AUTO},
  };
  for (size_t i = 0; i < sizeof all / sizeof all[0]; ++i) {
    held h = hold_box(&all[i], 10.0);
    printf("# %s: came down %.3f um, turned %.2g rad, z %.4f, %.2f N\n",
           hap_model_name(all[i].model), 1e6 * h.lost, h.turn, h.last, h.force);
    CHECK(fabs(h.lost) <= 1e-4);
    CHECK(h.last > HEIGHT - 0.005);
  }
}

TEST(with_less_grip_than_it_needs_the_box_slides)
{
  static const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_SINGLE, HAP_MODEL_ACCELERANCE};
  for (int i = 0; i < 3; ++i) {
    const hold weak = {models[i], 60.0, 0.9, 0.0, 0.0, NULL, HAP_COUPLING_AUTO};
    held h = hold_box(&weak, 0.5);
    printf("# %s: z %.4f\n", hap_model_name(models[i]), h.last);
    CHECK(h.last < 0.5 * EDGE + 1e-3); /* it is on the floor */
  }
}

/* A box that is gripped beside its middle hangs down if nothing holds it against turning. */
TEST(without_soft_fingers_a_box_swings)
{
  const hold bare = {HAP_MODEL_CONTACT, 60.0, 3.0, 0.006, 0.0, NULL, HAP_COUPLING_AUTO};
  hold soft = bare;
  soft.finger = 0.008;
  held swings = hold_box(&bare, 1.0);
  held stays = hold_box(&soft, 1.0);
  CHECK(fabs(swings.turn) > 0.1);
  CHECK(fabs(stays.turn) < 0.02);
}

/* ---- recorded fingers ---- */

/* Thumb and index of one hand, which close three times in this time, about a box at their
 * middle. */
#define PLACE "scale=0.5,rotate=0.983/0/0/0.1835,offset=-0.1126/-0.1899/-0.0665,start=8"

typedef struct grips {
  int both;     /* ticks in which both fingers touch */
  double steep; /* N, most from tick to tick */
  double peak;  /* N */
  double high;  /* m, of the box */
} grips;

static void note_fingers(const hap_trace_row *row, hap_trace_row *before, grips *out)
{
  bool both = true;
  for (int k = 0; k < 2; ++k) {
    const double *f = row->pointers[k].force;
    const double *g = before->pointers[k].force;
    double change[3] = {f[0] - g[0], f[1] - g[1], f[2] - g[2]};
    double force = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    both = both && force > 0.0;
    CHECK(isfinite(force));
    out->peak = fmax(out->peak, force);
    out->steep = fmax(out->steep,
                      sqrt(change[0] * change[0] + change[1] * change[1] + change[2] * change[2]));
  }
  out->both += both;
  out->high = fmax(out->high, row->body_position[0][2]);
  *before = *row;
}

TEST(recorded_fingers_grip_a_box)
{
  static const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_SINGLE};
  const char *shared = getenv("HAPODE_SHARED");
  const char *folder = shared != NULL ? shared : "../shared";
  static const char *const files[] = {"dfki_thumb_middle.csv", "dfki_index_tip.csv"};
  char specs[2][700];
  for (int k = 0; k < 2; ++k) {
    snprintf(specs[k], sizeof specs[k], "%s/data/%s", folder, files[k]);
    FILE *file = fopen(specs[k], "r");
    if (file == NULL) {
      SKIP("needs the recordings of HAPODE_SHARED/data");
    }
    fclose(file);
    snprintf(specs[k], sizeof specs[k], "replay:%s/data/%s," PLACE, folder, files[k]);
  }
  for (int m = 0; m < 2; ++m) {
    grips out = {0};
    hap_trace_row before = {0};
    hap_trace_row row;
    rig_options options;
    scene_parameters parameters = cube_grasp();
    parameters.size = 0.036;
    rig_options_init(&options);
    options.parameters = &parameters;
    options.devices[0] = specs[0];
    options.devices[1] = specs[1];
    options.device_count = 2;
    options.def.drive = HAP_DRIVE_LOCKSTEP;
    options.def.model = models[m];
    options.expert.trace_rows = 4;
    rig *r = rig_own(&options);
    REQUIRE(hap_session_start(r->session) == HAP_OK);
    for (int i = 0; i < 50000; ++i) {
      CHECK(hap_session_advance(r->session, 1) == HAP_OK);
      read_row(r, &row);
      note_fingers(&row, &before, &out);
    }
    printf("# %s: both touch in %d ticks, peak %.2f N, steepest %.2f N, box up to %.4f m\n",
           hap_model_name(models[m]), out.both, out.peak, out.steep, out.high);
    CHECK(out.both > 1000);
    CHECK(out.steep < 2.0); /* 1 mm a tick */
    CHECK(out.peak > 5.0 && out.peak < 20.0);
    hap_stats stats;
    CHECK(hap_session_stats(r->session, &stats, sizeof stats) == HAP_OK);
    CHECK(stats.faults.count == 0 && stats.faults.states_rejected == 0);
  }
}
