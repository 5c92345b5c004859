/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_summary.h"

#include <inttypes.h>

void run_summary_devices(const rig_options *options, char *out, size_t size)
{
  size_t used = 0;
  snprintf(out, size, "virtual");
  for (size_t i = 0; i < options->device_count && used < size; ++i) {
    used +=
        (size_t)snprintf(out + used, size - used, "%s%s", i > 0 ? " + " : "", options->devices[i]);
  }
}

double run_summary_physics_hz(const run_options *options)
{
  const hap_session_def *def = &options->rig.def;
  return def->model == HAP_MODEL_SINGLE ? def->haptic_hz : def->physics_hz;
}

static void count_print(FILE *out, const char *key, uint64_t value)
{
  fprintf(out, "%s: %" PRIu64 "\n", key, value);
}

static void number_print(FILE *out, const char *key, double value)
{
  fprintf(out, "%s: %.6g\n", key, value);
}

static const char *fault_name(hap_fault fault)
{
  switch (fault) {
    case HAP_FAULT_NONE:
      return "none";
    case HAP_FAULT_DEVICE_READ:
      return "device_read";
    case HAP_FAULT_DEVICE_POSE:
      return "device_pose";
    case HAP_FAULT_FORCE:
      return "force";
    case HAP_FAULT_LOCAL_STATE:
      return "local_state";
    case HAP_FAULT_DEVICE_WRITE:
      return "device_write";
    case HAP_FAULT_WORLD:
      return "world";
    case HAP_FAULT_DEVICE_INPUT:
      return "device_input";
    case HAP_FAULT_EMERGENCY:
      return "emergency";
    case HAP_FAULT_LATE:
      return "late";
    case HAP_FAULT_OSCILLATION:
      return "oscillation";
    case HAP_FAULT_BLOCKED:
      return "blocked";
  }
  return "unknown";
}

static void print_setup(const run_options *options, FILE *out)
{
  char devices[4096];
  run_summary_devices(&options->rig, devices, sizeof devices);
  fprintf(out, "scene: %s\n", options->rig.scene);
  fprintf(out, "model: %s\n", hap_model_name(options->rig.def.model));
  fprintf(out, "device: %s\n", devices);
  number_print(out, "physics_hz", run_summary_physics_hz(options));
  number_print(out, "haptic_hz", options->rig.def.haptic_hz);
}

static void print_more(const hap_stats *stats, FILE *out)
{
  fprintf(out, "fault: %s\n", fault_name((hap_fault)stats->faults.fault));
  fprintf(out, "realtime: %s\n", stats->loop.realtime != 0 ? "yes" : "no");
  count_print(out, "physics_steps", stats->physics.steps);
  count_print(out, "physics_missed", stats->physics.missed);
  count_print(out, "probe_steps", stats->probes.steps);
  count_print(out, "probes_reused", stats->probes.reused);
  number_print(out, "tick_us_max", stats->loop.tick_us_max);
  number_print(out, "model_age_s_max", stats->loop.model_age_max_s);
  count_print(out, "saturated_ticks", stats->faults.saturated_ticks);
  count_print(out, "capacity_dropped", stats->model.capacity_dropped);
  count_print(out, "trace_dropped", stats->loop.trace_dropped);
  count_print(out, "stale_times", stats->faults.stale_times);
  count_print(out, "slewed_ticks", stats->faults.slewed_ticks);
  count_print(out, "energy_ticks", stats->faults.energy_ticks);
  count_print(out, "derated_ticks", stats->safety.derated_ticks);
  count_print(out, "oscillation_ticks", stats->safety.oscillation_ticks);
  count_print(out, "unsolved_ticks", stats->room.unsolved_ticks);
  count_print(out, "range_most", stats->room.range_most);
  count_print(out, "range_cut", stats->room.range_cut);
  number_print(out, "update_ns", stats->room.update_ns);
  count_print(out, "locks", stats->edits.locks);
}

void run_summary_print(const run_options *options, const hap_stats *stats,
                       const hap_effect_info effects[HAP_EFFECTS], FILE *out)
{
  print_setup(options, out);
  count_print(out, "ticks", stats->loop.ticks);
  count_print(out, "missed_ticks", stats->loop.missed_ticks);
  number_print(out, "tick_us_p50", stats->loop.tick_us_p50);
  number_print(out, "tick_us_p99", stats->loop.tick_us_p99);
  number_print(out, "physics_ms_mean", stats->physics.ms_mean);
  number_print(out, "physics_duty", stats->physics.duty);
  number_print(out, "haptic_duty", stats->loop.duty);
  number_print(out, "peak_force_n", stats->hand.peak_force_n);
  number_print(out, "impulse_ns", stats->hand.impulse_ns);
  count_print(out, "contact_ticks", stats->loop.contact_ticks);
  count_print(out, "neighbours_max", stats->model.neighbours_max);
  number_print(out, "momentum_ratio", stats->hand.momentum_ratio);
  fputs("effects: ", out);
  run_effects_print(effects, out);
  fprintf(out, "\ntrace_hash: %016" PRIx64 "\n", stats->loop.trace_hash);
  count_print(out, "faults", stats->faults.count);
  print_more(stats, out);
  if (options->rig.expert.lookback > 0.0) {
    number_print(out, "force_error", stats->error.force_error);
    number_print(out, "force_error_n", stats->error.force_error_n);
    count_print(out, "lookbacks", stats->error.lookbacks);
    count_print(out, "lookbacks_spoilt", stats->error.spoilt);
  }
}

static void print_side(const char *name, const hap_accuracy_side *side, FILE *out)
{
  fprintf(out, "accuracy_%s: %g (%s)\n", name, side->accuracy,
          hap_accuracy_reason_text((hap_accuracy_reason)side->reason));
  if (side->share > 0.0) {
    fprintf(out, "load_%s: %g of %g, turned %" PRIu64 " times\n", name, side->load, side->share,
            side->turns);
  }
}

/* By the names of hap_session_def, as they could be given one by one; shapes is of the effect
 * shape. */
static void print_settings(const hap_accuracy_info *info, FILE *out)
{
  static const char *const probes[] = {[HAP_PROBE_SHARED] = "shared",
                                       [HAP_PROBE_PAPER] = "paper",
                                       [HAP_PROBE_OPERATING] = "operating"};
  const char *probe =
      info->probe < sizeof probes / sizeof probes[0] ? probes[info->probe] : "unknown";
  fprintf(out, "accuracy_settings: contact_hz=%g,max_sweeps=%d,range_hops=%d,shapes=%u,probe=%s,",
          info->contact_hz, info->max_sweeps, info->range_hops, info->shapes, probe);
  fprintf(out, "iterations=%d,reuse=%g,row_updates=%u\n", info->iterations, info->reuse,
          info->row_updates);
}

void run_summary_accuracy(const hap_accuracy_info *info, FILE *out)
{
  print_side("tick", &info->tick, out);
  print_side("physics", &info->physics, out);
  print_settings(info, out);
}
