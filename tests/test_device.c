/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Opening, describing, sharing and closing of devices; the argument text; lib/base below them. */

#include "tests/tap.h"

#include <stdint.h>

#include <hapode/hapode.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/number.h"
#include "plugins/common/arguments.h"
#include "plugins/common/output.h"
#include "plugins/common/timeline.h"
#include "tests/fake_device.h"

static int opens;

static hap_status open_gives; /* to "quiet", "full" and "none" */

static hap_status counted_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  ++opens;
  if (strcmp(args, "full") == 0) {
    memset(detail->text, 'x', sizeof detail->text); /* no end */
  }
  if (args[0] != '\0' && strcmp(args, "fail") != 0) {
    return open_gives;
  }
  if (strcmp(args, "fail") == 0) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "fake: no");
  }
  *self = &fakes[0];
  return HAP_OK;
}

static hap_device_ops counted_ops(void)
{
  hap_device_ops ops = fake_ops;
  ops.open = counted_open;
  opens = 0;
  fakes_opened = 0;
  fake_next()->info.max_force = 0.0;
  return ops;
}

static hap_status open_fake(const hap_device_ops *ops, hap_device **out)
{
  hap_detail detail = {""};
  hap_status status = hapi_device_open_ops(ops, NULL, "", out, &detail);
  CHECK((status < 0) == (*out == NULL));
  CHECK(status >= 0 || detail.text[0] != '\0');
  return status;
}

TEST(names_are_listed)
{
  const char *about = NULL;
  CHECK(strcmp(hap_device_name_at(0, &about), "virtual") == 0);
  CHECK(about != NULL && strstr(about, "path=") != NULL);
  CHECK(strcmp(hap_device_name_at(1, NULL), "replay") == 0);
  size_t count = 0;
  for (const hap_device_ops *ops; (ops = hapi_registry_at(count)) != NULL; ++count) {
    CHECK(ops->abi == HAP_DEVICE_ABI && ops->size == sizeof *ops);
    CHECK(strcmp(hap_device_name_at(count, NULL), ops->name) == 0);
  }
  CHECK(strcmp(hap_device_name_at(count, &about), "module") == 0); /* how all others are opened */
  CHECK(about != NULL && strstr(about, ".so") != NULL);
  ++count;
  CHECK(hap_device_name_at(count, &about) == NULL && about == NULL);
  CHECK(hap_device_name_at(SIZE_MAX, NULL) == NULL);
}

TEST(unknown_name_lists_the_known)
{
  static const char *const specs[] = {"virtua", "virtuall:", "", ":", "REPLAY:x.csv"};
  for (size_t i = 0; i < sizeof specs / sizeof specs[0]; ++i) {
    hap_device *device = (hap_device *)&fakes[0];
    hap_detail detail;
    CHECK(hap_device_open(specs[i], &device, &detail) == HAP_ERROR_NOT_FOUND);
    CHECK(device == NULL);
    CHECK(strstr(detail.text, "virtual") != NULL && strstr(detail.text, "replay") != NULL);
    CHECK(hap_device_open(specs[i], &device, NULL) == HAP_ERROR_NOT_FOUND);
  }
}

TEST(null_is_refused)
{
  hap_device *device = (hap_device *)&fakes[0];
  hap_device_info info;
  CHECK(hap_device_open(NULL, &device, NULL) == HAP_ERROR_ARGUMENT && device == NULL);
  CHECK(hap_device_open("virtual", NULL, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_device_get_info(NULL, &info, sizeof info) == HAP_ERROR_ARGUMENT);
  hap_device_close(NULL);
  REQUIRE(hap_device_open("virtual", &device, NULL) == HAP_OK);
  CHECK(hap_device_get_info(device, NULL, sizeof info) == HAP_ERROR_ARGUMENT);
  CHECK(hap_device_get_info(device, &info, 0) == HAP_ERROR_ARGUMENT);
  hap_device_close(device);
}

TEST(abi_comes_first)
{
  /* behind abi nothing but rubbish: reading any pointer of it would end the test program */
  hap_device_ops ops;
  memset(&ops, 0x5a, sizeof ops);
  hap_device *device = NULL;
  ops.abi = HAP_DEVICE_ABI + 1;
  CHECK(open_fake(&ops, &device) == HAP_ERROR_UNSUPPORTED);
  ops.abi = HAP_DEVICE_ABI;
  ops.size = (uint32_t)offsetof(hap_device_ops, held) - 1;
  CHECK(open_fake(&ops, &device) == HAP_ERROR_UNSUPPORTED);
}

TEST(older_tables_without_optional_operations_are_served)
{
  hap_device *device = NULL;
  hap_device_ops ops = counted_ops();
  ops.size = (uint32_t)offsetof(hap_device_ops, held);
  REQUIRE(open_fake(&ops, &device) == HAP_OK);
  hap_device_close(device);
}

TEST(bad_tables_are_refused)
{
  hap_device *device = NULL;
  hap_device_ops ops = counted_ops();
  ops.name = "Fake";
  CHECK(open_fake(&ops, &device) == HAP_ERROR_DEVICE);
  ops = counted_ops();
  ops.name = NULL;
  CHECK(open_fake(&ops, &device) == HAP_ERROR_DEVICE);
  ops = counted_ops();
  ops.pacing = 3;
  CHECK(open_fake(&ops, &device) == HAP_ERROR_UNSUPPORTED);
  for (size_t at = offsetof(hap_device_ops, open); at <= offsetof(hap_device_ops, close);
       at += sizeof ops.open) {
    ops = counted_ops();
    memset((char *)&ops + at, 0, sizeof ops.open);
    CHECK(open_fake(&ops, &device) == HAP_ERROR_DEVICE);
  }
  CHECK(opens == 0);
}

/* A status that is none, no text, no self: it is said all the same. */
TEST(what_open_does_wrong_is_said)
{
  static const struct {
    hap_status gives;
    const char *args;
    hap_status status;
    const char *said;
  } cases[] = {{HAP_ERROR_IO, "quiet", HAP_ERROR_IO, "a file cannot be"},
               {(hap_status)-999, "quiet", HAP_ERROR_DEVICE, "unknown status"},
               {(hap_status)INT32_MIN, "full", HAP_ERROR_DEVICE, "xxxxxxx"},
               {HAP_OK, "none", HAP_ERROR_DEVICE, "gave no self"}};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    hap_device_ops ops = counted_ops();
    hap_device *device = NULL;
    hap_detail detail = {"of before"};
    open_gives = cases[i].gives;
    CHECK(hapi_device_open_ops(&ops, NULL, cases[i].args, &device, &detail) == cases[i].status);
    CHECK(device == NULL && strstr(detail.text, cases[i].said) != NULL && fakes[0].closes == 0);
    CHECK(strstr(detail.text, "of before") == NULL);
    CHECK(memchr(detail.text, '\0', sizeof detail.text) != NULL);
  }
}

TEST(bad_info_closes_again)
{
  hap_device *device = NULL;
  hap_device_ops ops = counted_ops();
  fakes[0].info.dof = 4;
  CHECK(open_fake(&ops, &device) == HAP_ERROR_DEVICE && fakes[0].closes == 1);
  double wrong[3] = {(double)NAN, (double)INFINITY, -1.0};
  for (int i = 0; i < 3; ++i) {
    ops = counted_ops();
    fakes[0].info.max_force = wrong[i];
    CHECK(open_fake(&ops, &device) == HAP_ERROR_DEVICE && fakes[0].closes == 1);
    ops = counted_ops();
    fakes[0].info.quantum = wrong[i];
    CHECK(open_fake(&ops, &device) == HAP_ERROR_DEVICE && fakes[0].closes == 1);
  }
}

/* One axis, a gripper; what is not right about it and the rest is set by the test. */
static hap_axis_info fake_axis;

static void fake_describe_axis(void *self, uint32_t effector, uint32_t axis, hap_axis_info *out)
{
  (void)self;
  *out = fake_axis;
  out->high += 10.0 * effector + axis;
}

static hap_device_ops many_ops(void)
{
  hap_device_ops ops = counted_ops();
  ops.describe_axis = fake_describe_axis;
  fakes[0].info.effector_count = HAP_EFFECTORS_MAX;
  fakes[0].info.axis_count = HAP_AXES_MAX;
  fakes[0].info.button_count = fakes[0].info.led_count = 32;
  fakes[0].info.vibrator_count = HAP_VIBRATORS_MAX;
  fakes[0].info.workspace_low[1] = -0.1;
  fakes[0].info.workspace_high[1] = 0.2;
  fake_axis = (hap_axis_info){.kind = HAP_AXIS_GRIPPER, .high = 1.0, .max_force = 8.0};
  return ops;
}

TEST(end_effectors_and_axes_are_told)
{
  hap_device *device = NULL;
  hap_device_info info;
  hap_axis_info axis;
  hap_device_ops ops = many_ops();
  REQUIRE(open_fake(&ops, &device) == HAP_OK);
  for (uint32_t i = 0; i < HAP_EFFECTORS_MAX; ++i) {
    CHECK(hap_device_get_effector(device, i, &info, sizeof info) == HAP_OK);
    CHECK(info.effector_count == HAP_EFFECTORS_MAX && info.pacing == HAP_PACING_VIRTUAL);
    CHECK(info.workspace_low[1] == -0.1 && info.workspace_high[1] == 0.2);
    CHECK(hap_device_get_axis(device, i, 7, &axis, sizeof axis) == HAP_OK);
    CHECK(axis.size == sizeof axis && axis.kind == HAP_AXIS_GRIPPER && axis.max_force == 8.0);
    CHECK_NEAR(axis.high, 1.0 + 10.0 * i + 7.0, 0.0);
  }
  CHECK(hap_device_get_effector(device, HAP_EFFECTORS_MAX, &info, sizeof info) ==
        HAP_ERROR_NOT_FOUND);
  CHECK(hap_device_get_axis(device, 0, HAP_AXES_MAX, &axis, sizeof axis) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_device_get_axis(device, HAP_EFFECTORS_MAX, 0, &axis, sizeof axis) ==
        HAP_ERROR_NOT_FOUND);
  CHECK(hap_device_get_effector(NULL, 0, &info, sizeof info) == HAP_ERROR_ARGUMENT);
  CHECK(hap_device_get_axis(NULL, 0, 0, &axis, sizeof axis) == HAP_ERROR_ARGUMENT);
  CHECK(hap_device_get_axis(device, 0, 0, NULL, sizeof axis) == HAP_ERROR_ARGUMENT);
  hap_device_close(device);
  ops = counted_ops(); /* one that says nothing of it has one */
  REQUIRE(open_fake(&ops, &device) == HAP_OK);
  CHECK(hap_device_get_info(device, &info, sizeof info) == HAP_OK && info.effector_count == 1);
  CHECK(hap_device_get_axis(device, 0, 0, &axis, sizeof axis) == HAP_ERROR_NOT_FOUND);
  hap_device_close(device);
}

TEST(too_many_of_anything_and_bad_axes_are_refused)
{
  hap_device *device = NULL;
  for (int i = 0; i < 14; ++i) {
    hap_device_ops ops = many_ops();
    hap_device_info *info = &fakes[0].info;
    info->effector_count += i == 0;
    info->axis_count += i == 1;
    info->button_count += i == 2;
    info->led_count += i == 3;
    info->vibrator_count += i == 4;
    info->workspace_low[2] = i == 5 ? 0.01 : 0.0;
    info->workspace_high[0] = i == 6 ? (double)NAN : 0.0;
    info->vibrator_hz[1] = i == 7 ? -1.0 : 0.0;
    ops.describe_axis = i == 8 ? NULL : ops.describe_axis;
    fake_axis.low = i == 9 ? 100.0 : i == 10 ? (double)NAN : 0.0;
    fake_axis.max_force = i == 11 ? -1.0 : 0.0;
    fake_axis.kind += i == 12;
    fake_axis.unit += i == 13 ? 3 : 0;
    CHECK(open_fake(&ops, &device) == HAP_ERROR_DEVICE && fakes[0].closes == 1);
  }
  hap_device_ops ops = many_ops(); /* a table that ends before the operation */
  ops.size = (uint32_t)offsetof(hap_device_ops, describe_axis);
  CHECK(open_fake(&ops, &device) == HAP_ERROR_DEVICE);
}

TEST(failed_open_keeps_its_text)
{
  hap_device_ops ops = counted_ops();
  hap_device *device = NULL;
  hap_detail detail;
  CHECK(hapi_device_open_ops(&ops, NULL, "fail", &device, &detail) == HAP_ERROR_DEVICE);
  CHECK(device == NULL && strcmp(detail.text, "fake: no") == 0 && fakes[0].closes == 0);
}

TEST(info_has_a_name_and_fits_any_size)
{
  hap_device *device = NULL;
  hap_device_ops ops = counted_ops();
  fakes[0].info.max_force = 7.5;
  REQUIRE(open_fake(&ops, &device) == HAP_OK);
  struct {
    hap_device_info info;
    char newer[32];
  } large;
  memset(&large, 0xff, sizeof large);
  CHECK(hap_device_get_info(device, &large.info, sizeof large) == HAP_OK);
  CHECK(strcmp(large.info.name, "fake") == 0);
  CHECK_NEAR(large.info.max_force, 7.5, 0.0);
  CHECK(large.info.size == sizeof large.info);
  CHECK((unsigned char)large.newer[0] == 0xff && (unsigned char)large.newer[31] == 0xff);
  hap_device_info small;
  memset(&small, 0xff, sizeof small);
  CHECK(hap_device_get_info(device, &small, offsetof(hap_device_info, max_force)) == HAP_OK);
  CHECK(small.dof == 3 && small.size == offsetof(hap_device_info, max_force));
  CHECK(((unsigned char *)&small.max_force)[0] == 0xff); /* behind the size: not touched */
  hap_device_close(device);

  ops = counted_ops();
  memset(fakes[0].info.name, 'n', sizeof fakes[0].info.name); /* not terminated */
  REQUIRE(open_fake(&ops, &device) == HAP_OK);
  CHECK(strlen(hapi_device_info(device)->name) == sizeof fakes[0].info.name - 1);
  hap_device_close(device);
}

TEST(close_zeroes_first)
{
  hap_device *device = NULL;
  hap_device_ops ops = counted_ops();
  REQUIRE(open_fake(&ops, &device) == HAP_OK);
  CHECK(hapi_device_ops(device) == &ops && hapi_device_self(device) == &fakes[0]);
  hap_device_close(device);
  CHECK(fakes[0].zeros == 1 && fakes[0].closes == 1 && fakes[0].wrong == 0);
}

TEST(one_device_serves_one_pointer)
{
  hap_device *device = NULL;
  hap_device_ops ops = counted_ops();
  REQUIRE(open_fake(&ops, &device) == HAP_OK);
  CHECK(hapi_device_claim(device));
  CHECK(!hapi_device_claim(device));
  hapi_device_release(device);
  CHECK(hapi_device_claim(device));
  hap_device_close(device); /* early: zero now, gone when the pointer lets go */
  CHECK(fakes[0].zeros == 1 && fakes[0].closes == 0);
  CHECK(!hapi_device_claim(device));
  hapi_device_release(device);
  CHECK(fakes[0].closes == 1);
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

static void open_until_it_fits(const char *spec)
{
  failing_heap heap = {0, 0};
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.allocate = failing_allocate;
  hooks.release = failing_release;
  hooks.user = &heap;
  hap_status status = HAP_ERROR_MEMORY;
  long tries = 0;
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  for (; status == HAP_ERROR_MEMORY && tries < 100; ++tries) {
    heap.left = tries;
    hap_device *device = NULL;
    hap_detail detail;
    status = hap_device_open(spec, &device, &detail);
    CHECK(status == HAP_OK || (device == NULL && strstr(detail.text, "memory") != NULL));
    hap_device_close(device);
    CHECK(heap.alive == 0);
  }
  CHECK(hap_hooks_set(NULL) == HAP_OK);
  CHECK(status == HAP_OK && tries >= 3);
}

TEST(every_failed_allocation_is_survived)
{
  char path[] = "/tmp/hapode-device-XXXXXX";
  int file = mkstemp(path);
  REQUIRE(file >= 0);
  FILE *out = fdopen(file, "w");
  REQUIRE(out != NULL);
  fputs("t,x,y,z\n", out);
  for (int i = 0; i < 3000; ++i) {
    fprintf(out, "%d,%d,0,0\n", i, i);
  }
  fclose(out);
  char spec[128];
  snprintf(spec, sizeof spec, "replay:%s", path);
  open_until_it_fits(spec);
  open_until_it_fits("virtual:path=0:0/0/0;1:1/2/3,hand=relaxed");
  remove(path);
}

static hap_status read_arguments(const char *text, hapi_argument *entries, hap_detail *detail)
{
  static const char *const words[] = {"red", "green", NULL};
  const hapi_argument known[5] = {
      {"number", HAPI_ARGUMENT_NUMBER, false, -2.0, 2.0, .expected = "a number within 2"},
      {"vector", HAPI_ARGUMENT_VECTOR, false, -10.0, 10.0, .expected = "x/y/z"},
      {"turn", HAPI_ARGUMENT_QUATERNION, .expected = "w/x/y/z"},
      {"word", HAPI_ARGUMENT_WORD, .expected = "red or green", .words = words},
      {"text", HAPI_ARGUMENT_TEXT, .expected = "some text"}};
  memcpy(entries, known, sizeof known);
  hapi_argument_table table = {"dev", entries, 5};
  return hapi_arguments_read(&table, text, detail);
}

TEST(arguments_are_read)
{
  hapi_argument e[5];
  hap_detail detail;
  REQUIRE(read_arguments("word=green,number=-1.5e0,turn=0/0/3/4,vector=1/-2/.5,text=a=b;c", e,
                         &detail) == HAP_OK);
  CHECK_NEAR(e[0].number[0], -1.5, 0.0);
  CHECK(e[1].number[0] == 1.0 && e[1].number[1] == -2.0 && e[1].number[2] == 0.5);
  CHECK_NEAR(e[2].number[2], 0.6, 1e-15);
  CHECK_NEAR(e[2].number[3], 0.8, 1e-15);
  CHECK(e[3].word == 1 && e[4].length == 5 && memcmp(e[4].text, "a=b;c", 5) == 0);
  REQUIRE(read_arguments("", e, &detail) == HAP_OK);
  CHECK(!e[0].given && !e[4].given);
  REQUIRE(read_arguments("turn=1e-8/0/0/1e-8", e, &detail) == HAP_OK);
  CHECK_NEAR(e[2].number[0], sqrt(0.5), 1e-15);
}

TEST(bad_arguments_say_why)
{
  static const char *const bad[][2] = {{"number=", "number: expected a number within 2"},
                                       {"number=x", "not 'x'"},
                                       {"number=1x", "number"},
                                       {"number= 1", "number"},
                                       {"number=3", "number within 2"},
                                       {"number=nan", "number"},
                                       {"number=inf", "number"},
                                       {"number=1e999", "number"},
                                       {"number=0x1", "number"},
                                       {"number=1/2", "number"},
                                       {"number=1,number=1", "'number' is given twice"},
                                       {"vector=1/2", "vector: expected x/y/z"},
                                       {"vector=1/2/3/4", "vector"},
                                       {"vector=1/2/", "vector"},
                                       {"vector=1//3", "vector"},
                                       {"vector=1/2/11", "vector"},
                                       {"vector=1/nan/1", "vector"},
                                       {"turn=0/0/0/0", "turn: expected w/x/y/z"},
                                       {"turn=1/0/0", "turn"},
                                       {"word=blue", "word: expected red or green, not 'blue'"},
                                       {"word=re", "word"},
                                       {"text=", "text"},
                                       {"colour=red", "no argument 'colour'"},
                                       {"=1", "no argument ''"},
                                       {"number", "key=value, not 'number'"},
                                       {",", "key=value"},
                                       {"number=1,", "key=value"},
                                       {",number=1", "key=value"},
                                       {"number=1,,word=red", "key=value"}};
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    hapi_argument e[5];
    hap_detail detail = {""};
    CHECK(read_arguments(bad[i][0], e, &detail) == HAP_ERROR_ARGUMENT);
    bool told_why = strstr(detail.text, bad[i][1]) != NULL &&
                    strstr(detail.text, "known: number, vector, turn, word, text") != NULL;
    CHECK_SAY(told_why, "'%s' gave '%s'", bad[i][0], detail.text);
  }
}

TEST(long_arguments_are_cut_in_the_text)
{
  char text[4096];
  memset(text, 'k', sizeof text - 1);
  text[sizeof text - 1] = '\0';
  hapi_argument e[5];
  hap_detail detail;
  CHECK(read_arguments(text, e, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(strstr(detail.text, "known: number, vector, turn, word, text") != NULL);
}

TEST(numbers_are_those_of_strtod)
{
  srand(7);
  for (int i = 0; i < 20000; ++i) {
    char text[64];
    double value = ldexp((double)rand() / RAND_MAX - 0.5, rand() % 400 - 200);
    snprintf(text, sizeof text, rand() % 2 == 0 ? "%.*g," : "%.*e,", rand() % 20, value);
    double read = 0.0;
    const char *end = hapi_number_read(text, &read);
    char *expected_end = NULL;
    double expected = strtod(text, &expected_end);
    CHECK(end == expected_end && read == expected);
  }
  double untouched = 42.0;
  static const char *const none[] = {"", ".", "-", "+.", "e5", " 1", "nan", "infinity", "1e400"};
  for (size_t i = 0; i < sizeof none / sizeof none[0]; ++i) {
    CHECK(hapi_number_read(none[i], &untouched) == NULL && untouched == 42.0);
  }
  const char *lone = "2e+x";
  CHECK(hapi_number_read(lone, &untouched) == lone + 1 && untouched == 2.0);
}

TEST(output_keeps_the_direction)
{
  hapi_output output;
  hap_wrench reached;
  hap_wrench held;
  hapi_output_init(&output, 5.0, 0.5);
  hap_wrench wanted = {{3.0, 0.0, 4.0}, {0.0, 0.5, 0.0}};
  CHECK(hapi_output_write(&output, &wanted, &reached) == HAP_OK);
  CHECK(reached.force[0] == 3.0 && reached.force[2] == 4.0 && reached.torque[1] == 0.5);
  wanted = (hap_wrench){{30.0, 0.0, -40.0}, {0.0, 0.0, 0.1}};
  CHECK(hapi_output_write(&output, &wanted, &reached) == HAP_SATURATED);
  CHECK_NEAR(reached.force[0], 3.0, 1e-14);
  CHECK_NEAR(reached.force[2], -4.0, 1e-14);
  CHECK_NEAR(reached.torque[2], 0.1, 0.0); /* force and torque apart */
  wanted = (hap_wrench){{1e300, 1e300, 0.0}, {0.0, 0.0, -2.0}};
  CHECK(hapi_output_write(&output, &wanted, &reached) == HAP_SATURATED);
  CHECK_NEAR(reached.force[0], 5.0 * sqrt(0.5), 1e-14);
  CHECK_NEAR(reached.torque[2], -0.5, 1e-15);
  wanted.force[1] = (double)NAN;
  CHECK(hapi_output_write(&output, &wanted, &reached) == HAP_ERROR_ARGUMENT);
  hapi_output_get(&output, &held);
  CHECK_NEAR(held.force[0], 5.0 * sqrt(0.5), 1e-14);
  hapi_output_zero(&output);
  hapi_output_zero(&output);
  hapi_output_get(&output, &held);
  CHECK(held.force[0] == 0.0 && held.torque[2] == 0.0);
}

TEST(timeline_goes_forward_only)
{
  hapi_timeline line = {.running = false};
  CHECK(hapi_timeline_advance(&line, 5) == HAP_ERROR_STATE);
  hapi_timeline_start(&line);
  CHECK(hapi_timeline_advance(&line, INT64_MIN) == HAP_OK && line.elapsed_ns == 0);
  CHECK(hapi_timeline_advance(&line, 7) == HAP_OK);
  CHECK(hapi_timeline_advance(&line, 6) == HAP_ERROR_ARGUMENT);
  CHECK(hapi_timeline_advance(&line, 7) == HAP_OK);
  CHECK(hapi_timeline_advance(&line, INT64_MAX) == HAP_OK && line.elapsed_ns == UINT64_MAX);
  hapi_timeline_start(&line);
  CHECK(hapi_timeline_advance(&line, -3) == HAP_OK && line.elapsed_ns == 0);
  CHECK(hapi_timeline_advance(&line, -4) == HAP_ERROR_ARGUMENT);
  hapi_timeline_stop(&line);
  CHECK(hapi_timeline_advance(&line, 9) == HAP_ERROR_STATE);
}

TEST(each_status_has_name_and_text)
{
  for (int value = -14; value <= 7; ++value) {
    hap_status status = (hap_status)value;
    CHECK(strncmp(hap_status_name(status), value < 0 ? "HAP_ERROR_" : "HAP_", value < 0 ? 10 : 4) ==
          0);
    CHECK(strcmp(hap_status_text(status), "unknown status") != 0);
    for (int other = -14; other < value; ++other) {
      CHECK(strcmp(hap_status_text(status), hap_status_text((hap_status)other)) != 0);
      CHECK(strcmp(hap_status_name(status), hap_status_name((hap_status)other)) != 0);
    }
  }
  CHECK(strcmp(hap_status_name(HAP_ERROR_FORMAT), "HAP_ERROR_FORMAT") == 0);
  CHECK(strcmp(hap_status_text((hap_status)99), "unknown status") == 0);
  CHECK(strcmp(hap_status_name((hap_status)-99), "HAP_UNKNOWN_STATUS") == 0);
  char version[32];
  snprintf(version, sizeof version, "%d.%d.%d", HAP_VERSION_MAJOR, HAP_VERSION_MINOR,
           HAP_VERSION_PATCH);
  CHECK(strcmp(hap_version(), version) == 0);
}

static char logged[2048];

static void keep_log(hap_log_level level, const char *text, void *user)
{
  CHECK(level == HAP_LOG_WARNING && user == &fakes[0]);
  snprintf(logged, sizeof logged, "%s", text);
}

TEST(hooks_are_used)
{
  hap_hooks half;
  hap_hooks_init(&half, sizeof half);
  half.allocate = failing_allocate;
  CHECK(hap_hooks_set(&half) == HAP_ERROR_ARGUMENT);
  hap_hooks_init(&half, sizeof half);
  half.release = failing_release;
  CHECK(hap_hooks_set(&half) == HAP_ERROR_ARGUMENT);
  hapi_log(HAP_LOG_ERROR, "thrown away");
  hap_hooks log_only;
  hap_hooks_init(&log_only, sizeof log_only);
  log_only.log = keep_log;
  log_only.user = &fakes[0];
  REQUIRE(hap_hooks_set(&log_only) == HAP_OK);
  hapi_log(HAP_LOG_WARNING, "%s %d", "gap", 3);
  CHECK(strcmp(logged, "gap 3") == 0);
  unsigned char *memory = hapi_alloc_array(10, 100);
  REQUIRE(memory != NULL);
  for (int i = 0; i < 1000; ++i) {
    CHECK(memory[i] == 0);
  }
  hapi_free(memory);
  hapi_free(NULL);
  memory = hapi_alloc(0);
  CHECK(memory != NULL);
  hapi_free(memory);
  CHECK(hapi_alloc_array(SIZE_MAX / 2, 3) == NULL);
  CHECK(hap_hooks_set(NULL) == HAP_OK);
}

TEST(fail_writes_and_cuts)
{
  hap_detail detail;
  memset(&detail, 'x', sizeof detail);
  CHECK(hapi_fail(&detail, HAP_STALE, "%0600d", 7) == HAP_STALE);
  CHECK(strlen(detail.text) == sizeof detail.text - 1);
  CHECK(hapi_fail(NULL, HAP_ERROR_IO, "%d", 7) == HAP_ERROR_IO);
}

TEST(deadlines_do_not_drift)
{
  static const uint64_t index[] = {0, 1, 59, 60, 61, 1000000007u, 123456789012345u};
  for (size_t i = 0; i < sizeof index / sizeof index[0]; ++i) {
    for (uint64_t rate = 1; rate < 5000; rate = rate * 7 / 3 + 1) {
      uint64_t whole = index[i] / rate;
      if (whole > 9000000000u) {
        continue; /* 285 years: beyond an int64_t of nanoseconds soon after */
      }
      uint64_t rest_ns = ((index[i] % rate) * 1000000000u + rate / 2) / rate;
      int64_t expected = (int64_t)(whole * 1000000000u + rest_ns);
      int64_t got = hapi_clock_deadline(index[i], (double)rate);
      CHECK(got - expected >= -1 && got - expected <= 1); /* a half may round either way */
    }
  }
  CHECK(hapi_clock_deadline(86400ull * 1000 * 365, 1000.0) == 86400LL * 365 * HAPI_NS_PER_S);
  CHECK(hapi_clock_deadline(1, 2.5) == 400000000);
}

TEST(sleep_ends_after_its_time)
{
  int64_t begin = hapi_clock_now();
  hapi_clock_sleep_until(begin + 2000000);
  CHECK(hapi_clock_now() >= begin + 2000000);
  hapi_clock_sleep_until(begin); /* passed */
  hapi_clock_sleep_until(-5);
  hapi_clock_sleep_until(0);
  CHECK(hapi_clock_now() >= begin);
}
