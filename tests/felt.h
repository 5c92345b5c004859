/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_FELT_H
#define HAPODE_TESTS_FELT_H

/* What a hand feels, for the tests of faults: the device "virtual" with its simulated hand,
 * behind a device that can break and that keeps book of every write. One at a time. Include
 * after tap.h. */

#include <stdatomic.h>

#include <hapode/device_impl.h>
#include <hapode/hapode.h>

#include "base/vec.h"
#include "device/device.h"
#include "tests/stage.h"

#define FELT_LIMIT 10.0 /* N, of the device */
#define FELT_STEP 5.0   /* N a tick: the default slew limit, at 1 kHz */

typedef struct felt_book {
  const hap_device_ops *hand;
  void *self;

  /* How it is broken. */
  atomic_int fail_read;
  atomic_int fail_write;
  atomic_int fail_start;
  atomic_int lost; /* as one that is unplugged: from this on nothing but a start brings it back */
  int starts;
  atomic_int bad_pose;
  atomic_int block_ms;   /* the next read takes so long */
  double jump;           /* m, along x, that the device is off */
  bool fast;             /* says that it moves at 500 m/s */
  atomic_int holds;      /* it has a force */
  atomic_int ever_holds; /* since this was last set to 0 */

  /* What the hand felt. */
  double force[3];  /* N, held, by the loop: felt_force knows of a zero */
  double peak;      /* N */
  double steepest;  /* N, between two writes */
  int bad;          /* writes that were not finite, beyond the limit or too steep */
  int writes;       /* that it took */
  atomic_int zeros; /* calls of zero */
  double at[3];     /* m, the hand */
  bool placed;      /* it was read once */
  double work;      /* J, that the force did on the hand */
  double work_most; /* J, largest at any time */
  double work_once; /* J, largest between two reads */
  double way_most;  /* m, that the hand went, largest between two reads */
} felt_book;

static felt_book felt;
static atomic_int felt_let_go; /* by zero, of any thread, since the last write */

static inline hap_status felt_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  felt.hand = hapi_registry_find("virtual", 7);
  *self = &felt;
  return felt.hand->open(NULL, args, &felt.self, detail);
}

static inline void felt_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)self;
  felt.hand->describe(felt.self, effector, out);
}

static inline hap_status felt_start(void *self)
{
  (void)self;
  ++felt.starts;
  if (atomic_load(&felt.fail_start) != 0) {
    return HAP_ERROR_DEVICE;
  }
  atomic_store(&felt.lost, 0);
  return felt.hand->start(felt.self);
}

static inline void felt_drop(void)
{
  if (atomic_load(&felt_let_go) != 0) {
    memset(felt.force, 0, sizeof felt.force);
  }
}

static inline void felt_move(const double at[3])
{
  felt_drop();
  double way[3];
  hapi_v3_sub(at, felt.at, way);
  double work = felt.placed ? hapi_v3_dot(felt.force, way) : 0.0;
  felt.work += work;
  felt.work_most = fmax(felt.work_most, felt.work);
  felt.work_once = fmax(felt.work_once, work);
  felt.way_most = fmax(felt.way_most, felt.placed ? hapi_v3_norm(way) : 0.0);
  felt.placed = true;
  hapi_v3_copy(at, felt.at);
}

static inline hap_status felt_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  int block_ms = atomic_exchange(&felt.block_ms, 0);
  (void)self;
  if (block_ms > 0) {
    sleep_ms(block_ms);
  }
  if (atomic_load(&felt.lost) != 0) {
    return HAP_ERROR_DEVICE;
  }
  hap_status status = felt.hand->read(felt.self, time_ns, out);
  felt_move(in->pose.position);
  in->pose.position[0] += felt.jump;
  in->twist.linear[0] += felt.fast ? 500.0 : 0.0;
  if (atomic_load(&felt.bad_pose) != 0) {
    in->pose.position[1] = (double)NAN;
  }
  return atomic_load(&felt.fail_read) != 0 ? HAP_ERROR_DEVICE : status;
}

static inline void felt_hold(const double force[3])
{
  hapi_v3_copy(force, felt.force);
  atomic_store(&felt_let_go, 0);
  bool holds = hapi_v3_norm(force) > 0.0;
  atomic_store(&felt.holds, holds);
  if (holds) {
    atomic_store(&felt.ever_holds, 1);
  }
}

static inline hap_status felt_write(void *self, const hap_device_output *const wanted[],
                                    hap_device_output *const reached[])
{
  double change[3];
  (void)self;
  if (atomic_load(&felt.fail_write) != 0 || atomic_load(&felt.lost) != 0) {
    return HAP_ERROR_DEVICE;
  }
  felt_drop();
  hapi_v3_sub(wanted[0]->wrench.force, felt.force, change);
  double force = hapi_v3_norm(wanted[0]->wrench.force);
  double step = hapi_v3_norm(change);
  /* Also when it is NaN. */
  felt.bad += !(force <= FELT_LIMIT * (1.0 + 1e-9) && step <= FELT_STEP * (1.0 + 1e-9));
  felt.peak = fmax(felt.peak, force);
  felt.steepest = fmax(felt.steepest, step);
  ++felt.writes;
  felt_hold(wanted[0]->wrench.force);
  return felt.hand->write(felt.self, wanted, reached);
}

static inline void felt_zero(void *self)
{
  (void)self;
  atomic_fetch_add(&felt.zeros, 1);
  atomic_store(&felt_let_go, 1);
  atomic_store(&felt.holds, 0);
  felt.hand->zero(felt.self);
}

static inline void felt_stop(void *self)
{
  (void)self;
  felt.hand->stop(felt.self);
}

static inline void felt_close(void *self)
{
  (void)self;
  felt.hand->close(felt.self);
}

static const hap_device_ops felt_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "felt",
    .help = "for tests",
    .pacing = HAP_PACING_VIRTUAL,
    .open = felt_open,
    .describe = felt_describe,
    .start = felt_start,
    .read = felt_read,
    .write = felt_write,
    .zero = felt_zero,
    .stop = felt_stop,
    .close = felt_close,
};

/* What a test is made of: a stage, whose cube is replaced by a box with its face at x = -0.05 m,
 * and the hand before it. */
typedef struct felt_stage {
  stage s;
  hap_device *device;
  hap_pointer_def def;
  hap_pointer_expert_def pointer_expert;
  hap_pointer_research_def pointer_research;
  hap_pointer_id hand;
  hap_pointer_state state; /* of the last look */
} felt_stage;

/* A box of 1 m and 1 kg; body NULL: a wall. Its face is that of the stage's cube. */
static inline void felt_set_box(felt_stage *f, bool body)
{
  dMass mass;
  dGeomDestroy(f->s.geom);
  f->s.geom = dCreateBox(f->s.space, 1.0, 1.0, 1.0);
  dMassSetBoxTotal(&mass, 1.0, 1.0, 1.0, 1.0);
  dBodySetMass(f->s.cube, &mass);
  if (body) {
    dGeomSetBody(f->s.geom, f->s.cube);
  }
  dBodySetPosition(f->s.cube, 0.45, 0.0, 0.0);
  dGeomSetPosition(f->s.geom, 0.45, 0.0, 0.0);
}

static inline void felt_init(felt_stage *f, hap_drive drive, bool body)
{
  memset(f, 0, sizeof *f);
  memset(&felt, 0, sizeof felt);
  atomic_store(&felt_let_go, 0);
  stage_init(&f->s, drive);
  felt_set_box(f, body);
  pointer_defs_init(&f->def, &f->pointer_expert, &f->pointer_research);
  f->pointer_expert.coupling = HAP_COUPLING_DIRECT;
}

/* args: of the device "virtual". */
static inline bool felt_begin(felt_stage *f, const char *args)
{
  char spec[400];
  hap_detail detail = {""};
  snprintf(spec, sizeof spec, "%s,max_force=%g", args, FELT_LIMIT);
  if (hapi_device_open_ops(&felt_ops, NULL, spec, &f->device, &detail) != HAP_OK ||
      stage_create(&f->s) != HAP_OK) {
    printf("# %s%s\n", detail.text, f->s.detail.text);
    return false;
  }
  f->def.device = f->device;
  bool good = hap_pointer_add(f->s.session, &f->def, &f->hand) == HAP_OK &&
              hap_session_start(f->s.session) == HAP_OK;
  if (!good) {
    printf("# %s\n", detail_of(&f->s));
  }
  return good;
}

static inline void felt_end(felt_stage *f)
{
  stage_end(&f->s);
  hap_device_close(f->device);
  CHECK(atomic_load(&felt.holds) == 0); /* zero comes last */
  CHECK(felt.bad == 0);
}

static inline uint32_t felt_guard(felt_stage *f)
{
  CHECK(hap_pointer_get(f->s.session, f->hand, &f->state, sizeof f->state) == HAP_OK);
  return f->state.guard;
}

static inline double felt_force(void)
{
  felt_drop();
  return hapi_v3_norm(felt.force);
}

#endif
