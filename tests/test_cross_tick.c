/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What the pure tick makes of cross accelerances. */

#include "tests/tick_world.h"

/* Body 0 is pushed by pointer 0 with 1 N, body 1 by pointer 1 with 3 N; each has an answer of
 * bodies 2 and 3. */
static void set_up_crosses(void)
{
  set_up();
  (void)add_pointer(0, -0.1, 0.0, 0.0);
  (void)add_pointer(1, -0.1, 0.0, 0.0);
  begin_model();
  for (uint32_t i = 0; i < 4; ++i) {
    add_body(i)->flags = i == 3 ? HAPI_BODY_RESTING | HAPI_BODY_FOLLOWS : HAPI_BODY_FOLLOWS;
  }
  for (uint32_t i = 0; i < 2; ++i) {
    set_free(add_contact(i, i, i), 1.0, 1.0);
    add_cross(2, 0.25 + i);
    add_cross(3, 2.0);
  }
}

static void press_both(void)
{
  f.pointers[0].device.pose.position[0] = -0.009;
  f.pointers[1].device.pose.position[0] = -0.007;
}

TEST(a_force_moves_the_other_bodies_by_their_blocks)
{
  set_up_crosses();
  model_adopt();
  ticks_run(1);
  CHECK((f.bodies[3].flags & HAPI_BODY_RESTING) != 0);
  press_both();
  ticks_run(1);
  check_v3(f.bodies[0].twist.linear, T, 0.0, 0.0, 1e-15);
  check_v3(f.bodies[1].twist.linear, 3.0 * T, 0.0, 0.0, 1e-15);
  check_v3(f.bodies[2].twist.linear, (0.25 + 3.0 * 1.25) * T, 0.0, 0.0, 1e-15);
  check_v3(f.bodies[3].twist.linear, 8.0 * T, 0.0, 0.0, 1e-15);
  CHECK((f.bodies[3].flags & HAPI_BODY_RESTING) == 0);
  for (int i = 2; i < 4; ++i) { /* the world passes it on by itself */
    check_v3(f.bodies[i].account.impulse, 0.0, 0.0, 0.0, 0.0);
    check_v3(f.bodies[i].account.angular_impulse, 0.0, 0.0, 0.0, 0.0);
  }
  check_v3(f.tick.touches.hand_impulse, 4.0 * T, 0.0, 0.0, 1e-15);
  f.pointers[0].device.pose.position[0] = f.pointers[1].device.pose.position[0] = -0.1;
  ticks_run(5); /* no force, no acceleration */
  check_v3(f.bodies[2].twist.linear, 4.0 * T, 0.0, 0.0, 1e-15);
}

TEST(a_body_that_only_answers_follows_the_world)
{
  set_up_crosses();
  model_adopt();
  ticks_run(1);
  press_both();
  ticks_run(10);
  begin_model();
  for (uint32_t i = 0; i < 4; ++i) {
    hapi_model_body *body = add_body(i);
    body->flags = i < 2 ? 0 : HAPI_BODY_FOLLOWS;
    body->twist.linear[1] = 5.0;
    body->residual[0] = i < 2 ? 0.0 : 7.0; /* is in the twist */
  }
  double pushed = f.bodies[0].twist.linear[0];
  model_adopt();
  check_v3(f.bodies[0].twist.linear, pushed, 0.0, 0.0, 0.0);
  check_v3(f.bodies[2].twist.linear, 0.0, 5.0, 0.0, 0.0);
  ticks_run(5);
  check_v3(f.bodies[2].twist.linear, 0.0, 5.0, 0.0, 0.0); /* this model has no blocks */
  check_v3(f.bodies[3].twist.linear, 0.0, 5.0, 0.0, 0.0);
}

TEST(blocks_go_with_their_contact_and_their_body)
{
  set_up_crosses();
  f.pointers[0].generation = 2; /* gone while the message was on its way */
  model_adopt();
  CHECK(f.tick.touches.crosses.count == 2 && f.tick.touches.count == 1);
  ticks_run(1);
  press_both();
  ticks_run(1);
  check_v3(f.bodies[0].twist.linear, 0.0, 0.0, 0.0, 0.0);
  check_v3(f.bodies[2].twist.linear, 3.0 * 1.25 * T, 0.0, 0.0, 1e-15);
  set_up_crosses();
  --f.model->body_count; /* body 3 could not be sent */
  model_adopt();
  CHECK(f.tick.touches.crosses.count == 2);
  ticks_run(1);
  press_both();
  ticks_run(1);
  CHECK(f.bodies[3].twist.linear[0] == 0.0);
  check_v3(f.bodies[2].twist.linear, 4.0 * T, 0.0, 0.0, 1e-15);
}
