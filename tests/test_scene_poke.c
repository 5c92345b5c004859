/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes from files under a hand that goes after one body after the other, wherever it is, and
 * pokes through it: nothing flies away, and nothing faults. In lockstep, and in real time beside
 * whatever the machine does. */

#include "tests/tap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <hapode/hapode.h>

#include "base/clock.h"
#include "import/import.h"
#include "tests/fake_device.h"
#include "tests/program.h"

SET_UP
{
  return program_use("HAPODE_RUN");
}

#define HAND_SPEED 1.5     /* m/s, at most: a body that topples must not be lost */
#define HAND_RATE 10.0     /* 1/s: speed by distance */
#define HAND_STRENGTH 50.0 /* m/s^2 */
#define RADIUS 0.02
#define LOOK_MS 10
#define VISIT_MS 500
#define FASTEST 10.0 /* m/s: a fall from 2 m is 6 */
#define BODIES_MOST 64

/* A crawler of three hinges at each hip and springs, which lies on the floor. */
static const char crawler[] =
    "<mujoco><default><joint stiffness='2' damping='.2' armature='.005' range='-60 60'/></default>"
    "<worldbody><geom type='plane' size='2 2 .1'/>"
    "<body pos='0 0 .2'><freejoint/><geom type='box' size='.15 .08 .04'/>"
    "<replicate count='4' euler='0 0 90'>"
    "<body pos='.15 .05 0'><joint axis='1 0 0'/><joint axis='0 1 0'/><joint axis='0 0 1'/>"
    "<geom type='capsule' size='.02' fromto='0 0 0 .15 .03 -.05'/>"
    "<body pos='.15 .03 -.05'><joint axis='0 1 0'/>"
    "<geom type='capsule' size='.015' fromto='0 0 0 .05 0 -.12'/>"
    "<body pos='.05 0 -.12'><joint axis='1 0 0'/><joint axis='0 1 0'/>"
    "<geom type='box' size='.03 .02 .01'/></body></body></body></replicate></body>"
    "</worldbody></mujoco>";

static struct {
  atomic_int target_um[3];
  double at[3];
  double velocity[3];
  int64_t time_ns;
} hand;

/* [haptic] To the target, as fast as an arm. */
static hap_status hand_move(fake_device *d, int64_t time_ns, hap_pose *io, uint32_t *buttons)
{
  double way[3];
  double change[3];
  const double passed = 1e-9 * (double)(time_ns - hand.time_ns);
  for (int k = 0; k < 3; ++k) {
    way[k] = 1e-6 * atomic_load(&hand.target_um[k]) - hand.at[k];
  }
  const double speed = fmin(HAND_RATE * hapi_v3_norm(way), HAND_SPEED);
  const double wanted = speed / fmax(hapi_v3_norm(way), 1e-9);
  for (int k = 0; k < 3; ++k) {
    change[k] = wanted * way[k] - hand.velocity[k];
  }
  const double most = HAND_STRENGTH * passed / fmax(hapi_v3_norm(change), 1e-9);
  hapi_v3_madd(hand.velocity, fmin(most, 1.0), change, hand.velocity);
  hapi_v3_madd(hand.at, hand.time_ns == 0 ? 0.0 : passed, hand.velocity, hand.at);
  hand.time_ns = time_ns;
  hapi_v3_copy(hand.at, io->position);
  *buttons = 0;
  (void)d;
  return HAP_OK;
}

static void hand_send(const double at[3])
{
  for (int k = 0; k < 3; ++k) {
    atomic_store(&hand.target_um[k], (int)(1e6 * at[k]));
  }
}

typedef struct poked {
  hap_scene *scene;
  hap_session *session;
  hap_device *device;
  uint32_t bodies;
  hap_pose before[BODIES_MOST];
  int64_t before_ns;
  double fastest; /* m/s */
  double lowest;  /* m */
  double highest;
} poked;

/* sweeps: the most of a solve; 0: until it is solved. */
static void poke_begin(poked *p, const char *path, hap_drive drive, int32_t sweeps)
{
  hap_session_def def;
  hap_expert_def expert;
  hap_pointer_def pointer;
  hap_pointer_id id;
  hap_scene_counts counts;
  hap_detail why = {""};
  memset(p, 0, sizeof *p);
  REQUIRE_SAY(import_scene(path, NULL, &p->scene, NULL, &why) == HAP_OK, "%s", why.text);
  CHECK(hap_scene_count(p->scene, &counts, sizeof counts) == HAP_OK);
  REQUIRE(counts.bodies > 0 && counts.bodies <= BODIES_MOST);
  p->bodies = counts.bodies;
  hap_session_def_init(&def, sizeof def);
  def.drive = drive;
  hap_expert_def_init(&expert, sizeof expert);
  expert.max_sweeps = sweeps;
  def.expert = &expert;
  REQUIRE_SAY(hap_scene_session(p->scene, &def, &p->session, &why) == HAP_OK, "%s", why.text);
  fakes_opened = 0;
  fake_next()->move = hand_move;
  memset(&hand, 0, sizeof hand);
  hapi_v3_set(hand.at, -0.5, 0.0, 0.3);
  hand_send(hand.at);
  p->device = fake_device_open(drive == HAP_DRIVE_LOCKSTEP ? HAP_PACING_VIRTUAL : HAP_PACING_HOST);
  hap_pointer_def_init(&pointer, sizeof pointer);
  pointer.device = p->device;
  pointer.radius = RADIUS;
  REQUIRE(hap_pointer_add(p->session, &pointer, &id) == HAP_OK);
  REQUIRE(hap_session_start(p->session) >= HAP_OK);
}

static void poke_look(poked *p, bool first)
{
  hap_pose now[BODIES_MOST];
  const int64_t now_ns = hap_session_now(p->session);
  const double passed = 1e-9 * (double)(now_ns - p->before_ns);
  REQUIRE(hap_scene_poses(p->scene, now_ns, 0, p->bodies, now) >= HAP_OK);
  for (uint32_t i = 0; i < p->bodies; ++i) {
    double way[3];
    hapi_v3_sub(p->before[i].position, now[i].position, way);
    p->fastest = first ? 0.0 : fmax(p->fastest, hapi_v3_norm(way) / passed);
    p->lowest = fmin(p->lowest, now[i].position[2]);
    p->highest = fmax(p->highest, now[i].position[2]);
  }
  memcpy(p->before, now, sizeof now);
  p->before_ns = now_ns;
}

/* Through the body to its other side, from where the hand is, and to the floor; after it, where
 * it falls. */
static void poke_aim(const poked *p, int visit)
{
  const double *at = p->before[(uint32_t)visit * 7u % p->bodies].position;
  const double angle = 2.4 * visit;
  hand_send((const double[3]){at[0] + 0.1 * cos(angle), at[1] + 0.1 * sin(angle),
                              fmax(RADIUS, at[2] + 0.05 * sin(1.7 * visit))});
}

/* A machine that stops the loop is late, which is no fault of the scene. The hand goes on, as an
 * application would let it. */
static void poke_go_on(const poked *p)
{
  hap_stats stats;
  REQUIRE(hap_session_stats(p->session, &stats, sizeof stats) >= HAP_OK);
  if (stats.faults.fault == HAP_FAULT_LATE) {
    CHECK(hap_session_reset_fault(p->session) == HAP_OK);
  }
}

static void poke_with(const char *path, int seconds, hap_drive drive, int32_t sweeps)
{
  poked p;
  hap_stats stats;
  poke_begin(&p, path, drive, sweeps);
  for (int ms = 0; ms < 1000 * seconds; ms += LOOK_MS) {
    if (drive == HAP_DRIVE_LOCKSTEP) {
      REQUIRE(hap_session_advance(p.session, LOOK_MS) == HAP_OK);
    } else {
      hapi_clock_sleep_until(hapi_clock_now() + LOOK_MS * INT64_C(1000000));
      poke_go_on(&p);
    }
    poke_look(&p, ms == 0);
    poke_aim(&p, ms / VISIT_MS);
  }
  REQUIRE(hap_session_stats(p.session, &stats, sizeof stats) >= HAP_OK);
  printf(
      "# %d s, %s: %llu ticks, %llu touch, %llu unsolved, %llu missed, %llu faults, %.2f m/s, "
      "z %.3f to %.3f\n",
      seconds, drive == HAP_DRIVE_LOCKSTEP ? "lockstep" : "threads",
      (unsigned long long)stats.loop.ticks, (unsigned long long)stats.loop.contact_ticks,
      (unsigned long long)stats.room.unsolved_ticks, (unsigned long long)stats.loop.missed_ticks,
      (unsigned long long)stats.faults.count, p.fastest, p.lowest, p.highest);
  CHECK_SAY(stats.faults.fault == HAP_FAULT_NONE ||
                (drive == HAP_DRIVE_THREADS && stats.faults.fault == HAP_FAULT_LATE),
            "%s", hap_fault_text((hap_fault)stats.faults.fault));
  CHECK(stats.loop.contact_ticks > stats.loop.ticks / 20);
  CHECK(p.fastest < FASTEST);
  CHECK(p.lowest > -0.1 && p.highest < 2.5);
  if (drive == HAP_DRIVE_LOCKSTEP) {
    bool is_solved = stats.room.unsolved_ticks <= stats.loop.ticks / 500;
    CHECK(is_solved == (sweeps == 0)); /* few sweeps must leave something, or nothing is tested */
  }
  hap_session_destroy(p.session);
  hap_device_close(p.device);
  CHECK(hap_scene_destroy(p.scene) == HAP_OK);
}

static void poke_for(const char *path, int seconds, hap_drive drive)
{
  poke_with(path, seconds, drive, 0);
}

static int seconds_of(void)
{
  return strcmp(tap_argument, "long") == 0 ? 60 : 3;
}

static const char *shared_file(const char *name)
{
  static char path[500];
  const char *folder = getenv("HAPODE_SHARED");
  snprintf(path, sizeof path, "%s/scenes/%s", folder != NULL ? folder : "", name);
  if (folder == NULL || !file_exists(path)) {
    SKIP("no %s of MuJoCo in the folder scenes of HAPODE_SHARED", name);
  }
  return path;
}

TEST(a_crawler_is_poked)
{
  const char *path = folder_path("crawler.xml");
  file_write(path, crawler);
  poke_for(path, seconds_of(), HAP_DRIVE_LOCKSTEP);
}

/* As where a tick has no time for more: what is left undone must not make it go faster. */
TEST(a_crawler_of_unsolved_joints_is_poked)
{
  const char *path = folder_path("crawler.xml");
  file_write(path, crawler);
  for (int32_t sweeps = 2; sweeps <= 3; ++sweeps) { /* of four, all are solved */
    poke_with(path, 3, HAP_DRIVE_LOCKSTEP, sweeps);
  }
}

TEST(a_crawler_is_poked_in_real_time)
{
  const char *path = folder_path("crawler.xml");
  file_write(path, crawler);
  poke_for(path, seconds_of(), HAP_DRIVE_THREADS);
}

TEST(a_humanoid_is_poked)
{
  poke_for(shared_file("humanoid.xml"), seconds_of(), HAP_DRIVE_LOCKSTEP);
}

TEST(a_humanoid_is_poked_in_real_time)
{
  poke_for(shared_file("humanoid.xml"), seconds_of(), HAP_DRIVE_THREADS);
}

TEST(a_car_is_poked)
{
  poke_for(shared_file("car.xml"), seconds_of(), HAP_DRIVE_LOCKSTEP);
}

TEST(a_car_is_poked_in_real_time)
{
  poke_for(shared_file("car.xml"), seconds_of(), HAP_DRIVE_THREADS);
}
