/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Devices from shared objects: what is refused and how that is said, how long the code stays,
 * threads and signals in it, and a session that lives with a device that does all wrong.
 * HAPODE_TABLES, HAPODE_BROKEN, HAPODE_SKELETON, HAPODE_SYMBOLLESS, HAPODE_UNRESOLVED: the
 * modules. */

#include "tests/files.h"
#include "tests/tap.h"

#include <dlfcn.h>
#include <elf.h>
#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include <hapode/device_impl.h>

#include "base/vec.h"
#include "device/device.h"
#include "device/emergency.h"
#include "tests/failing_heap.h"
#include "tests/stage.h"

static const char *spec_of(const char *path, const char *args)
{
  static char spec[5000];
  snprintf(spec, sizeof spec, "module:%s%s", path, args);
  return spec;
}

static const char *module_of(const char *variable)
{
  const char *path = folder_module(variable);
  return path != NULL ? path : "";
}

/* ---- refusals ---- */

static void module_refused(const char *spec, hap_status status, const char *const said[3])
{
  hap_device *device = (hap_device *)test_folder; /* must be overwritten */
  hap_detail detail = {"of before"};
  hap_status got = hap_device_open(spec, &device, &detail);
  bool good = got == status && device == NULL;
  for (int i = 0; i < 3 && said[i] != NULL; ++i) {
    good = good && strstr(detail.text, said[i]) != NULL;
  }
  CHECK_SAY(good, "%.100s: %s, \"%s\"", spec, hap_status_name(got), detail.text);
  CHECK(hap_device_open(spec, &device, NULL) == status && device == NULL);
}

TEST(paths_are_whole_and_not_searched_for)
{
  static const char *const specs[] = {"module",           "module:",       "module:,limit=1",
                                      "module:a.so",      "module:./a.so", "module:../x/a.so",
                                      "module:libc.so.6", "module: /a.so", "module:~/a.so"};
  const char *const said[3] = {"whole path", "module:/PATH/FILE.so", NULL};
  char here[512];
  REQUIRE(getcwd(here, sizeof here) != NULL && chdir(test_folder) == 0);
  file_write_bytes("a.so", "x", 1);
  setenv("LD_LIBRARY_PATH", test_folder, 1);
  for (size_t i = 0; i < sizeof specs / sizeof specs[0]; ++i) {
    module_refused(specs[i], HAP_ERROR_ARGUMENT, said);
  }
  unsetenv("LD_LIBRARY_PATH");
  remove("a.so");
  CHECK(chdir(here) == 0);
}

TEST(what_is_no_module_is_refused)
{
  const char *const missing[3] = {"/no/such/libfoo.so", "cannot be opened", "No such file"};
  const char *const empty[3] = {"empty.so", "not a shared object", NULL};
  const char *const text[3] = {"text.so", "not a shared object", NULL};
  const char *const kind[3] = {"not a file but a folder", NULL};
  const char *const symbol[3] = {"hapode-test-symbolless.so", "no device module",
                                 "hapode_device_module"};
  const char *const unresolved[3] = {"cannot be loaded", "hapode_test_nobody_has_this", NULL};
  const char *const cut[3] = {"cut.so", "cut off", NULL};
  module_refused("module:/no/such/libfoo.so,limit=1", HAP_ERROR_NOT_FOUND, missing);
  file_write_bytes(folder_path("empty.so"), "", 0);
  module_refused(spec_of(folder_path("empty.so"), ""), HAP_ERROR_FORMAT, empty);
  file_write_bytes(folder_path("text.so"), "INPUT(libfoo.so)\n", 17);
  module_refused(spec_of(folder_path("text.so"), ""), HAP_ERROR_FORMAT, text);
  module_refused(spec_of(test_folder, ""), HAP_ERROR_IO, kind);
  REQUIRE(mkfifo(folder_path("pipe.so"), 0600) == 0);
  module_refused(spec_of(folder_path("pipe.so"), ""), HAP_ERROR_IO, kind); /* and does not wait */
  module_refused("module:/dev/null", HAP_ERROR_IO, kind);
  module_refused(spec_of(module_of("HAPODE_SYMBOLLESS"), ""), HAP_ERROR_FORMAT, symbol);
  module_refused(spec_of(module_of("HAPODE_UNRESOLVED"), ""), HAP_ERROR_IO, unresolved);
  char bytes[2000];
  FILE *file = fopen(module_of("HAPODE_TABLES"), "r");
  REQUIRE(file != NULL && fread(bytes, 1, sizeof bytes, file) == sizeof bytes);
  fclose(file);
  file_write_bytes(folder_path("cut.so"), bytes, sizeof bytes);
  module_refused(spec_of(folder_path("cut.so"), ""), HAP_ERROR_FORMAT, cut);
  CHECK(truncate(folder_path("cut.so"), 10) == 0);
  module_refused(spec_of(folder_path("cut.so"), ""), HAP_ERROR_FORMAT, cut);
}

TEST(other_architectures_are_named)
{
  static char bytes[2000000];
  const char *const machine[3] = {"another architecture", "(arm64, 64 bits)", "this program is"};
  const char *const bits[3] = {"another architecture", ", 32 bits)", NULL};
  const char *const unknown[3] = {"another architecture", "(another one", NULL};
  const char *const object[3] = {"no shared object", "-shared", NULL};
  FILE *file = fopen(module_of("HAPODE_TABLES"), "r");
  REQUIRE(file != NULL);
  size_t size = fread(bytes, 1, sizeof bytes, file);
  fclose(file);
  REQUIRE(size < sizeof bytes);
  const size_t at = offsetof(Elf64_Ehdr, e_machine);
  char kept[2] = {bytes[at], bytes[at + 1]};
#if defined(__x86_64__)
  bytes[at] = (char)EM_AARCH64;
  bytes[at + 1] = 0;
  file_write_bytes(folder_path("arm.so"), bytes, size);
  module_refused(spec_of(folder_path("arm.so"), ""), HAP_ERROR_UNSUPPORTED, machine);
#else
  (void)machine;
#endif
  bytes[at] = bytes[at + 1] = 0x7f;
  file_write_bytes(folder_path("odd.so"), bytes, size);
  module_refused(spec_of(folder_path("odd.so"), ""), HAP_ERROR_UNSUPPORTED, unknown);
  memcpy(bytes + at, kept, sizeof kept);
  bytes[offsetof(Elf64_Ehdr, e_type)] = ET_REL;
  file_write_bytes(folder_path("object.so"), bytes, size);
  module_refused(spec_of(folder_path("object.so"), ""), HAP_ERROR_FORMAT, object);
  bytes[EI_CLASS] = bytes[EI_CLASS] == ELFCLASS64 ? ELFCLASS32 : ELFCLASS64;
  if (sizeof(void *) == 8) {
    file_write_bytes(folder_path("small.so"), bytes, size);
    module_refused(spec_of(folder_path("small.so"), ""), HAP_ERROR_UNSUPPORTED, bits);
  }
}

TEST(wrong_tables_are_refused)
{
  static const struct {
    const char *wrong;
    hap_status status;
    const char *said[3];
  } cases[] = {
      {"abi_is_new", HAP_ERROR_UNSUPPORTED, {"device ABI 4", "has 3", "newer library"}},
      {"abi_is_old", HAP_ERROR_UNSUPPORTED, {"device ABI 2", "has 3", "build it anew"}},
      {"refuses", HAP_ERROR_UNSUPPORTED, {"refuses device ABI 3", "build it anew", NULL}},
      {"size_is_small", HAP_ERROR_UNSUPPORTED, {"40 bytes", "sizeof(hap_device_ops)", NULL}},
      {"no_name", HAP_ERROR_DEVICE, {"name is missing", NULL}},
      {"name_is_bad", HAP_ERROR_DEVICE, {"name", "[a-z0-9_-]", NULL}},
      {"name_is_long", HAP_ERROR_DEVICE, {"nnnnnnnnnnn", NULL}},
      {"pacing_is_unknown", HAP_ERROR_UNSUPPORTED, {"'tables'", "unknown pacing 9", NULL}},
      {"no_read", HAP_ERROR_DEVICE, {"'tables'", "operation 'read' is missing", NULL}},
      {"no_zero", HAP_ERROR_DEVICE, {"'tables'", "operation 'zero' is missing", NULL}},
      {"open_fails", HAP_ERROR_DEVICE, {"no board on port 7: is it switched on?", NULL}},
      {"open_fails_silently", HAP_ERROR_DEVICE, {"'tables' did not open", NULL}},
      {"no_self", HAP_ERROR_DEVICE, {"'tables'", "gave no self", NULL}},
      {"dof_4", HAP_ERROR_DEVICE, {"'tables'", "dof 4", NULL}},
      {"limit_is_negative", HAP_ERROR_DEVICE, {"'tables'", "negative or not finite", NULL}},
      {"damping_is_subnormal", HAP_ERROR_DEVICE, {"'tables'", "neither 0 nor from 1e-15", NULL}},
  };
  const char *path = module_of("HAPODE_TABLES");
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    setenv("HAPODE_TEST_TABLE", cases[i].wrong, 1);
    module_refused(spec_of(path, ""), cases[i].status, cases[i].said);
    const char *const where[3] = {path, NULL};
    module_refused(spec_of(path, ""), cases[i].status, where);
    CHECK(dlopen(path, RTLD_NOW | RTLD_NOLOAD) == NULL); /* nothing stays loaded */
  }
  unsetenv("HAPODE_TEST_TABLE");
}

TEST(long_paths_and_arguments_end_in_a_text)
{
  static char args[4000];
  const char *const said[3] = {"module /", NULL};
  memset(args, 'a', sizeof args - 1);
  args[0] = '/';
  module_refused(spec_of(args, ""), HAP_ERROR_IO, said); /* ENAMETOOLONG */
  const char *const limit[3] = {"skeleton: expected limit=N", NULL};
  args[0] = ',';
  module_refused(spec_of(module_of("HAPODE_SKELETON"), args), HAP_ERROR_ARGUMENT, limit);
}

/* ---- how long the code stays ---- */

static int *module_counter(void *library, const char *name)
{
  return dlsym(library, name);
}

static bool is_loaded(const char *path)
{
  void *library = dlopen(path, RTLD_NOW | RTLD_NOLOAD);
  if (library != NULL) {
    dlclose(library);
  }
  return library != NULL;
}

TEST(the_code_goes_with_the_last_device)
{
  const char *path = module_of("HAPODE_TABLES");
  hap_device *devices[3];
  for (int round = 0; round < 3; ++round) {
    for (int i = 0; i < 3; ++i) {
      REQUIRE(hap_device_open(spec_of(path, ""), &devices[i], NULL) == HAP_OK);
    }
    void *library = dlopen(path, RTLD_NOW | RTLD_NOLOAD);
    REQUIRE(library != NULL);
    CHECK(*module_counter(library, "tables_opened") == 3); /* one load of it */
    CHECK(*module_counter(library, "tables_zeroed") == 0);
    dlclose(library);
    CHECK(hapi_device_self(devices[0]) != hapi_device_self(devices[1]));
    CHECK(hapi_device_ops(devices[0]) == hapi_device_ops(devices[1]));
    hap_device *failed = NULL;
    CHECK(hap_device_open(spec_of(path, ",fail"), &failed, NULL) == HAP_ERROR_DEVICE);
    hap_device_close(devices[1]);
    hap_device_close(devices[0]);
    CHECK(is_loaded(path)); /* also after the failure */
    hap_device_close(devices[2]);
    CHECK(!is_loaded(path));
  }
}

/* The session still writes and zeroes when the application has closed the device too early. */
TEST(the_code_stays_while_a_session_has_the_device)
{
  hap_device *device = NULL;
  hap_pointer_id id;
  hap_pointer_def def;
  const char *path = module_of("HAPODE_TABLES");
  REQUIRE(hap_device_open(spec_of(path, ""), &device, NULL) == HAP_OK);
  stage *s = stage_new(HAP_DRIVE_LOCKSTEP);
  REQUIRE(stage_create(s) == HAP_OK);
  hap_pointer_def_init(&def, sizeof def);
  def.device = device;
  CHECK(hap_pointer_add(s->session, &def, &id) == HAP_OK);
  CHECK(hap_session_start(s->session) == HAP_OK);
  hap_device_close(device);
  CHECK(is_loaded(path));
  CHECK(hap_session_advance(s->session, 20) == HAP_OK);
  hap_emergency_zero();
  CHECK(hap_session_advance(s->session, 20) == HAP_FAULTED);
  CHECK(hap_session_stop(s->session) == HAP_OK && is_loaded(path));
  stage_end(s);
  CHECK(!is_loaded(path));
}

/* ---- threads ---- */

static atomic_int over;

static void *zero_all(void *unused)
{
  while (atomic_load(&over) == 0) {
    hap_emergency_zero();
  }
  return unused;
}

static void close_under_emergencies(int rounds, int pause_ms)
{
  pthread_t thread;
  atomic_store(&over, 0);
  REQUIRE(pthread_create(&thread, NULL, zero_all, NULL) == 0);
  for (int i = 0; i < rounds; ++i) {
    hap_device *device = NULL;
    CHECK(hap_device_open(spec_of(module_of("HAPODE_TABLES"), ""), &device, NULL) == HAP_OK);
    const hap_device_ops *ops = hapi_device_ops(device);
    void *self = hapi_device_self(device);
    CHECK(ops->start(self) == HAP_OK && hapi_emergency_add(ops, self));
    CHECK(hapi_device_claim(device));
    sleep_ms(pause_ms);
    if (i % 2 == 0) {
      hap_device_close(device);
    }
    (void)hapi_emergency_remove(ops, self);
    ops->stop(self);
    hapi_device_release(device);
    if (i % 2 != 0) {
      hap_device_close(device);
    }
    CHECK(!is_loaded(module_of("HAPODE_TABLES")));
    sleep_ms(6 * pause_ms); /* else the next load is in its place */
  }
  atomic_store(&over, 1);
  pthread_join(thread, NULL);
}

TEST(emergencies_do_not_meet_code_that_is_gone)
{
  close_under_emergencies(300, 0);
  setenv("HAPODE_TEST_TABLE", "zero_is_slow", 1); /* the other thread is in it for sure */
  close_under_emergencies(6, 5);
  unsetenv("HAPODE_TEST_TABLE");
}

static void *open_often(void *failures)
{
  for (int i = 0; i < 100; ++i) {
    hap_device *device = NULL;
    hap_detail detail;
    char spec[600];
    bool good = i % 3 != 2;
    snprintf(spec, sizeof spec, "module:%s%s", module_of("HAPODE_TABLES"), good ? "" : ",fail");
    hap_status status = hap_device_open(spec, &device, &detail);
    if ((status == HAP_OK) != good || (!good && strstr(detail.text, "port 7") == NULL)) {
      atomic_fetch_add((atomic_int *)failures, 1);
    }
    hap_device_close(device);
  }
  return NULL;
}

TEST(threads_may_load_at_the_same_time)
{
  pthread_t threads[4];
  atomic_int failures;
  atomic_init(&failures, 0);
  hap_device *kept = NULL;
#if TAP_THREAD_SANITIZER
  /* It does not know the locks of the system's loader, by which one load comes behind another
   * one. */
  CHECK(hap_device_open(spec_of(module_of("HAPODE_TABLES"), ""), &kept, NULL) == HAP_OK);
#endif
  for (int i = 0; i < 4; ++i) {
    REQUIRE(pthread_create(&threads[i], NULL, open_often, &failures) == 0);
  }
  for (int i = 0; i < 4; ++i) {
    pthread_join(threads[i], NULL);
  }
  hap_device_close(kept);
  CHECK(atomic_load(&failures) == 0);
  CHECK(!is_loaded(module_of("HAPODE_TABLES")));
}

/* ---- memory ---- */

static bool work_open(void)
{
  hap_device *device = NULL;
  hap_detail detail = {""};
  hap_status status = hap_device_open(spec_of(module_of("HAPODE_TABLES"), ""), &device, &detail);
  CHECK(status == HAP_OK || (status == HAP_ERROR_MEMORY && device == NULL));
  CHECK(status == HAP_OK || strstr(detail.text, "memory") != NULL);
  hap_device_close(device);
  CHECK(!is_loaded(module_of("HAPODE_TABLES")));
  return status == HAP_OK;
}

TEST(failed_allocations_leave_nothing_loaded)
{
  REQUIRE(heap_install());
  fail_each(work_open, false);
  CHECK(hap_hooks_set(NULL) == HAP_OK);
}

/* ---- a session with a device that does all wrong ---- */

static hap_fault fault_after(const char *wrong, int ticks)
{
  stage s;
  hap_device *device = NULL;
  hap_pointer_id id;
  hap_pointer_def def;
  hap_pointer_state state;
  char args[100];
  snprintf(args, sizeof args, ",break=%s", wrong);
  stage_init(&s, HAP_DRIVE_LOCKSTEP);
  hap_fault fault = HAP_FAULT_NONE;
  bool good = hap_device_open(spec_of(module_of("HAPODE_BROKEN"), args), &device, NULL) == HAP_OK &&
              stage_create(&s) == HAP_OK;
  CHECK(good);
  hap_pointer_def_init(&def, sizeof def);
  def.device = device;
  def.pose_world_device.position[0] = -0.06; /* in and out of the cube */
  if (good && hap_pointer_add(s.session, &def, &id) == HAP_OK &&
      hap_session_start(s.session) == HAP_OK) {
    for (int i = 0; i < ticks; ++i) {
      CHECK(hap_session_advance(s.session, 1) >= HAP_OK);
      CHECK(hap_pointer_get(s.session, id, &state, sizeof state) == HAP_OK);
      CHECK(hapi_finite(state.device.position, 3) && hapi_finite(state.wrench.force, 3));
      CHECK(hapi_finite(state.proxy.position, 3) && hapi_finite(state.twist.linear, 3));
      CHECK(hapi_v3_norm(state.wrench.force) <= 20.0 * (1.0 + 1e-9));
      CHECK(hapi_finite(dBodyGetLinearVel(s.cube), 3));
    }
    fault = (hap_fault)stats_of(&s).faults.fault;
  }
  stage_end(&s);
  hap_device_close(device);
  return fault;
}

TEST(a_session_survives_what_a_device_does_wrong)
{
  static const struct {
    const char *wrong;
    hap_fault fault;
  } cases[] = {{"none", HAP_FAULT_NONE},
               {"odd_status", HAP_FAULT_DEVICE_READ},
               {"odd_write_status", HAP_FAULT_DEVICE_WRITE},
               {"pose_is_nan", HAP_FAULT_DEVICE_POSE},
               {"pose_is_far", HAP_FAULT_DEVICE_POSE},
               {"twist_is_nan", HAP_FAULT_DEVICE_POSE},
               {"quaternion_is_not_unit", HAP_FAULT_NONE},
               {"pose_is_not_filled_in", HAP_FAULT_NONE},
               {"buttons_are_not_filled_in", HAP_FAULT_NONE},
               {"jumps", HAP_FAULT_NONE},
               {"twist_in_degrees", HAP_FAULT_NONE},
               {"gives_double", HAP_FAULT_NONE},
               {"reached_is_not_filled_in", HAP_FAULT_NONE},
               {"reached_is_a_lie", HAP_FAULT_NONE},
               {"refuses_all_force", HAP_FAULT_DEVICE_WRITE},
               {"read_fails", HAP_FAULT_DEVICE_READ},
               {"zero_does_nothing", HAP_FAULT_NONE},
               {"stop_keeps_force", HAP_FAULT_NONE}};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    hap_fault fault = fault_after(cases[i].wrong, 400);
    CHECK(fault == cases[i].fault);
    if (fault != cases[i].fault) {
      printf("# %s: fault %d\n", cases[i].wrong, (int)fault);
    }
  }
}

SET_UP
{
  return getenv("HAPODE_TABLES") != NULL ? folder_make() : tap_bail_out("HAPODE_TABLES is not set");
}
