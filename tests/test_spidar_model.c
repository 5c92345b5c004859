/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Models of string devices, their check and their file. */

#include "tests/tap.h"

#include <unistd.h>

#include "base/vec.h"
#include "plugins/spidar/kinematics.h"
#include "plugins/spidar/model.h"

#define MODELS 7

static char path[64]; /* of this test alone */

static const hapi_spidar_model *model_of(const char *name)
{
  const hapi_spidar_model *model = hapi_spidar_model_find(name);
  if (model == NULL) {
    printf("Bail out! no model %s\n", name);
    exit(1);
  }
  return model;
}

/* ---- the built-in ones ---- */

TEST(built_in_models_are_sound)
{
  int count = 0;
  for (; hapi_spidar_model_at((size_t)count) != NULL; ++count) {
    hap_detail detail = {""};
    const hapi_spidar_model *model = hapi_spidar_model_at((size_t)count);
    CHECK(hapi_spidar_model_check(model, &detail) == HAP_OK);
    CHECK(detail.text[0] == '\0');
    CHECK(hapi_spidar_model_find(model->name) == model);
  }
  CHECK(count == MODELS);
  CHECK(hapi_spidar_model_find("X4R") == hapi_spidar_model_find("x4r"));
  CHECK(hapi_spidar_model_find("x9") == NULL && hapi_spidar_model_find("") == NULL);
}

/* A string's signs, as bits: 1 is below 0. */
static unsigned negative(const double *values, int count)
{
  unsigned bits = 0;
  for (int i = 0; i < count; ++i) {
    bits |= values[i] < 0.0 ? 1u << i : 0u;
  }
  return bits;
}

typedef struct figures {
  const char *name;
  double volts, counts, least, most;
  unsigned counts_negative, volts_negative; /* bit i: string i */
  double motor_sum[3], grip_sum[3];         /* mm, sum over i of (i + 1) * point */
} figures;

/* Weighted sums, so that two exchanged points show; computed apart from the tables. */
static const figures known[] = {
    {
        "x4r",
        0.08,
        3.485e-5,
        0.2,
        20.0,
        0xC3,
        0x3C,
        {-552, 1520, 0},
        {-45, 180, 0},
    },
    {"x5r", 0.091, 2.25e-5, 0.3, 6.0, 0x55, 0xAA, {0, 1176, -620}, {30, 120, 0}},
    {"x5l", 0.091, 2.25e-5, 0.3, 6.0, 0, 0, {-620, -1176, 0}, {0, -120, 30}},
    {"t1", 0.04, 5.1645e-5, 0.3, 20.0, 0x3C, 0xC3, {225.734, 1681.1, -1872.72}, {-46, 307.2, -46}},
    {"x3r",
     0.3652968,
     1.66555e-5,
     0.3,
     20.0,
     0x3C,
     0,
     {339.412, 1216, -339.412},
     {31.82, 180, 31.82}},
    {"x3r4", 0.3652968, 1.66555e-5, 0.3, 20.0, 0x6, 0, {120, 280, 0}, {0, 0, 0}},
};

TEST(built_in_models_have_the_published_figures)
{
  for (size_t k = 0; k < sizeof known / sizeof known[0]; ++k) {
    const figures *f = &known[k];
    const hapi_spidar_model *m = model_of(f->name);
    CHECK_NEAR(m->min_tension, f->least, 0.0);
    CHECK_NEAR(m->max_tension, f->most, 0.0);
    CHECK(negative(m->metres_per_count, m->strings) == f->counts_negative);
    CHECK(negative(m->volts_per_newton, m->strings) == f->volts_negative);
    double motor[3] = {0.0};
    double grip[3] = {0.0};
    for (int i = 0; i < m->strings; ++i) {
      CHECK_NEAR(fabs(m->metres_per_count[i]), f->counts, 0.0);
      CHECK_NEAR(fabs(m->volts_per_newton[i]), f->volts, 0.0);
      hapi_v3_madd(motor, 1e3 * (i + 1), m->motor[i], motor);
      hapi_v3_madd(grip, 1e3 * (i + 1), m->grip[i], grip);
    }
    for (int axis = 0; axis < 3; ++axis) {
      CHECK_NEAR(motor[axis], f->motor_sum[axis], 1e-9);
      CHECK_NEAR(grip[axis], f->grip_sum[axis], 1e-9);
    }
  }
}

int main(void)
{
  snprintf(path, sizeof path, "/tmp/spidar-model-%ld.txt", (long)getpid());
  RUN(built_in_models_are_sound);
  RUN(built_in_models_have_the_published_figures);
  unlink(path);
  return tap_done();
}
