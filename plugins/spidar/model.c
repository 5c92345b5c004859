/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The built-in models. Points are written in millimetres, and divided so that each is the double
 * nearest to it, as a geometry file gives it. */

#include "plugins/spidar/model.h"

#include <strings.h>

#include "base/vec.h"

#define MM(x, y, z)                          \
  {                                          \
    (x) / 1000.0, (y) / 1000.0, (z) / 1000.0 \
  }
#define DEGREES 57.29577951308232087679815481410517
/* No figure of a motor's heat is published: half of the largest tension for ever, and the 20 s over
 * which the boards' own heat limit sums. */
#define HEAT_SHARE 0.5
#define HEAT_TIME 20.0
/* Of 1 N at the middle of the workspace 0.97 N and more are reached in all directions (t1 needs
 * less). */
#define SPREAD 0.0075

/* Signs of eight figures of one size. */
#define SIGNED(f, a, b, c, d, e, g, h, i)          \
  {                                                \
    a(f), b(f), c(f), d(f), e(f), g(f), h(f), i(f) \
  }

#define X4_MOTORS                                                                            \
  {                                                                                          \
    MM(69, -95, -69), MM(69, -95, 69), MM(-69, -95, 69), MM(-69, -95, -69), MM(69, 95, -69), \
        MM(69, 95, 69), MM(-69, 95, 69), MM(-69, 95, -69)                                    \
  }
#define X4_GRIP                                                                        \
  {                                                                                    \
    MM(0, -22.5, 0), MM(22.5, 0, 0), MM(-22.5, 0, 0), MM(0, -22.5, 0), MM(0, 22.5, 0), \
        MM(22.5, 0, 0), MM(-22.5, 0, 0), MM(0, 22.5, 0)                                \
  }

/* What both hands of a model share, but its name. */
#define X4                                                                                       \
  .strings = 8, .dof = 6, .board = HAPI_SPIDAR_UART, .motor = X4_MOTORS, .grip = X4_GRIP,        \
  .volts_per_newton = SIGNED(0.08, +, +, -, -, -, -, +, +),                                      \
  .metres_per_count = SIGNED(3.485e-5, -, -, +, +, +, +, -, -), .min_tension = 0.2,              \
  .max_tension = 20.0, .tension_rate = 4000.0, .torque_weight = 3000.0, .spread_weight = SPREAD, \
  .workspace = MM(30, 40, 30), .workspace_turn = 45 / DEGREES, .residual = 1 / 1000.0,           \
  .heat_tension = HEAT_SHARE * 20.0, .heat_time = HEAT_TIME

static const hapi_spidar_model models[] = {
    {.name = "x4r", X4},
    {.name = "x4l", X4},
    {.name = "x5r",
     .strings = 8,
     .dof = 6,
     .board = HAPI_SPIDAR_UART,
     .motor = {MM(-77.5, -73.5, 77.5), MM(77.5, -73.5, 77.5), MM(77.5, -73.5, -77.5),
               MM(-77.5, -73.5, -77.5), MM(-77.5, 73.5, 77.5), MM(77.5, 73.5, 77.5),
               MM(77.5, 73.5, -77.5), MM(-77.5, 73.5, -77.5)},
     .grip = {MM(-15, 0, 0), MM(15, 0, 0), MM(0, -15, 0), MM(0, -15, 0), MM(-15, 0, 0),
              MM(15, 0, 0), MM(0, 15, 0), MM(0, 15, 0)},
     .volts_per_newton = SIGNED(0.091, +, -, +, -, +, -, +, -),
     .metres_per_count = SIGNED(2.25e-5, -, +, -, +, -, +, -, +),
     .min_tension = 0.3,
     .max_tension = 6.0,
     .tension_rate = 1200.0,
     .torque_weight = 6600.0,
     .spread_weight = SPREAD,
     .workspace = MM(35, 35, 35),
     .workspace_turn = 45 / DEGREES,
     .residual = 1 / 1000.0,
     .heat_tension = HEAT_SHARE * 6.0,
     .heat_time = HEAT_TIME},
    {.name = "x5l",
     .strings = 8,
     .dof = 6,
     .board = HAPI_SPIDAR_UART,
     .motor = {MM(77.5, 73.5, -77.5), MM(77.5, 73.5, 77.5), MM(-77.5, 73.5, 77.5),
               MM(-77.5, 73.5, -77.5), MM(77.5, -73.5, -77.5), MM(77.5, -73.5, 77.5),
               MM(-77.5, -73.5, 77.5), MM(-77.5, -73.5, -77.5)},
     .grip = {MM(0, 0, -15), MM(0, 0, 15), MM(0, 15, 0), MM(0, 15, 0), MM(0, 0, -15), MM(0, 0, 15),
              MM(0, -15, 0), MM(0, -15, 0)},
     .volts_per_newton = SIGNED(0.091, +, +, +, +, +, +, +, +),
     .metres_per_count = SIGNED(2.25e-5, +, +, +, +, +, +, +, +),
     .min_tension = 0.3,
     .max_tension = 6.0,
     .tension_rate = 1200.0,
     .torque_weight = 6600.0,
     .spread_weight = SPREAD,
     .workspace = MM(35, 35, 35),
     .workspace_turn = 45 / DEGREES,
     .residual = 1 / 1000.0,
     .heat_tension = HEAT_SHARE * 6.0,
     .heat_time = HEAT_TIME},
    {.name = "t1",
     .strings = 8,
     .dof = 6,
     .board = HAPI_SPIDAR_UART,
     /* The outer x of the first four is inferred: the makers' source has a slip of unit there. */
     .motor = {MM(-37.078, -90, 0), MM(-114.5, -90, 0), MM(114.5, -90, 0), MM(37.078, -90, 0),
               MM(0, 73.59, -162.09), MM(0, 82.90, -135.35), MM(0, 108.97, -39.43),
               MM(0, 119.12, 3.23)},
     .grip = {MM(0, -19.2, 23), MM(0, -19.2, -23), MM(0, -19.2, 23), MM(0, -19.2, -23),
              MM(23, 19.2, 0), MM(-23, 19.2, 0), MM(23, 19.2, 0), MM(-23, 19.2, 0)},
     .volts_per_newton = SIGNED(0.04, -, -, +, +, +, +, -, -),
     .metres_per_count = SIGNED(5.1645e-5, +, +, -, -, -, -, +, +),
     .min_tension = 0.3,
     .max_tension = 20.0,
     .tension_rate = 4000.0,
     .torque_weight = 2600.0,
     .spread_weight = 0.003,
     /* At home these strings cannot hold a grip that is not turned: their pulls have no balance. */
     .centre = MM(0, 40, -48),
     .workspace = MM(20, 20, 20),
     .workspace_turn = 30 / DEGREES,
     .residual = 1 / 1000.0,
     .heat_tension = HEAT_SHARE * 20.0,
     .heat_time = HEAT_TIME},
    {.name = "x3r",
     .strings = 8,
     .dof = 6,
     .board = HAPI_SPIDAR_USB,
     .motor = {MM(-84.853, -76, 0), MM(0, -76, 84.853), MM(84.853, -76, 0), MM(0, -76, -84.853),
               MM(-84.853, 76, 0), MM(0, 76, 84.853), MM(84.853, 76, 0), MM(0, 76, -84.853)},
     .grip = {MM(-15.910, 0, -15.910), MM(15.910, 0, 15.910), MM(0, -22.5, 0), MM(0, -22.5, 0),
              MM(-15.910, 0, -15.910), MM(15.910, 0, 15.910), MM(0, 22.5, 0), MM(0, 22.5, 0)},
     .volts_per_newton = SIGNED(0.3652968, +, +, +, +, +, +, +, +),
     .metres_per_count = SIGNED(1.66555e-5, +, +, -, -, -, -, +, +),
     .min_tension = 0.3,
     .max_tension = 20.0,
     .tension_rate = 4000.0,
     .torque_weight = 3000.0,
     .spread_weight = SPREAD,
     .workspace = MM(25, 25, 25),
     .workspace_turn = 45 / DEGREES,
     .residual = 1 / 1000.0,
     .heat_tension = HEAT_SHARE * 20.0,
     .heat_time = HEAT_TIME},
    {.name = "x3r4",
     .strings = 4,
     .dof = 3,
     .board = HAPI_SPIDAR_USB,
     .motor = {MM(-60, -70, -60), MM(60, -70, 60), MM(-60, 70, 60), MM(60, 70, -60)},
     .volts_per_newton = {0.3652968, 0.3652968, 0.3652968, 0.3652968},
     .metres_per_count = {1.66555e-5, -1.66555e-5, -1.66555e-5, 1.66555e-5},
     .min_tension = 0.3,
     .max_tension = 20.0,
     .tension_rate = 4000.0,
     .spread_weight = SPREAD,
     .workspace = MM(30, 35, 30),
     .residual = 1 / 1000.0,
     .heat_tension = HEAT_SHARE * 20.0,
     .heat_time = HEAT_TIME},
};

#define MODELS (sizeof models / sizeof models[0])

const hapi_spidar_model *hapi_spidar_model_find(const char *name)
{
  for (size_t i = 0; i < MODELS; ++i) {
    if (strcasecmp(models[i].name, name) == 0) {
      return &models[i];
    }
  }
  return NULL;
}

const hapi_spidar_model *hapi_spidar_model_at(size_t index)
{
  return index < MODELS ? &models[index] : NULL;
}

/* m, root of the mean squared distance of the grip's points from its origin. */
static double grip_radius(const hapi_spidar_model *model)
{
  double sum = 0.0;
  for (int i = 0; i < model->strings; ++i) {
    sum += hapi_v3_dot(model->grip[i], model->grip[i]);
  }
  return sqrt(sum / model->strings);
}

void hapi_spidar_model_default(hapi_spidar_model *model)
{
  double radius = grip_radius(model);
  model->tension_rate = 200.0 * model->max_tension;
  model->torque_weight = model->dof == 6 ? 1.5 / (radius * radius) : 0.0;
  model->spread_weight = SPREAD;
  model->workspace_turn = model->dof == 6 ? 30.0 / DEGREES : 0.0;
  model->residual = 1.0 / 1000.0;
  model->heat_tension =
      fmax(HEAT_SHARE * model->max_tension, 0.5 * (model->min_tension + model->max_tension));
  model->heat_time = HEAT_TIME;
  for (int axis = 0; axis < 3; ++axis) {
    double reach = 0.0;
    for (int i = 0; i < model->strings; ++i) {
      reach = fmax(reach, fabs(model->motor[i][axis]));
    }
    model->workspace[axis] = 0.3 * reach;
  }
}
