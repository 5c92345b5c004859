/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_far.h"

#include <inttypes.h>
#include <string.h>

#include <hapode/link_dds.h>
#include <hapode/remote.h>

hap_status run_far_open(const run_options *options, const rig *r, run_far *out, hap_detail *detail)
{
  const run_far_options *o = &options->far;
  hap_link_dds_def def;
  hap_detail why = {""};
  memset(out, 0, sizeof *out);
  if (o->serve == NULL && o->connect == NULL) {
    return HAP_OK;
  }
  bool serves = o->serve != NULL;
  hap_link *link = NULL;
  hap_link_dds_def_init(&def, sizeof def);
  def.world = serves ? o->serve : o->connect;
  def.name = o->name != NULL ? o->name : def.name;
  def.certificates = o->certificates;
  def.insecure = o->insecure ? 1 : 0;
  def.interface_name = o->interface_name;
  def.peers = o->peers;
  def.domain = o->domain >= 0 ? (uint32_t)o->domain : def.domain;
  hap_status status =
      serves ? hap_link_dds_serve(&def, &link, &why) : hap_link_dds_connect(&def, &link, &why);
  if (status >= HAP_OK) {
    status = serves ? hap_session_serve(r->session, link) : hap_session_connect(r->session, link);
    if (status < HAP_OK) {
      (void)hap_session_detail(r->session, &why);
      hap_link_close(link);
    }
  }
  if (status < HAP_OK) {
    snprintf(detail->text, sizeof detail->text, "%s: %.480s", serves ? "--serve" : "--connect",
             why.text);
    return status;
  }
  *out =
      (run_far){.session = r->session, .link = link, .serves = serves, .shown = options->far.shown};
  return HAP_OK;
}

hap_status run_far_look(run_far *far, hap_detail *detail)
{
  hap_remote_state state;
  hap_detail why = {""};
  if (far->link == NULL ||
      hap_session_remote_state(far->session, &state, sizeof state, &why) < HAP_OK) {
    return HAP_OK;
  }
  bool joined = state.joined != 0;
  if (joined != far->joined) {
    fprintf(stderr, "hapode-run: the %s has %s\n", far->serves ? "hand" : "world",
            joined ? "joined" : "left");
    far->joined = joined;
  }
  if (!far->serves && state.turned_away > far->turned_away) {
    *detail = why;
    return HAP_ERROR_STATE;
  }
  if (!far->serves && far->shown && joined && state.drawn == 0) {
    snprintf(detail->text, sizeof detail->text, "--connect: give the server's --scene; %.450s",
             why.text);
    return HAP_ERROR_ARGUMENT;
  }
  far->turned_away = state.turned_away;
  return HAP_OK;
}

void run_far_print(const run_far *far, FILE *out)
{
  hap_remote_state s;
  hap_detail why = {""};
  if (far->link == NULL || hap_session_remote_state(far->session, &s, sizeof s, &why) < HAP_OK) {
    return;
  }
  fprintf(out, "remote: %s\n", far->serves ? "serves" : "connected");
  fprintf(out, "remote_joins: %" PRIu64 "\n", s.joins);
  fprintf(out, "remote_look_ahead_s: %.6g\n", s.look_ahead);
  fprintf(out, "remote_round_trip_s: %.6g\n", s.round_trip_s);
  fprintf(out, "remote_clock_ahead_s: %.9g\n", s.clock_ahead_s);
  fprintf(out, "remote_bytes_sent: %" PRIu64 "\n", s.figures.sent_bytes);
  fprintf(out, "remote_bytes_received: %" PRIu64 "\n", s.figures.received_bytes);
  fprintf(out, "remote_refused: %" PRIu64 "\n", s.refused);
  fprintf(out, "remote_failed: %" PRIu64 "\n", s.failed);
  fprintf(out, "remote_bounded: %" PRIu64 "\n", s.bounded);
  fprintf(out, "remote_turned_away: %" PRIu64 "\n", s.turned_away);
  fprintf(out, "remote_drawn: %" PRIu64 "\n", s.drawn);
}

void run_far_close(run_far *far)
{
  hap_link_close(far->link);
  memset(far, 0, sizeof *far);
}
