/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Identification of devices whose mechanism is known, its limits, and the file of an identity. */

#include "tests/files.h"
#include "tests/tap.h"

#include <locale.h>
#include <stdint.h>
#include <unistd.h>

#include <hapode/device_impl.h>
#include <hapode/hapode.h>

#include "base/vec.h"
#include "device/identify.h"
#include "tests/fake_device.h"

static hap_status device_identify(hap_device *device, hap_device_identity *out, hap_detail *detail)
{
  hap_identify_def def;
  hap_identify_def_init(&def, sizeof def);
  hap_device_identity_init(out, sizeof *out);
  return hap_device_identify(device, &def, out, detail);
}

static hap_status identify_spec(const char *spec, hap_device_identity *out, hap_detail *detail)
{
  hap_status status;
  bool late;
  int left = 50;
  do { /* a busy machine may stop this thread for as long as the watchdog waits */
    hap_device *device = NULL;
    detail->text[0] = '\0';
    status = hap_device_open(spec, &device, detail);
    status = status < HAP_OK ? status : device_identify(device, out, detail);
    hap_device_close(device);
    late = status < HAP_OK && strstr(detail->text, "did not come back from a call") != NULL;
  } while (late && --left > 0);
  return status;
}

/* ---- known devices ---- */

typedef struct mechanism {
  double mass;
  double damping;
  double friction;
  double delay;
  double quantum;
} mechanism;

/* Largest errors seen. */
static mechanism worst;

static void check_one(const mechanism *m)
{
  char spec[200];
  hap_device_identity found;
  hap_detail detail = {""};
  snprintf(spec, sizeof spec,
           "virtual:hand=none,device_mass=%.17g,device_damping=%.17g,friction=%.17g,delay=%.17g,"
           "quantum=%.17g",
           m->mass, m->damping, m->friction, m->delay, m->quantum);
  hap_status status = identify_spec(spec, &found, &detail);
  int before = tap_failures;
  CHECK(status == HAP_OK);
  CHECK_NEAR(found.mass, m->mass, 0.03 * m->mass);
  CHECK_NEAR(found.damping, m->damping, fmax(0.1 * m->damping, 0.05));
  CHECK_NEAR(found.friction, m->friction, 0.05);
  CHECK_NEAR(found.delay, m->delay, 0.2e-3);
  CHECK_NEAR(found.quantum, m->quantum, 1e-9 * m->quantum);
  CHECK(found.residual < 0.02 && strcmp(found.device, "virtual") == 0);
  if (tap_failures != before) {
    printf("# %s: %s\n", spec, detail.text);
  }
  worst.mass = fmax(worst.mass, fabs(found.mass - m->mass) / m->mass);
  worst.damping = fmax(worst.damping, fabs(found.damping - m->damping));
  worst.friction = fmax(worst.friction, fabs(found.friction - m->friction));
  worst.delay = fmax(worst.delay, fabs(found.delay - m->delay));
}

TEST(known_mechanisms_are_found)
{
  static const double masses[] = {0.1, 0.3, 1.0};
  static const double dampings[] = {0.2, 1.0, 5.0};
  static const double frictions[] = {0.0, 0.1, 0.5};
  static const double delays[] = {0.0, 0.0005, 0.00137, 0.002};
  memset(&worst, 0, sizeof worst);
  for (int k = 0; k < 3 * 3 * 3 * 4; k += 3) { /* one mass for each of the others */
    mechanism m = {masses[(k / 3 + k / 9 + k / 27) % 3], dampings[k / 3 % 3], frictions[k / 9 % 3],
                   delays[k / 27], k / 3 % 2 == 0 ? 3e-5 : 0.0};
    check_one(&m);
  }
  printf("# worst: mass %.2f %%, damping %.3f N s/m, friction %.4f N, delay %.3f ms\n",
         100.0 * worst.mass, worst.damping, worst.friction, 1e3 * worst.delay);
}

TEST(unusual_mechanisms_are_found)
{
  static const mechanism unusual[] = {{0.02, 0.0, 0.0, 0.0, 0.0},
                                      {3.0, 20.0, 2.0, 0.001, 1e-5},
                                      {0.3, 0.5, 0.0, 0.02, 0.0},
                                      {0.25, 1.0, 0.1, 0.0005, 1e-6}};
  for (size_t i = 0; i < sizeof unusual / sizeof unusual[0]; ++i) {
    check_one(&unusual[i]);
  }
}

TEST(held_devices_are_not_identified)
{
  static const char *const specs[][2] = {
      {"virtual", "does not move"},
      {"virtual:hand=none,device_mass=0.3,friction=7", "does not move under 6 N"},
      {"virtual:hand=relaxed,device_mass=0.2,device_damping=1", "a spring of 150 N/m"},
      {"virtual:hand=relaxed,device_mass=2,device_damping=5,friction=0.3", "a spring of 1"},
      {"virtual:hand=tense,device_mass=0.2,quantum=3e-5", "does a hand hold it"}};
  for (size_t i = 0; i < sizeof specs / sizeof specs[0]; ++i) {
    hap_device_identity found;
    hap_detail detail = {""};
    CHECK(identify_spec(specs[i][0], &found, &detail) == HAP_ERROR_DEVICE);
    CHECK(strstr(detail.text, specs[i][1]) != NULL);
    CHECK(found.mass == 0.0 && found.device[0] == '\0');
    printf("# %s\n", detail.text);
  }
}

/* ---- a device of this test ---- */

typedef struct fake {
  double gain;   /* of the force: -1 pushes the wrong way */
  double growth; /* 1/s: it gets faster by itself */
  double bias;   /* N */
  double friction;
  double turned; /* rad: of the encoders' axes about z */
  double wavers; /* by which the gain is more and less, in turn for 30 ms each */
  int stalls;    /* so many reads apart are those that take 8 ms; 0: none */
  double quantum;
  int bad_read; /* the one that fails or is not finite; 0: none */
  bool fails;
  uint32_t pacing;

  int64_t time_ns;
  double x[3];
  double v[3];
  double force[3];
  double peak;            /* N, largest force that was asked for */
  double peak_after_zero; /* N, since the first zero */
  double farthest;        /* m */
} fake;

static fake the;

static bool is_pushing(void)
{
  return atomic_load(&fakes[0].pushing) != 0;
}

static void motion_step(fake *f, double h)
{
  for (int i = 0; i < 3; ++i) {
    double gain = f->gain + (f->time_ns / 30000000 % 2 == 0 ? f->wavers : -f->wavers);
    double push = gain * f->force[i] + (i == 0 ? f->bias : 0.0) - 0.4 * f->v[i];
    f->v[i] += h * (push / 0.2 + f->growth * f->v[i]);
    double brake = fmin(h * f->friction / 0.2, fabs(f->v[i]));
    f->v[i] -= copysign(brake, f->v[i]);
    f->x[i] += h * f->v[i];
  }
  f->farthest = fmax(f->farthest, hapi_v3_norm(f->x));
}

static hap_status motion_read(fake_device *d, int64_t time_ns, hap_pose *pose, uint32_t *buttons)
{
  fake *f = &the;
  int reads = atomic_load(&d->reads);
  *buttons = 0;
  if (f->stalls > 0 && reads % f->stalls == 0) {
    nanosleep(&(struct timespec){.tv_nsec = 8000000}, NULL);
  }
  if (!is_pushing()) {
    hapi_v3_set(f->force, 0.0, 0.0, 0.0);
  }
  for (; reads > 1 && f->time_ns < time_ns; f->time_ns += 20000) {
    motion_step(f, 2e-5);
  }
  f->time_ns = time_ns;
  hapi_v3_copy(f->x, pose->position);
  if (f->quantum > 0.0) {
    double c = cos(f->turned);
    double s = sin(f->turned);
    double a = f->quantum * round((c * f->x[0] + s * f->x[1]) / f->quantum);
    double b = f->quantum * round((c * f->x[1] - s * f->x[0]) / f->quantum);
    hapi_v3_set(pose->position, c * a - s * b, s * a + c * b,
                0.5 * f->quantum * round(2.0 * f->x[2] / f->quantum));
  }
  if (reads == f->bad_read) {
    pose->position[1] = (double)NAN;
    return f->fails ? HAP_ERROR_IO : HAP_OK;
  }
  return HAP_OK;
}

static void motion_push(fake_device *d, const hap_wrench *wanted, hap_wrench *reached)
{
  fake *f = &the;
  (void)reached;
  hapi_v3_copy(wanted->force, f->force);
  f->peak = fmax(f->peak, hapi_v3_norm(f->force));
  f->peak_after_zero =
      atomic_load(&d->zeros) > 0 ? fmax(f->peak_after_zero, hapi_v3_norm(f->force)) : 0.0;
}

static hap_device *open_fake(const fake *as)
{
  the = *as;
  fakes_opened = 0;
  fake_device *d = fake_next();
  d->info.max_force = 10.0;
  d->move = motion_read;
  d->push = motion_push;
  return fake_device_open((hap_device_pacing)as->pacing);
}

static hap_status identify_fake(const fake *as, hap_device_identity *out, hap_detail *detail)
{
  hap_device *device = open_fake(as);
  detail->text[0] = '\0';
  hap_status status = device_identify(device, out, detail);
  CHECK(fakes[0].stops == 1 && fakes[0].zeros >= 1 && !is_pushing());
  CHECK(hapi_device_claim(device)); /* it was let go */
  hapi_device_release(device);
  hap_device_close(device);
  return status;
}

TEST(force_keeps_its_limit)
{
  hap_device_identity found;
  hap_detail detail;
  fake heavy = {.gain = 0.05}; /* as of 4 kg */
  CHECK(identify_fake(&heavy, &found, &detail) == HAP_OK);
  CHECK(the.peak <= 3.0 && the.peak > 2.7); /* 30 % of 10 N */
  CHECK(the.farthest < 0.05);
  CHECK_NEAR(found.mass, 4.0, 0.12);
  CHECK_NEAR(found.damping, 8.0, 0.8);
}

TEST(constant_force_does_not_matter)
{
  hap_device_identity found;
  hap_detail detail;
  fake pulled = {.gain = 1.0, .bias = 0.05, .friction = 0.1};
  CHECK(identify_fake(&pulled, &found, &detail) == HAP_OK);
  CHECK_NEAR(found.mass, 0.2, 0.002);
  CHECK_NEAR(found.damping, 0.4, 0.02);
  CHECK_NEAR(found.friction, 0.1, 0.005);
}

TEST(runaways_are_stopped)
{
  static const struct {
    fake device;
    const char *text;
  } cases[] = {{{.gain = -1.0}, "more than"},
               {{.gain = 1.0, .growth = 30.0}, "more than"},
               {{.gain = 1.0, .bias = 5.0}, "more than"},
               {{.gain = 1.0, .bias = -0.02, .growth = 1.9}, "more than 50 mm"}};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    hap_device_identity found;
    hap_detail detail;
    CHECK(identify_fake(&cases[i].device, &found, &detail) == HAP_ERROR_DEVICE);
    CHECK(strstr(detail.text, cases[i].text) != NULL);
    CHECK(the.farthest < 0.056 && the.peak <= 3.0);
    printf("# %s\n", detail.text);
  }
  hap_device_identity found;
  hap_detail detail;
  CHECK(identify_spec("virtual:hand=none,device_mass=0.3,kick=2:0.6/0/0", &found, &detail) ==
        HAP_ERROR_DEVICE);
  CHECK(strstr(detail.text, "0.50 m/s") != NULL);
}

/* What the fit cannot explain is the device's fault, or that of ticks that came late. */
TEST(late_ticks_are_told_with_the_fault)
{
  hap_device_identity found;
  hap_detail detail;
  fake odd = {.gain = 1.0, .wavers = 0.8};
  CHECK(identify_fake(&odd, &found, &detail) == HAP_ERROR_DEVICE);
  CHECK_SAY(strstr(detail.text, "do not explain") && !strstr(detail.text, "late"), "%s",
            detail.text);
  odd.stalls = 100;
  odd.pacing = HAP_PACING_HOST;
  CHECK(identify_fake(&odd, &found, &detail) == HAP_ERROR_DEVICE);
  CHECK_SAY(strstr(detail.text, "ticks came late, by up to"), "%s", detail.text);
}

TEST(failing_devices_are_let_go)
{
  hap_device_identity found;
  hap_detail detail;
  fake mute = {.gain = 1.0, .bad_read = 700, .fails = true};
  CHECK(identify_fake(&mute, &found, &detail) == HAP_ERROR_DEVICE);
  CHECK(strstr(detail.text, "cannot be read") != NULL && fakes[0].reads == 700);
  fake mad = {.gain = 1.0, .bad_read = 900};
  CHECK(identify_fake(&mad, &found, &detail) == HAP_ERROR_DEVICE);
  CHECK(strstr(detail.text, "not finite") != NULL && fakes[0].reads == 900);
  fake first = {.gain = 1.0, .bad_read = 1, .fails = true};
  CHECK(identify_fake(&first, &found, &detail) == HAP_ERROR_DEVICE);
  CHECK(the.peak == 0.0);
}

/* Encoders whose axes are not those of the frame: there is no grid, but repetitions. */
TEST(quantum_is_seen_without_a_grid)
{
  hap_device_identity found;
  hap_detail detail;
  fake turned = {.gain = 1.0, .quantum = 2e-5, .turned = 0.4};
  CHECK(identify_fake(&turned, &found, &detail) == HAP_OK);
  printf("# %.3g m\n", found.quantum);
  CHECK(found.quantum > 1.7e-5 && found.quantum < 2.01e-5);
  CHECK_NEAR(found.mass, 0.2, 0.006);
}

static hapi_identify_sample steps[4000];

TEST(quantum_of_records)
{
  hapi_identify_record record = {steps, 4000, 4000};
  for (int i = 0; i < 4000; ++i) { /* steps of 2 to 6 quanta alone */
    steps[i].time = i * 1e-3;
    steps[i].position = (i > 0 ? steps[i - 1].position : 0.0) + 4e-6 * (2.0 + i % 5);
  }
  CHECK_NEAR(hapi_identify_quantum(&record), 4e-6, 1e-14);
  for (int i = 0; i < 4000; ++i) {
    steps[i].position = 0.01 * sin(i * 5e-3);
  }
  CHECK(hapi_identify_quantum(&record) == 0.0);
  for (int i = 0; i < 4000; ++i) {
    steps[i].position = 0.25;
  }
  CHECK(hapi_identify_quantum(&record) == 0.0);
}

/* ---- a person who stops it, clocks, arguments ---- */

static int stop_after(void *user, double done)
{
  int *left = user;
  CHECK(done >= 0.0 && done <= 1.0);
  return --*left <= 0;
}

TEST(person_can_stop_it)
{
  static const uint32_t pacings[] = {HAP_PACING_VIRTUAL, HAP_PACING_HOST, HAP_PACING_DEVICE};
  for (int k = 0; k < 3; ++k) {
    int left = 2; /* before it moves fast: a machine that is busy holds a force for long */
    fake device = {.gain = 1.0, .pacing = pacings[k]};
    hap_identify_def def;
    hap_device_identity found;
    hap_detail detail = {""};
    hap_device *opened = open_fake(&device);
    hap_identify_def_init(&def, sizeof def);
    hap_device_identity_init(&found, sizeof found);
    def.rate_hz = pacings[k] == HAP_PACING_DEVICE ? 20000.0 : 1000.0;
    def.watch = stop_after;
    def.user = &left;
    hap_status status = hap_device_identify(opened, &def, &found, &detail);
    /* the fake does not wait for a tick of its own, so it may give more than 20000 positions a s */
    bool fast = pacings[k] == HAP_PACING_DEVICE && status == HAP_ERROR_DEVICE;
    if (status != HAP_END) {
      printf("# pacing %u: %s\n", pacings[k], detail.text);
    }
    /* in real time, a machine that lets the thread wait lets the device run: then it is let go
     * of */
    bool ran = pacings[k] != HAP_PACING_VIRTUAL && status == HAP_ERROR_DEVICE &&
               strstr(detail.text, "its force was taken off") != NULL;
    CHECK(status == HAP_END || ran || (fast && strstr(detail.text, "raise rate_hz") != NULL));
    CHECK(fakes[0].stops == 1 && !is_pushing());
    hap_device_close(opened);
  }
}

static int alarm_while_it_pushes(void *user, double done)
{
  int *zeros = user;
  (void)done;
  if (is_pushing() && *zeros == 0) {
    hap_emergency_zero();
    *zeros = fakes[0].zeros;
    CHECK(!is_pushing());
  }
  return 0;
}

TEST(an_emergency_ends_it)
{
  int zeros = 0;
  fake device = {.gain = 1.0, .pacing = HAP_PACING_VIRTUAL};
  hap_identify_def def;
  hap_device_identity found;
  hap_detail detail = {""};
  hap_device *opened = open_fake(&device);
  hap_identify_def_init(&def, sizeof def);
  hap_device_identity_init(&found, sizeof found);
  def.watch = alarm_while_it_pushes;
  def.user = &zeros;
  CHECK(hap_device_identify(opened, &def, &found, &detail) == HAP_ERROR_DEVICE);
  CHECK(strstr(detail.text, "hap_emergency_zero") != NULL);
  CHECK(zeros == 1 && the.peak_after_zero == 0.0 && !is_pushing());
  zeros = fakes[0].zeros;
  hap_emergency_zero();
  CHECK(fakes[0].zeros == zeros); /* it is stopped and may be gone */
  hap_device_close(opened);
}

TEST(bad_arguments_are_refused)
{
  hap_device *device = NULL;
  hap_identify_def def;
  hap_device_identity found;
  hap_detail detail;
  REQUIRE(hap_device_open("virtual:hand=none,device_mass=1", &device, &detail) == HAP_OK);
  hap_identify_def_init(&def, sizeof def);
  hap_device_identity_init(&found, sizeof found);
  CHECK(hap_device_identify(NULL, &def, &found, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(hap_device_identify(device, NULL, &found, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(hap_device_identify(device, &def, NULL, &detail) == HAP_ERROR_ARGUMENT);
  def.max_force = 6.1; /* of 20 N */
  CHECK(hap_device_identify(device, &def, &found, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(strstr(detail.text, "max_force") != NULL);
  def.max_force = 2.0;
  def.max_speed = (double)NAN;
  CHECK(hap_device_identify(device, &def, &found, NULL) == HAP_ERROR_ARGUMENT);
  def.max_speed = 0.4;
  def.cookie = 0;
  CHECK(hap_device_identify(device, &def, &found, &detail) == HAP_ERROR_UNINITIALISED);
  hap_identify_def_init(&def, sizeof def);
  CHECK(hapi_device_claim(device));
  CHECK(hap_device_identify(device, &def, &found, &detail) == HAP_ERROR_STATE);
  hapi_device_release(device);
  hap_device_close(device);
}

/* A heap that fails at the nth allocation and counts what is not given back. */
typedef struct failing_heap {
  long left;
  long alive;
} failing_heap;

static void *failing_allocate(size_t size, void *user)
{
  failing_heap *heap = user;
  if (heap->left-- <= 0) {
    return NULL;
  }
  ++heap->alive;
  return malloc(size);
}

static void failing_release(void *memory, void *user)
{
  failing_heap *heap = user;
  --heap->alive;
  free(memory);
}

TEST(failed_allocations_are_survived)
{
  failing_heap heap = {0, 0};
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.allocate = failing_allocate;
  hooks.release = failing_release;
  hooks.user = &heap;
  hap_status status = HAP_ERROR_MEMORY;
  long tries = 1; /* the first allocation is the device's own */
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  for (; status < HAP_OK && tries < 30; ++tries) {
    hap_device_identity found;
    hap_detail detail = {""};
    heap.left = tries;
    status = identify_spec("virtual:hand=none,device_mass=0.3,device_damping=1", &found, &detail);
    CHECK(status == HAP_OK || strstr(detail.text, "memory") != NULL);
    CHECK(heap.alive == 0);
  }
  CHECK(hap_hooks_set(NULL) == HAP_OK);
  CHECK(status == HAP_OK && tries >= 7);
}

/* ---- files ---- */

static char path[160];

static hap_device_identity some_identity(void)
{
  hap_device_identity identity;
  hap_device_identity_init(&identity, sizeof identity);
  snprintf(identity.device, sizeof identity.device, "virtual");
  identity.mass = 0.123456789;
  identity.damping = 1.5;
  identity.friction = 0.25;
  identity.delay = 5e-4;
  identity.quantum = 3e-5;
  identity.residual = 0.0125;
  return identity;
}

static void check_round_trip(void)
{
  hap_device_identity written = some_identity();
  hap_device_identity read;
  hap_detail detail = {""};
  hap_device_identity_init(&read, sizeof read);
  CHECK(hap_device_identity_write(path, &written, &detail) == HAP_OK);
  CHECK(hap_device_identity_read(path, &read, &detail) == HAP_OK);
  CHECK(memcmp(&read, &written, sizeof read) == 0);
}

TEST(files_come_back_in_any_locale)
{
  check_round_trip();
  static const char *const commas[] = {"de_DE.UTF-8", "fr_FR.UTF-8", "de_DE"};
  for (int i = 0; i < 3; ++i) {
    if (setlocale(LC_ALL, commas[i]) != NULL) {
      printf("# with %s\n", commas[i]);
      check_round_trip();
    }
  }
  setlocale(LC_ALL, "C");
}

TEST(older_callers_are_served)
{
  struct {
    hap_device_identity identity;
  } old;
  hap_device_identity written = some_identity();
  memset(&old, 0x5a, sizeof old);
  hap_device_identity_init(&old.identity, offsetof(hap_device_identity, quantum));
  REQUIRE(hap_device_identity_write(path, &written, NULL) == HAP_OK);
  CHECK(hap_device_identity_read(path, &old.identity, NULL) == HAP_OK);
  CHECK(old.identity.size == offsetof(hap_device_identity, quantum));
  CHECK(old.identity.delay == 5e-4);
  CHECK(*(unsigned char *)&old.identity.quantum == 0x5a); /* behind its size: not touched */
  memset(&old, 0, sizeof old);
  CHECK(hap_device_identity_read(path, &old.identity, NULL) == HAP_ERROR_UNINITIALISED);
}

#define HEAD "# comment\n\nversion = 1\ndevice = virtual\n"
#define TAIL "friction=0\ndelay=0 # s\nquantum=0\nresidual=0"

TEST(files_may_be_written_by_hand)
{
  static const char text[] =
      "\t version=1#one\r\n  device =  my own # device  \r\n mass\t= .5\r\n"
      "damping = 1e0   # N s/m\n" TAIL;
  hap_device_identity read;
  hap_detail detail = {""};
  hap_device_identity_init(&read, sizeof read);
  file_write_bytes(path, text, sizeof text - 1);
  CHECK(hap_device_identity_read(path, &read, &detail) == HAP_OK);
  CHECK(strcmp(read.device, "my own # device") == 0 && read.mass == 0.5 && read.damping == 1.0);
}

TEST(bad_files_are_refused_with_their_line)
{
  static const char *const bad[][2] = {
      {"", "line 1: the file ends without a line device"},
      {"mass = 1\n", "line 1: expected version = 1"},
      {"version = 2\n", "line 1: this library reads version 1, not 2"},
      {"version = x\n", "line 1: version: expected a number"},
      {HEAD "version = 1\n", "line 5: known are"},
      {HEAD "mass = 1\ndamping = 1\n", "line 7: the file ends without a line friction"},
      {HEAD "mass = 1\nmass = 1\n", "line 6: given twice: mass"},
      {HEAD "device = virtual\n", "line 5: given twice: device"},
      {"version = 1\ndevice =\n", "line 2: device: expected a name"},
      {HEAD "mass = 1,5\n", "line 5: mass: expected a number"},
      {HEAD "mass = 1 kg\n", "line 5: mass: expected a number"},
      {HEAD "mass = -1\n", "line 5: mass: expected a number from 0 to 10000"},
      {HEAD "mass = 1e5\n", "line 5: mass"},
      {HEAD "mass = nan\n", "line 5: mass"},
      {HEAD "delay = 2\n", "line 5: delay: expected a number from 0 to 1, not 2"},
      {HEAD "mass\n", "line 5: expected key = value"},
      {HEAD "= 3\n", "line 5: expected key = value"},
      {HEAD "colour = 3\n", "line 5: known are"},
  };
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    hap_device_identity read = some_identity();
    const hap_device_identity before = read;
    hap_detail detail = {""};
    file_write(path, bad[i][0]);
    CHECK(hap_device_identity_read(path, &read, &detail) == HAP_ERROR_FORMAT);
    CHECK(memcmp(&read, &before, sizeof read) == 0);
    CHECK(strstr(detail.text, path) != NULL);
    if (strstr(detail.text, bad[i][1]) == NULL) {
      CHECK(false);
      printf("# '%s' gave '%s'\n", bad[i][0], detail.text);
    }
  }
  static char endless[5000];
  hap_device_identity read = some_identity();
  hap_detail detail = {""};
  memset(endless, 'x', sizeof endless);
  file_write_bytes(path, endless, sizeof endless);
  CHECK(hap_device_identity_read(path, &read, &detail) == HAP_ERROR_FORMAT);
  CHECK(strstr(detail.text, "line 1: longer") != NULL);
  file_write_bytes(path, "version = 1\nmass\0= 1\n", 21);
  CHECK(hap_device_identity_read(path, &read, &detail) == HAP_ERROR_FORMAT);
  CHECK(strstr(detail.text, "line 2") != NULL);
  CHECK(hap_device_identity_read("/nowhere/at/all", &read, &detail) == HAP_ERROR_IO);
  CHECK(hap_device_identity_read("/tmp", &read, &detail) == HAP_ERROR_IO);
  CHECK(hap_device_identity_read(NULL, &read, &detail) == HAP_ERROR_ARGUMENT);
}

TEST(bad_identities_are_not_written)
{
  hap_detail detail;
  hap_device_identity identity = some_identity();
  CHECK(hap_device_identity_write("/nowhere/at/all", &identity, &detail) == HAP_ERROR_IO);
  CHECK(hap_device_identity_write(NULL, &identity, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(hap_device_identity_write(path, NULL, &detail) == HAP_ERROR_ARGUMENT);
  identity.delay = (double)NAN;
  CHECK(hap_device_identity_write(path, &identity, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(strstr(detail.text, "delay") != NULL);
  identity = some_identity();
  snprintf(identity.device, sizeof identity.device, "two\nlines");
  CHECK(hap_device_identity_write(path, &identity, &detail) == HAP_ERROR_ARGUMENT);
  if (access("/dev/full", W_OK) == 0) {
    identity = some_identity();
    CHECK(hap_device_identity_write("/dev/full", &identity, &detail) == HAP_ERROR_IO);
  }
}

/* ---- use ---- */

TEST(identity_takes_the_place_of_what_the_device_says)
{
  hap_device *device = NULL;
  hap_device_info info;
  hap_detail detail;
  hap_device_identity identity = some_identity();
  REQUIRE(hap_device_open("virtual:max_force=7,rated_stiffness=900,quantum=1", &device, &detail) ==
              HAP_ERROR_ARGUMENT &&
          device == NULL);
  REQUIRE(hap_device_open("virtual:max_force=7,rated_stiffness=900,device_mass=4", &device,
                          &detail) == HAP_OK);
  CHECK(hapi_device_claim(device));
  CHECK(hap_device_set_identity(device, &identity, &detail) == HAP_ERROR_STATE);
  hapi_device_release(device);
  identity.mass = -1.0;
  CHECK(hap_device_set_identity(device, &identity, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(hap_device_get_info(device, &info, sizeof info) == HAP_OK && info.mass == 4.0);
  identity = some_identity();
  CHECK(hap_device_set_identity(device, &identity, &detail) == HAP_OK);
  CHECK(hap_device_get_info(device, &info, sizeof info) == HAP_OK);
  CHECK(info.mass == 0.123456789 && info.damping == 1.5 && info.friction == 0.25);
  CHECK(info.delay == 5e-4 && info.quantum == 3e-5);
  CHECK(info.max_force == 7.0 && info.rated_stiffness == 900.0);
  snprintf(identity.device, sizeof identity.device, "other");
  CHECK(hap_device_set_identity(device, &identity, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(strstr(detail.text, "'other'") != NULL);
  CHECK(hap_device_set_identity(NULL, &identity, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(hap_device_set_identity(device, NULL, NULL) == HAP_ERROR_ARGUMENT);
  hap_device_close(device);
}

TEST(identity_without_a_quantum_leaves_the_devices_own)
{
  hap_device *device = NULL;
  hap_device_info info;
  hap_device_identity identity = some_identity();
  REQUIRE(hap_device_open("virtual:quantum=2e-5,delay=1e-3", &device, NULL) == HAP_OK);
  identity.quantum = 0.0;
  identity.delay = 0.0;
  CHECK(hap_device_set_identity(device, &identity, NULL) == HAP_OK);
  CHECK(hap_device_get_info(device, &info, sizeof info) == HAP_OK);
  CHECK(info.quantum == 2e-5 && info.delay == 0.0 && info.measures_velocity == 0);
  hap_device_close(device);
}

SET_UP
{
  bool good = folder_make();
  snprintf(path, sizeof path, "%s", folder_path("identity"));
  return good;
}
