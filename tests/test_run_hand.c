/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The simulated hand that the mouse of --view pulls. */

#include <math.h>
#include <string.h>

#include "device/device.h"
#include "tests/tap.h"
#include "tools/run_hand.h"

#define TICK_NS 1000000

typedef struct pulled {
  hap_device *inner;
  hap_device *outer;
  run_hand hand;
  hap_device_input in;
  int64_t now_ns;
} pulled;

static void pulled_finish(void *owned)
{
  pulled *p = owned;
  if (p->outer != NULL) {
    hapi_device_ops(p->outer)->stop(hapi_device_self(p->outer));
  }
  hap_device_close(p->outer);
  hap_device_close(p->inner);
}

static pulled *pulled_make(const char *spec)
{
  pulled *p = tap_own(sizeof *p, pulled_finish);
  REQUIRE(hap_device_open(spec, &p->inner, NULL) == HAP_OK);
  REQUIRE(run_hand_open(&p->hand, p->inner, &p->outer, NULL) == HAP_OK);
  REQUIRE(hapi_device_ops(p->outer)->start(hapi_device_self(p->outer)) == HAP_OK);
  return p;
}

/* A tick: read, then a force along x. */
static void pulled_tick(pulled *p, double force)
{
  hap_device_input *const in[1] = {&p->in};
  hap_device_output wanted = {.size = sizeof wanted, .wrench = {.force = {force, 0.0, 0.0}}};
  hap_device_output reached = {.size = sizeof reached};
  const hap_device_output *const to[1] = {&wanted};
  hap_device_output *const got[1] = {&reached};
  const hap_device_ops *ops = hapi_device_ops(p->outer);
  p->in = (hap_device_input){.size = sizeof p->in};
  REQUIRE(ops->read(hapi_device_self(p->outer), p->now_ns, in) == HAP_OK);
  REQUIRE(ops->write(hapi_device_self(p->outer), to, got) >= HAP_OK);
  p->now_ns += TICK_NS;
}

TEST(before_a_pull_the_device_goes_through)
{
  static const char spec[] = "virtual:path=0:0/0/0;1:0.1/0.2/0,hand=relaxed";
  pulled *p = pulled_make(spec);
  hap_device *bare;
  hap_device_input in = {.size = sizeof in};
  hap_device_input *const ins[1] = {&in};
  REQUIRE(hap_device_open(spec, &bare, NULL) == HAP_OK);
  REQUIRE(hapi_device_ops(bare)->start(hapi_device_self(bare)) == HAP_OK);
  for (int i = 0; i < 500; ++i) {
    const int64_t now = p->now_ns;
    pulled_tick(p, 0.0);
    REQUIRE(hapi_device_ops(bare)->read(hapi_device_self(bare), now, ins) == HAP_OK);
    CHECK(memcmp(&in.pose, &p->in.pose, sizeof in.pose) == 0);
    CHECK(memcmp(&in.twist, &p->in.twist, sizeof in.twist) == 0);
  }
  hapi_device_ops(bare)->stop(hapi_device_self(bare));
  hap_device_close(bare);
}

/* A spring of k gives way by F / k, and a hand with the mass m swings with sqrt(k / m). */
TEST(what_it_pushes_makes_it_lag)
{
  const struct {
    const char *spec;
    double stiffness;
  } cases[] = {{"virtual:path=0:0/0/0,hand=relaxed", 150.0},
               {"virtual:path=0:0/0/0,hand=tense", 800.0},
               {"virtual:path=0:0/0/0,hand=rigid", 150.0},
               {"virtual:path=0:0/0/0,mass=0.5,stiffness=300", 300.0}};
  for (size_t k = 0; k < sizeof cases / sizeof cases[0]; ++k) {
    pulled *p = pulled_make(cases[k].spec);
    for (int i = 0; i < 10; ++i) {
      pulled_tick(p, 0.0);
    }
    run_hand_pull(&p->hand, RUN_HAND_PULLED, (const double[3]){0.05, 0.02, -0.01});
    for (int i = 0; i < 6000; ++i) {
      pulled_tick(p, -3.0);
    }
    CHECK_NEAR(p->in.pose.position[0], 0.05 - 3.0 / cases[k].stiffness, 1e-6);
    CHECK_NEAR(p->in.pose.position[1], 0.02, 1e-6);
    CHECK_NEAR(p->in.pose.position[2], -0.01, 1e-6);
    CHECK_NEAR(p->in.twist.linear[0], 0.0, 1e-6);
  }
}

/* The velocity is the rate of the place, and no tick has a leap, also where the mouse leaps. */
TEST(the_way_is_smooth)
{
  pulled *p = pulled_make("virtual:path=0:0/0/0;0.5:0.05/0/0,hand=tense");
  double before[3] = {0.0, 0.0, 0.0};
  for (int i = 0; i < 2000; ++i) {
    if (i == 200 || i == 700) {
      run_hand_pull(&p->hand, RUN_HAND_PULLED, (const double[3]){i == 200 ? 0.5 : -0.5, 0.0, 0.0});
    } else if (i == 1200) {
      run_hand_pull(&p->hand, RUN_HAND_HOME, (const double[3]){0.0, 0.0, 0.0});
    }
    pulled_tick(p, 0.0);
    const double moved = p->in.pose.position[0] - before[0];
    CHECK_SAY(i == 0 || fabs(moved) < 0.003, "tick %d: %g", i, moved);
    CHECK_NEAR(moved / 1e-3, i > 0 ? p->in.twist.linear[0] : moved / 1e-3, 0.15);
    memcpy(before, p->in.pose.position, sizeof before);
  }
  CHECK_NEAR(before[0], 0.05, 1e-3); /* where its own motion has ended */
}
