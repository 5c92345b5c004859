/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Boards that lie in other ways than those of the emulator, and a hand in closed form that leads
 * the grip. Geometry, wire and hand are written here a second time, from docs/spidar.md: what the
 * hand feels is the sum of the currents that came over the wire along the true strings. */

#include "tests/tap.h"

#include <hapode/device_impl.h>

#include "base/safety.h"
#include "bench/seen.h"
#include "plugins/spidar/spidar.h"
#include "tests/ode_world.h"

#define STRINGS 8
#define PER_NEWTON (0.08 * 4096.0 / 3.3) /* of the current */
#define PER_COUNT 3.485e-5               /* m */
#define FACE 0.02                        /* m, x of the wall for the grip's centre */
#define STIFFNESS 1000.0
#define HZ 1000
#define BEGIN 1500 /* tick of the lie */
#define LENGTH 200 /* ticks */
#define TICKS 2200
#define FRAMES 64 /* that are on the way */
#define REPLY 17  /* bytes, of the command CURRENT */
#define REPLY_S 1.6e-4
#define COMMAND_CURRENT 6

#define MM(x, y, z)                    \
  {                                    \
    1e-3 * (x), 1e-3 * (y), 1e-3 * (z) \
  }

static const double motors[STRINGS][3] = {MM(69, -95, -69),  MM(69, -95, 69), MM(-69, -95, 69),
                                          MM(-69, -95, -69), MM(69, 95, -69), MM(69, 95, 69),
                                          MM(-69, 95, 69),   MM(-69, 95, -69)};
static const double grips[STRINGS][3] = {MM(0, -22.5, 0), MM(22.5, 0, 0), MM(-22.5, 0, 0),
                                         MM(0, -22.5, 0), MM(0, 22.5, 0), MM(22.5, 0, 0),
                                         MM(-22.5, 0, 0), MM(0, 22.5, 0)};
static const int count_sign[STRINGS] = {-1, -1, 1, 1, 1, 1, -1, -1};
static const int volt_sign[STRINGS] = {1, 1, -1, -1, -1, -1, 1, 1};
static const int lengths[12] = {1, 1,  13, 21, 1, 17,
                                9, 12, 12, 18, 3, 2}; /* of commands to a B3M */

typedef enum lie {
  LIE_NONE,
  LIE_BACKWARDS, /* one encoder counts the other way, and is off for ever */
  LIE_SWAPPED,   /* two strings change places */
  LIE_STRETCHED, /* a string counts 1.05 times what it should */
  LIE_ALL_STRETCHED,
  LIE_LOW_BIT, /* a bit of one string stays 1 */
  LIE_HIGH_BIT,
  LIE_TWICE,    /* every reply comes again 3.5 ms later */
  LIE_COLLIDES, /* and between those of the two boards */
  LIES
} lie;

typedef struct frame {
  double due; /* s */
  uint8_t bytes[REPLY];
} frame;

typedef struct boards {
  hapi_spidar_device device;
  double now;
  double begun; /* now at the first read */
  lie tells;
  double haste; /* of its way along the wall */
  double position[3];
  double home[STRINGS];
  int16_t current[STRINGS];
  frame frames[FRAMES];
  int on_way;
  int32_t turned[STRINGS]; /* counts at the begin of the lie */
  bool lying;
} boards;

/* ---- the hand ---- */

static double smooth_step(double x)
{
  x = fmax(fmin(x, 1.0), 0.0);
  return x * x * (3.0 - 2.0 * x);
}

/* Into the wall by 6 mm, and to and fro at up to 0.03 m/s into it and 0.1 m/s along it, or faster
 * along it. */
static void hand_go(boards *b, double time)
{
  double s = smooth_step((time - 0.5) / 0.6);
  b->position[0] = s * (0.026 + 1.5e-3 * sin(20.0 * time));
  b->position[1] = s * 0.008 * sin(12.0 * b->haste * time);
  b->position[2] = s * 0.005 * cos(9.0 * b->haste * time);
}

static double string_way(const boards *b, int i, double unit[3])
{
  double way[3];
  double length2 = 0.0;
  for (int k = 0; k < 3; ++k) {
    way[k] = motors[i][k] - grips[i][k] - b->position[k];
    length2 += way[k] * way[k];
  }
  for (int k = 0; k < 3; ++k) {
    unit[k] = way[k] / sqrt(length2);
  }
  return sqrt(length2);
}

/* N, of all strings on the grip. */
static void hand_feel(const boards *b, double out[3])
{
  memset(out, 0, 3 * sizeof *out);
  for (int i = 0; i < STRINGS; ++i) {
    double unit[3];
    (void)string_way(b, i, unit);
    for (int k = 0; k < 3; ++k) {
      out[k] += volt_sign[i] * b->current[i] / PER_NEWTON * unit[k];
    }
  }
}

/* ---- encoders and wire ---- */

static int32_t encoder_right(const boards *b, int i)
{
  double unit[3];
  return (int32_t)lround(count_sign[i] * (string_way(b, i, unit) - b->home[i]) / PER_COUNT);
}

static int32_t encoder_count(const boards *b, int i)
{
  int32_t right = encoder_right(b, i);
  switch (b->lying ? b->tells : LIE_NONE) {
    case LIE_BACKWARDS:
      return i == 3 ? 2 * b->turned[3] - right : right;
    case LIE_SWAPPED:
      return i == 1 ? encoder_right(b, 6) : i == 6 ? encoder_right(b, 1) : right;
    case LIE_STRETCHED:
      return i == 5 ? (int32_t)lround(1.05 * right) : right;
    case LIE_ALL_STRETCHED:
      return (int32_t)lround(1.05 * right);
    case LIE_LOW_BIT:
      return i == 2 ? right | 1 << 4 : right;
    case LIE_HIGH_BIT:
      return i == 2 ? right ^ 1 << 8 : right;
    default:
      return right;
  }
}

static void frame_put(boards *b, const frame *f)
{
  int at = b->on_way;
  REQUIRE(b->on_way < FRAMES);
  while (at > 0 && b->frames[at - 1].due > f->due) {
    b->frames[at] = b->frames[at - 1];
    --at;
  }
  b->frames[at] = *f;
  ++b->on_way;
}

static void board_reply(boards *b, int id, double due)
{
  frame f = {.due = due, .bytes = {(uint8_t)(COMMAND_CURRENT << 3 | id)}};
  for (int k = 0; k < 4; ++k) {
    uint16_t raw = (uint16_t)encoder_count(b, 4 * id + k);
    f.bytes[1 + 2 * k] = (uint8_t)raw;
    f.bytes[2 + 2 * k] = (uint8_t)(raw >> 8);
  }
  frame_put(b, &f);
  if (b->lying && (b->tells == LIE_TWICE || b->tells == LIE_COLLIDES)) {
    f.due += b->tells == LIE_TWICE ? 0.0035 : 0.003;
    frame_put(b, &f);
  }
}

static int wire_send(void *self, const uint8_t *bytes, int count)
{
  boards *b = self;
  double due = b->now;
  for (int at = 0; at < count;) {
    int command = bytes[at] >> 3;
    int id = bytes[at] & 7;
    if (bytes[at] == 0 || bytes[at] >= 0x60) {
      ++at;
      continue;
    }
    if (command == COMMAND_CURRENT && id < 2 && at + lengths[command] <= count) {
      board_reply(b, id, due += REPLY_S); /* of before the command */
      for (int k = 0; k < 4; ++k) {
        uint16_t low = bytes[at + 1 + 2 * k];
        b->current[4 * id + k] = (int16_t)(low | (uint16_t)(bytes[at + 2 + 2 * k] << 8));
      }
    }
    at += lengths[command];
  }
  return 0;
}

static int wire_receive(void *self, uint8_t *bytes, int size)
{
  boards *b = self;
  int used = 0;
  int done = 0;
  while (done < b->on_way && b->frames[done].due <= b->now && used + REPLY <= size) {
    memcpy(bytes + used, b->frames[done++].bytes, REPLY);
    used += REPLY;
  }
  b->on_way -= done;
  memmove(b->frames, b->frames + done, (size_t)b->on_way * sizeof b->frames[0]);
  return used;
}

static void wire_await(void *self, double seconds)
{
  boards *b = self;
  double due = b->on_way > 0 ? fmax(b->frames[0].due, b->now) : b->now + seconds;
  b->now = fmin(due, b->now + seconds);
}

static double wire_now(void *self)
{
  return ((const boards *)self)->now;
}

static void wire_flush(void *self)
{
  ((boards *)self)->on_way = 0;
}

/* ---- the device ---- */

static hap_status lies_open(void *context, const char *args, void **self, hap_detail *detail)
{
  boards *b = context;
  (void)args;
  (void)detail;
  for (int i = 0; i < STRINGS; ++i) {
    double unit[3];
    b->home[i] = string_way(b, i, unit);
  }
  REQUIRE(hapi_spidar_guard_init(&b->device.guard));
  b->device.serial.fd = -1;
  b->device.boards = (hapi_spidar_boards){.count = 2, .id = {0, 1}, .model = {5, 5}};
  b->device.model = *hapi_spidar_model_find("x4r");
  b->device.settings = (hapi_spidar_settings){.timeout = 0.02, .rotate = {1.0, 0.0, 0.0, 0.0}};
  hapi_spidar_capability(&b->device.model, &b->device.settings.max_force,
                         &b->device.settings.max_torque);
  hapi_spidar_heat_init(&b->device.heat, 0.0);
  atomic_init(&b->device.zeroed, true);
  *self = b;
  return HAP_OK;
}

static void lies_describe(void *self, uint32_t effector, hap_device_info *out)
{
  hapi_spidar_ops.describe(&((boards *)self)->device, effector, out);
}

static hap_status lies_start(void *self)
{
  boards *b = self;
  const hapi_spidar_port port = {b, wire_send, wire_receive, wire_await, wire_now, wire_flush};
  b->begun = -1.0;
  return hapi_spidar_begin(&b->device, &port) == HAPI_SPIDAR_WELL ? HAP_OK : HAP_ERROR_DEVICE;
}

static hap_status lies_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  boards *b = self;
  double time = 1e-9 * (double)time_ns;
  b->begun = b->begun < 0.0 ? b->now - time : b->begun;
  b->now = b->begun + time;
  hap_status status = hapi_spidar_ops.read(&b->device, time_ns, out);
  bool lying = time * HZ >= BEGIN - 0.5 && time * HZ < BEGIN + LENGTH - 0.5;
  hand_go(b, time);
  for (int i = 0; i < STRINGS && lying && !b->lying; ++i) {
    b->turned[i] = encoder_right(b, i);
  }
  b->lying = lying || (b->lying && b->tells == LIE_BACKWARDS && time * HZ < BEGIN + 100);
  return status;
}

static hap_status lies_write(void *self, const hap_device_output *const wanted[],
                             hap_device_output *const reached[])
{
  return hapi_spidar_ops.write(&((boards *)self)->device, wanted, reached);
}

static void lies_zero(void *self)
{
  boards *b = self;
  hapi_spidar_ops.zero(&b->device);
  memset(b->current, 0, sizeof b->current); /* the port of the tests has no descriptor */
}

static void lies_stop(void *self)
{
  lies_zero(self);
  ((boards *)self)->device.running = false;
}

static void lies_close(void *self)
{
  hapi_spidar_guard_finish(&((boards *)self)->device.guard);
}

static const hap_device_ops lies_ops = {.abi = HAP_DEVICE_ABI,
                                        .size = sizeof(hap_device_ops),
                                        .name = "lies",
                                        .help = "boards that lie",
                                        .pacing = HAP_PACING_VIRTUAL,
                                        .open = lies_open,
                                        .describe = lies_describe,
                                        .start = lies_start,
                                        .read = lies_read,
                                        .write = lies_write,
                                        .zero = lies_zero,
                                        .stop = lies_stop,
                                        .close = lies_close};

/* ---- sessions ---- */

typedef struct run {
  double felt[TICKS][3]; /* N */
  double place[TICKS];   /* m, x of the hand */
  double told_s;         /* since the lie began; < 0: never */
  double seen_s;         /* since then, when the lengths fit no pose */
  int32_t behind;        /* counts, the most by which a string turns in 3 ms */
  uint32_t fault;
} run;

static run right;
static run lied;

/* m, by which the lengths that are told fit no pose. */
static double boards_misfit(const boards *b)
{
  hap_pose pose = {{b->position[0], b->position[1], b->position[2]}, {1.0, 0.0, 0.0, 0.0}};
  double error[STRINGS];
  for (int i = 0; i < STRINGS; ++i) {
    error[i] = count_sign[i] * PER_COUNT * (encoder_count(b, i) - encoder_right(b, i));
  }
  return seen_misfit(motors, grips, &pose, error);
}

/* Counts, the most by which a string turned since the tick three before. */
static int32_t boards_behind(const boards *b, int tick)
{
  static int32_t told[4][STRINGS];
  int32_t most = 0;
  for (int i = 0; i < STRINGS; ++i) {
    int32_t way = encoder_right(b, i) - told[(tick + 1) % 4][i];
    told[tick % 4][i] = encoder_right(b, i);
    most = abs(way) > most ? abs(way) : most;
  }
  return most;
}

static void run_make(lie tells, double haste, run *out)
{
  static boards b;
  dWorldID world;
  dSpaceID space;
  hap_session *session = NULL;
  hap_device *device = NULL;
  hap_pointer_id pointer;
  hap_session_def def;
  hap_ode_def ode;
  hap_pointer_def p;
  memset(&b, 0, sizeof b);
  b.tells = tells;
  b.haste = haste;
  out->told_s = out->seen_s = -1.0;
  out->fault = 0;
  out->behind = 0;
  ode_world_make(0.0, &world, &space);
  dGeomSetPosition(dCreateBox(space, 0.1, 1.0, 1.0), FACE + 0.01 + 0.05, 0.0, 0.0);
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = world;
  ode.space = space;
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.physics_hz = 50;
  def.haptic_hz = HZ;
  REQUIRE(hap_session_create(&def, &ode, &session, NULL) >= HAP_OK);
  REQUIRE(hap_device_create(&lies_ops, &b, &device, NULL) >= HAP_OK);
  hap_pointer_def_init(&p, sizeof p);
  p.device = device;
  p.radius = 0.01;
  p.stiffness = STIFFNESS;
  p.damping = 1.0;
  p.friction = 0.0;
  p.max_force = 20.0;
  REQUIRE(hap_pointer_add(session, &p, &pointer) >= HAP_OK);
  REQUIRE(hap_session_start(session) >= HAP_OK);
  for (int i = 0; i < TICKS; ++i) {
    hap_pointer_state state;
    hap_stats stats;
    REQUIRE(hap_session_advance(session, 1) >= HAP_OK);
    REQUIRE(hap_pointer_get(session, pointer, &state, sizeof state) >= HAP_OK);
    REQUIRE(hap_session_stats(session, &stats, sizeof stats) >= HAP_OK);
    hand_feel(&b, out->felt[i]);
    out->place[i] = b.position[0];
    out->fault = stats.faults.fault;
    int32_t behind = boards_behind(&b, i);
    out->behind = i >= BEGIN && behind > out->behind ? behind : out->behind;
    if (i >= BEGIN && out->seen_s < 0.0 && boards_misfit(&b) > b.device.model.residual) {
      out->seen_s = (double)(i - BEGIN) / HZ;
    }
    if (i >= BEGIN && out->told_s < 0.0 &&
        (state.guard & (HAP_GUARD_INPUT | HAP_GUARD_FAULT)) != 0) {
      out->told_s = (double)(i - BEGIN) / HZ;
    }
  }
  ode_world_end(session, world, space);
  hap_device_close(device);
}

static double norm_of(const double v[3])
{
  return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static void run_extremes(const run *r, double *out_peak, double *out_step)
{
  *out_peak = *out_step = 0.0;
  for (int i = BEGIN; i < TICKS; ++i) {
    double change[3];
    for (int k = 0; k < 3; ++k) {
      change[k] = r->felt[i][k] - r->felt[i - 2][k];
    }
    *out_peak = fmax(*out_peak, norm_of(r->felt[i]));
    *out_step = fmax(*out_step, norm_of(change));
  }
}

/* The spring of the wall, over the wire. */
TEST(the_hand_feels_the_wall)
{
  run_make(LIE_NONE, 1.0, &right);
  double worst = 0.0;
  for (int i = BEGIN; i < TICKS; ++i) {
    double wanted = STIFFNESS * (right.place[i - 1] - FACE);
    worst = fmax(worst, fabs(right.felt[i][0] + wanted));
  }
  CHECK_SAY(worst < 0.4, "%g N", worst); /* the box of the tensions gives 0.97 of a force */
  CHECK(right.fault == 0 && right.told_s < 0.0);
}

/* How often replies that come twice were told. */
static int lies_try(double haste)
{
  int told_twice = 0;
  static const char *const names[LIES] = {
      "none",    "backwards", "swapped", "stretched", "all of them stretched",
      "low bit", "high bit",  "twice",   "collides"};
  double peak_right;
  double step_right;
  run_make(LIE_NONE, haste, &right);
  run_extremes(&right, &peak_right, &step_right);
  for (lie l = LIE_BACKWARDS; l < LIES; ++l) {
    double peak;
    double step;
    run_make(l, haste, &lied);
    run_extremes(&lied, &peak, &step);
    printf(
        "# %s: %.2f N (%.2f), in 2 ms %.2f N (%.2f), to be seen after %.0f ms, told after %.0f "
        "ms, fault %u\n",
        names[l], peak, peak_right, step, step_right, 1e3 * lied.seen_s, 1e3 * lied.told_s,
        lied.fault);
    CHECK(peak <= 1.1 * peak_right);
    if (lied.fault == HAP_FAULT_DEVICE_READ) { /* at once; the least tensions stay */
      CHECK(l == LIE_COLLIDES && norm_of(lied.felt[TICKS - 1]) < 0.2);
    } else {
      CHECK(step <= 2.0 + step_right);
    }
    if (l == LIE_SWAPPED || l == LIE_HIGH_BIT) {
      CHECK(lied.told_s <= 0.02 && lied.fault == HAP_FAULT_DEVICE_INPUT);
    }
    if (l == LIE_TWICE) { /* an old reply that is hardly behind is no harm, and cannot be told */
      printf("# at most %d counts behind\n", lied.behind);
      CHECK(lied.fault == HAP_FAULT_NONE);
      CHECK(lied.told_s >= 0.0 || lied.behind < 2.0 * HAPI_SAFETY_STALE_QUANTA);
      told_twice += lied.told_s >= 0.0;
    }
    CHECK(lied.seen_s < 0.0 || (lied.told_s >= 0.0 && lied.told_s <= lied.seen_s + 0.02));
  }
  return told_twice;
}

TEST(boards_that_lie_make_no_force)
{
  (void)lies_try(1.0);
  CHECK(lies_try(3.0) == 1);
}
