/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/remote_run.h"

#include <string.h>

#include <hapode/link.h>

#define BODIES_MOST 64 /* that the loop may have: messages are as large as what there is room for */
#define CONTACTS_MOST 1024
#define SHIFT_X (-1e-6) /* m, of the first start of hapode-bench accuracy */
#define SHIFT_Y 5e-8

const accuracy_scene *remote_scene(const char *name)
{
  const accuracy_scene *which = NULL;
  for (size_t i = 0; (which = accuracy_scene_at(i)) != NULL && strcmp(which->name, name) != 0;
       ++i) {
  }
  return which;
}

/* The scene with a hand that waits; what def says of the session stays, and it is told how long the
 * run is. */
static hap_status scene_run(bench *b, const accuracy_scene *which, double seconds,
                            accuracy_run_def *def, accuracy_motion *out)
{
  char hands[SCENE_POINTERS_MAX][ACCURACY_SPEC_MAX];
  accuracy_run_def run = *def;
  scene_parameters parameters = accuracy_parameters(which);
  parameters.shift[0] = SHIFT_X;
  parameters.shift[1] = SHIFT_Y;
  run.parameters = &parameters;
  def->seconds = run.seconds =
      REMOTE_LATE_S + (seconds > 0.0 ? seconds : accuracy_seconds(which, true));
  for (int i = 0; i < parameters.pointers; ++i) {
    if (!accuracy_hand(parameters.hands[i], 1.0, hands[i], sizeof hands[i] - 32)) {
      return bench_fail(b, HAP_ERROR_FORMAT, "%s: the hand is not understood", which->name);
    }
    size_t length = strlen(hands[i]);
    (void)snprintf(hands[i] + length, sizeof hands[i] - length, ",start=%g", -REMOTE_LATE_S);
    run.hands[i] = hands[i];
  }
  run.session.physics_hz = REMOTE_PHYSICS_HZ;
  run.session.max_bodies = BODIES_MOST;
  run.session.max_contacts = CONTACTS_MOST;
  return accuracy_run(b, &run, out);
}

hap_status remote_reference(bench *b, const accuracy_scene *which, double seconds,
                            accuracy_motion *out)
{
  accuracy_run_def def;
  const scene_parameters parameters = accuracy_parameters(which);
  accuracy_run_def_init(&def);
  def.session.model = HAP_MODEL_SINGLE;
  def.iterations = accuracy_reference_iterations(&parameters);
  return scene_run(b, which, seconds, &def, out);
}

hap_status remote_beside(bench *b, const accuracy_scene *which, accuracy_motion *out)
{
  accuracy_run_def def;
  accuracy_run_def_init(&def);
  return scene_run(b, which, 0.0, &def, out);
}

bool remote_is_early(const accuracy_motion *reference)
{
  const size_t late = (size_t)(REMOTE_LATE_S * ACCURACY_HAPTIC_HZ);
  bool touches = false;
  for (size_t i = 0; i < late && i < reference->count; ++i) {
    for (size_t k = 0; k < SCENE_POINTERS_MAX; ++k) {
      const double *f = reference->frames[i].force[k];
      touches = touches || f[0] != 0.0 || f[1] != 0.0 || f[2] != 0.0;
    }
  }
  return touches;
}

/* ---- apart ---- */

static hap_status links_open(remote_run *run, hap_detail *detail)
{
  hap_link_path_def path;
  hap_link_path_def_init(&path, sizeof path);
  path.delay = run->way.delay_s;
  path.jitter = run->way.jitter_s;
  path.loss = run->way.loss;
  path.duplicate = run->way.duplicate;
  path.seed = run->way.seed;
  hap_link_path_def down = path;
  down.seed += 1000;
  hap_status status = hap_link_local_serve(&run->server, detail);
  return status < HAP_OK
             ? status
             : hap_link_local_connect(run->server, "hand", &path, &down, &run->client, detail);
}

/* Those of the library, unless others are asked for. */
static hap_status codecs_open(remote_run *run, const hapi_exchange *exchange, hapi_codec out[2])
{
  if (run->codecs != NULL) {
    return run->codecs->open(run->codecs->user, exchange, out);
  }
  const hapi_capacity *capacity = hapi_exchange_capacity(exchange);
  hap_status status = hapi_wire_codec_init(&run->wire[0], capacity, true, &out[0]);
  return status < HAP_OK ? status : hapi_wire_codec_init(&run->wire[1], capacity, false, &out[1]);
}

static void codecs_close(remote_run *run)
{
  if (run->codecs != NULL) {
    run->codecs->close(run->codecs->user);
  }
  hapi_wire_codec_finish(&run->wire[0]);
  hapi_wire_codec_finish(&run->wire[1]);
}

static hap_status apart_join(void *user, hap_session *session)
{
  remote_run *run = user;
  hapi_codec codecs[2];
  hap_status status = codecs_open(run, session->exchange, codecs);
  if (status < HAP_OK) {
    return hapi_session_fail(session, status, "no codecs");
  }
  run->far = (hapi_far){.world = {.end = {.link = run->server, .codec = codecs[0]}},
                        .loop = {.end = {.link = run->client, .codec = codecs[1]}}};
  return hapi_session_set_far(session, HAPI_SIDE_BOTH, &run->far);
}

static void figures_take(remote_run *run, double seconds, const accuracy_motion *motion)
{
  hap_link_figures down;
  hap_link_figures up;
  if (hap_link_get_figures(run->server, &down, sizeof down) == HAP_OK &&
      hap_link_get_figures(run->client, &up, sizeof up) == HAP_OK) {
    run->bytes_down = (double)down.sent_bytes / seconds;
    run->bytes_up = (double)up.sent_bytes / seconds;
  }
  run->age_s = motion->stats.loop.model_age_max_s;
  run->refused = run->far.world.end.refused + run->far.loop.end.refused;
  run->failed = run->far.world.end.failed + run->far.loop.end.failed;
  run->bounded = run->far.world.bounded;
  run->old = run->far.world.old + run->far.loop.old;
  run->detail = run->far.world.end.detail.text[0] != '\0' ? run->far.world.end.detail
                                                          : run->far.loop.end.detail;
}

double remote_look_ahead(const remote_run *run)
{
  return run->look_ahead_s >= 0.0 ? run->look_ahead_s
                                  : 2.0 * (run->way.delay_s + run->way.jitter_s) + REMOTE_MARGIN_S;
}

hap_status remote_apart(bench *b, remote_run *run, accuracy_motion *out)
{
  accuracy_run_def def;
  accuracy_run_def_init(&def);
  def.expert.look_ahead = remote_look_ahead(run);
  def.join = apart_join;
  def.join_user = run;
  hap_status status = links_open(run, &b->detail);
  if (status >= HAP_OK) {
    status = scene_run(b, run->scene, run->seconds, &def, out);
  }
  if (status >= HAP_OK) {
    figures_take(run, def.seconds, out);
  }
  hapi_far_finish(&run->far);
  codecs_close(run);
  hap_link_close(run->client);
  hap_link_close(run->server);
  run->client = run->server = NULL;
  return status;
}
