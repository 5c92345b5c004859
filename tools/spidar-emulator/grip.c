/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/spidar-emulator/grip.h"

#include <string.h>

#include "base/vec.h"

void grip_def_init(grip_def *def, const hapi_spidar_model *model)
{
  *def = (grip_def){.model = model,
                    .mass = 0.06,
                    .inertia = 2e-5,
                    .string_stiffness = 2e4,
                    .string_damping = 5.0,
                    .rotor_mass = 0.01,
                    .rotor_damping = 0.5};
}

void grip_init(grip *g, const grip_def *def)
{
  memset(g, 0, sizeof *g);
  g->def = *def;
  hapi_spidar_home(&g->pose);
  hapi_spidar_lengths(def->model, &g->pose, g->wound);
}

/* Tension from stretch; its rate is that of the grip against the rotor. */
static void pull_strings(grip *g)
{
  const grip_def *def = &g->def;
  hapi_spidar_rows rows;
  hapi_spidar_rows_at(def->model, &g->pose, &rows);
  memset(&g->wrench, 0, sizeof g->wrench);
  for (int i = 0; i < def->model->strings; ++i) {
    double stretch = rows.length[i] - g->wound[i];
    double shortening =
        hapi_v3_dot(rows.unit[i], g->twist.linear) + hapi_v3_dot(rows.moment[i], g->twist.angular);
    double tension =
        def->string_stiffness * stretch - def->string_damping * (shortening + g->wound_rate[i]);
    g->tension[i] = stretch > 0.0 && tension > 0.0 ? tension : 0.0;
    hapi_v3_madd(g->wrench.force, g->tension[i], rows.unit[i], g->wrench.force);
    hapi_v3_madd(g->wrench.torque, g->tension[i], rows.moment[i], g->wrench.torque);
  }
}

static void pose_turn(hap_pose *pose, const double rate[3], double length)
{
  double half = 0.5 * length;
  double step[4] = {1.0, half * rate[0], half * rate[1], half * rate[2]};
  hapi_quat_multiply(step, pose->quat_wxyz, pose->quat_wxyz);
  hapi_quat_normalize(pose->quat_wxyz);
}

void grip_step(grip *g, const double pull[HAPI_SPIDAR_STRINGS_MAX], const hap_wrench *other,
               double length)
{
  const grip_def *def = &g->def;
  pull_strings(g);
  for (int i = 0; i < def->model->strings; ++i) {
    double force = g->tension[i] - pull[i] - def->rotor_damping * g->wound_rate[i];
    g->wound_rate[i] += length / def->rotor_mass * force;
    g->wound[i] += length * g->wound_rate[i];
  }
  for (int k = 0; k < 3; ++k) {
    g->twist.linear[k] += length / def->mass * (g->wrench.force[k] + other->force[k]);
    if (def->model->dof == 6) {
      g->twist.angular[k] += length / def->inertia * (g->wrench.torque[k] + other->torque[k]);
    }
  }
  hapi_v3_madd(g->pose.position, length, g->twist.linear, g->pose.position);
  pose_turn(&g->pose, g->twist.angular, length);
}
