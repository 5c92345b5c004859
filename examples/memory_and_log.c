/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>

/* What the library has of memory. Any thread may ask, and so the counters are atomic. */
typedef struct account {
  atomic_int asked;
  atomic_int held;
  int lines; /* of the log */
} account;

static void *account_allocate(size_t size, void *user)
{
  account *a = user;
  void *memory = malloc(size);
  atomic_fetch_add(&a->asked, 1);
  atomic_fetch_add(&a->held, memory != NULL);
  return memory;
}

static void account_release(void *memory, void *user)
{
  atomic_fetch_sub(&((account *)user)->held, memory != NULL);
  free(memory);
}

static void account_log(hap_log_level level, const char *text, void *user)
{
  if (((account *)user)->lines++ == 0) { /* in drive LOCKSTEP there is one thread */
    printf("%s: %s\n", level == HAP_LOG_ERROR ? "error" : "note", text);
  }
}

/* A mistake for the log: a callback that destroys its own session. */
static void step_mistake(void *user, double step_s)
{
  (void)step_s;
  hap_session_destroy(*(hap_session **)user);
}

int main(void)
{
  account a = {0};
  hap_hooks hooks;
  hap_detail why = {""};
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_pointer_def hand;
  const char *device;
  hap_hooks_init(&hooks, sizeof hooks); /* what stays NULL keeps its default */
  hooks.allocate = account_allocate, hooks.release = account_release;
  hooks.log = account_log, hooks.user = &a;
  hap_session_def_init(&def, sizeof def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  hap_pointer_def_init(&hand, sizeof hand);
  if (hap_hooks_set(&hooks) < HAP_OK || /* before any other function of the library */
      hap_scene_load("slide", &scene, &why) < HAP_OK ||
      hap_scene_hand(scene, 0, &hand, &device) < HAP_OK ||
      hap_device_open(device, &hand.device, &why) < HAP_OK ||
      hap_scene_set_steps(scene, NULL, step_mistake, &session) < HAP_OK ||
      hap_scene_session(scene, &def, &session, &why) < HAP_OK ||
      hap_pointer_add(session, &hand, &(hap_pointer_id){0}) < HAP_OK ||
      hap_session_start(session) < HAP_OK || hap_session_advance(session, 500) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  int before = atomic_load(&a.asked);
  if (hap_session_advance(session, 500) < HAP_OK) {
    return 1;
  }
  printf("%d blocks asked for before, %d in 500 ticks\n", before, atomic_load(&a.asked) - before);
  hap_session_destroy(session);
  hap_device_close(hand.device);
  hap_status status = hap_scene_destroy(scene);
  printf("%d lines logged, %d blocks left\n", a.lines, atomic_load(&a.held));
  return status < HAP_OK;
}
