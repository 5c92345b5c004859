/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* plugins/spidar: the bytes are a geometry file. What is taken is sound, and the same when it
 * was written and read again. */

#include <math.h>
#include <unistd.h>

#include "base/vec.h"
#include "plugins/spidar/tensions.h"
#include "tests/fuzz/fuzz.h"

static void check_use(const hapi_spidar_model *model)
{
  hapi_spidar_solver solver;
  hapi_spidar_tensions state;
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  double tension[HAPI_SPIDAR_STRINGS_MAX];
  const hap_wrench wanted = {{1.0, 2.0, 3.0}, {0.1, 0.0, -0.1}};
  hap_wrench reached;
  hap_pose pose;
  hapi_spidar_home(&pose);
  hapi_v3_copy(model->centre, pose.position);
  hapi_spidar_lengths(model, &pose, lengths);
  hapi_spidar_solver_init(&solver, model, NULL);
  FUZZ_CHECK(hapi_spidar_solve(&solver, model, lengths) != HAPI_SPIDAR_FIT_INVALID);
  FUZZ_CHECK(hapi_finite(solver.pose.position, 3) && hapi_finite(solver.pose.quat_wxyz, 4));
  hapi_spidar_tensions_init(&state, model);
  FUZZ_CHECK(hapi_spidar_tensions_solve(&state, model, &pose, &wanted, tension, &reached) >=
             HAP_OK);
  FUZZ_CHECK(state.changes >= 0);
  FUZZ_CHECK(hapi_finite(reached.force, 3) && hapi_finite(reached.torque, 3));
  for (int i = 0; i < model->strings; ++i) {
    FUZZ_CHECK(tension[i] >= model->min_tension && tension[i] <= model->max_tension);
  }
}

static void check_near(const double *a, const double *b, int count)
{
  for (int i = 0; i < count; ++i) {
    FUZZ_CHECK(fabs(a[i] - b[i]) <= 1e-8 * fabs(a[i]));
  }
}

/* Nine digits of it. */
static void check_again(const hapi_spidar_model *model)
{
  char path[64];
  hap_detail detail;
  hapi_spidar_model back;
  snprintf(path, sizeof path, "/tmp/fuzz-spidar-%ld", (long)getpid());
  hap_status status = hapi_spidar_model_write(path, model, &detail);
  FUZZ_CHECK(status == HAP_OK);
  status = hapi_spidar_model_read(path, &back, &detail);
  unlink(path);
  /* a figure on the edge of what is sound may be rounded over it */
  FUZZ_CHECK(status == HAP_OK || status == HAP_ERROR_FORMAT);
  if (status == HAP_OK) {
    FUZZ_CHECK(strcmp(back.name, model->name) == 0 && back.strings == model->strings);
    FUZZ_CHECK(back.dof == model->dof && back.calibrated == model->calibrated);
    check_near(&model->motor[0][0], &back.motor[0][0], 3 * HAPI_SPIDAR_STRINGS_MAX);
    check_near(&model->grip[0][0], &back.grip[0][0], 3 * HAPI_SPIDAR_STRINGS_MAX);
    check_near(model->metres_per_count, back.metres_per_count, HAPI_SPIDAR_STRINGS_MAX);
    check_near(model->offset, back.offset, HAPI_SPIDAR_STRINGS_MAX);
    check_near(&model->workspace_turn, &back.workspace_turn, 1);
  }
}

void fuzz_one(const uint8_t *data, size_t size)
{
  char path[64];
  hap_detail detail;
  hapi_spidar_model model;
  hapi_spidar_model before;
  int descriptor = fuzz_file(data, size, path, sizeof path);
  memset(&model, 0x5a, sizeof model);
  before = model;
  fuzz_detail_spoil(&detail);
  hap_status status = hapi_spidar_model_read(path, &model, &detail);
  fuzz_check_answer(status, status >= HAP_OK ? &model : NULL, &detail);
  if (status >= HAP_OK) {
    FUZZ_CHECK(hapi_spidar_model_check(&model, &detail) == HAP_OK);
    check_use(&model);
    check_again(&model);
  } else {
    FUZZ_CHECK(status == HAP_ERROR_FORMAT);
    FUZZ_CHECK(memcmp(&model, &before, sizeof model) == 0);
  }
  close(descriptor);
}
