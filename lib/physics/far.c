/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/physics_internal.h"
#include "world/scene_print.h"

/* Bodies that are drawn in another session than that of the world. There the table has the bodies
 * of the session's own world, which is not stepped. */

uint32_t hapi_physics_places(hapi_physics *physics)
{
  return hapi_poses_places(&physics->drawing, &physics->world.bodies);
}

void hapi_physics_tell(hapi_physics *physics, uint32_t first, uint32_t count, hapi_told_body *out)
{
  hapi_poses_tell(&physics->drawing, &physics->world.bodies, first, count, out);
}

void hapi_physics_print_scene(hapi_physics *physics, hapi_scene_print *out)
{
  hapi_scene_print_read(&physics->world, out);
}

hap_status hapi_physics_begin_drawing(hapi_physics *physics, int64_t now_ns)
{
  const int64_t times_ns[2] = {now_ns, now_ns};
  hap_status status = hapi_physics_scan(physics, false);
  hapi_poses_reset(&physics->drawing);
  hapi_physics_draw(physics, NULL, 1.0 / physics->config.physics_hz, times_ns);
  return status;
}

void hapi_physics_see_drawn(hapi_physics *physics)
{
  hapi_physics_see(physics, false);
}

void hapi_physics_hear(hapi_physics *physics, uint64_t number, const hapi_told_body *bodies,
                       uint32_t count)
{
  hapi_poses_hear(&physics->drawing, &physics->world.bodies, number, bodies, count);
}

void hapi_physics_draw(hapi_physics *physics, hapi_model *model, double period_s,
                       const int64_t times_ns[2])
{
  const hapi_cycle cycle = {.model = HAP_MODEL_CONTACT, .physics_s = period_s};
  hapi_poses_publish_told(&physics->drawing, &physics->world.bodies, &cycle, model, times_ns);
}
