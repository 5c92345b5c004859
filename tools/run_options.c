/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_options.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#define LATENCY_TICKS_MAX 20000.0
#define LOOKBACK_SHARE 0.1 /* for --force-error */
#define LOOK_AHEAD_S 0.1   /* of --serve */

typedef struct option option;

/* Takes the value; a text that says what is allowed stays in detail on failure. */
typedef hap_status (*take_fn)(run_options *options, const option *self, const char *value,
                              hap_detail *detail);

struct option {
  const char *name;
  const char *value; /* as the help calls it; NULL: takes none */
  const char *help;
  take_fn take;
  size_t offset; /* of the member, for takers of plain numbers and texts */
  double low;
  double high;
};

static hap_status options_fail(hap_detail *detail, const char *format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(detail->text, sizeof detail->text, format, arguments);
  va_end(arguments);
  return HAP_ERROR_ARGUMENT;
}

static hap_status take_number(run_options *options, const option *self, const char *value,
                              hap_detail *detail)
{
  char *end = NULL;
  double number = strtod(value, &end);
  if (end == value || *end != '\0' || !(number >= self->low && number <= self->high)) {
    return options_fail(detail, "\"%.60s\" is not a number from %g to %g", value, self->low,
                        self->high);
  }
  *(double *)((void *)((char *)options + self->offset)) = number;
  return HAP_OK;
}

static hap_status take_count(run_options *options, const option *self, const char *value,
                             hap_detail *detail)
{
  char *end = NULL;
  double number = strtod(value, &end);
  if (end == value || *end != '\0' || !(number >= self->low && number <= self->high) ||
      number != floor(number)) {
    return options_fail(detail, "\"%.60s\" is not a whole number from %g to %g", value, self->low,
                        self->high);
  }
  *(int32_t *)((void *)((char *)options + self->offset)) = (int32_t)number;
  return HAP_OK;
}

static hap_status take_iterations(run_options *options, const option *self, const char *value,
                                  hap_detail *detail)
{
  options->rig.expert.iterations = 0; /* as many as the world has */
  return strcmp(value, "world") == 0 ? HAP_OK : take_count(options, self, value, detail);
}

static hap_status take_range(run_options *options, const option *self, const char *value,
                             hap_detail *detail)
{
  options->rig.expert.range_hops = HAP_RANGE_ALL;
  return strcmp(value, "all") == 0 ? HAP_OK : take_count(options, self, value, detail);
}

static hap_status take_text(run_options *options, const option *self, const char *value,
                            hap_detail *detail)
{
  if (*value == '\0') {
    return options_fail(detail, "an empty %s", self->value);
  }
  *(const char **)((char *)options + self->offset) = value;
  return HAP_OK;
}

static hap_status take_model(run_options *options, const option *self, const char *value,
                             hap_detail *detail)
{
  (void)self;
  return rig_find_model(value, &options->rig.def.model, detail);
}

static hap_status take_device(run_options *options, const option *self, const char *value,
                              hap_detail *detail)
{
  (void)self;
  if (options->rig.device_count == RIG_POINTERS_MAX) {
    return options_fail(detail, "more than %d devices", RIG_POINTERS_MAX);
  }
  options->rig.devices[options->rig.device_count++] = value;
  return HAP_OK;
}

static hap_status take_identity(run_options *options, const option *self, const char *value,
                                hap_detail *detail)
{
  size_t devices = options->rig.device_count;
  if (devices == 0) {
    return options_fail(detail, "it belongs to a --device before it");
  }
  if (options->rig.identities[devices - 1] != NULL) {
    return options_fail(detail, "the device \"%.60s\" has one already",
                        options->rig.devices[devices - 1]);
  }
  (void)self;
  options->rig.identities[devices - 1] = value;
  return HAP_OK;
}

/* Numbers with a separator between; false: there are others, or fewer. */
static bool numbers_read(const char *value, char separator, size_t count, double *out)
{
  for (size_t i = 0; i < count; ++i) {
    char *end = NULL;
    out[i] = strtod(value, &end);
    if (end == value || !isfinite(out[i]) || *end != (i + 1 < count ? separator : '\0')) {
      return false;
    }
    value = end + 1;
  }
  return true;
}

static hap_status take_camera(run_options *options, const option *self, const char *value,
                              hap_detail *detail)
{
  double *c = options->shot.camera;
  (void)self;
  options->shot.camera_given = numbers_read(value, ',', 6, c);
  if (options->shot.camera_given && hypot(hypot(c[0] - c[3], c[1] - c[4]), c[2] - c[5]) > 1e-6) {
    return HAP_OK;
  }
  return options_fail(detail, "\"%.60s\" is not x,y,z,tx,ty,tz: eye and what it looks at, m, apart",
                      value);
}

static hap_status take_pixels(run_options *options, const option *self, const char *value,
                              hap_detail *detail)
{
  double size[2];
  bool good = numbers_read(value, 'x', 2, size);
  for (int i = 0; i < 2 && good; ++i) {
    good = size[i] >= self->low && size[i] <= self->high && size[i] == floor(size[i]);
    options->shot.size[i] = good ? (int)size[i] : 0;
  }
  return good ? HAP_OK
              : options_fail(detail, "\"%.60s\" is not WIDTHxHEIGHT, each %g to %g", value,
                             self->low, self->high);
}

static hap_status take_keys(run_options *options, const option *self, const char *value,
                            hap_detail *detail)
{
  (void)self;
  options->window.keys_given = true;
  return run_keys_parse(value, &options->window.keys, detail);
}

static hap_status take_effects(run_options *options, const option *self, const char *value,
                               hap_detail *detail)
{
  (void)self;
  return run_effects_parse(value, &options->effects, detail);
}

/* A name of hap_coupling, with :K where there is a spring. */
static hap_status take_coupling(run_options *options, const option *self, const char *value,
                                hap_detail *detail)
{
  size_t length = strcspn(value, ":");
  const char *name = NULL;
  for (int i = 0; (name = hap_coupling_name((hap_coupling)i)) != NULL; ++i) {
    bool bare = value[length] == '\0';
    if (strlen(name) != length || memcmp(value, name, length) != 0 ||
        (i == HAP_COUPLING_DIRECT && !bare)) {
      continue;
    }
    options->rig.coupling = (hap_coupling)i;
    options->rig.coupling_stiffness = 0.0;
    options->coupling_given = true;
    return bare ? HAP_OK : take_number(options, self, value + length + 1, detail);
  }
  return options_fail(
      detail,
      "\"%.60s\" is not direct, proxy:K, auto:K, god-object:K or virtual:K; K in N/m, and may "
      "be left out",
      value);
}

static hap_status take_pose(run_options *options, const option *self, const char *value,
                            hap_detail *detail)
{
  (void)self;
  bool held = strcmp(value, "held") == 0;
  if (!held && strcmp(value, "interpolated") != 0) {
    return options_fail(detail, "\"%.60s\" is neither held nor interpolated", value);
  }
  options->rig.research.impulse_pose = held ? HAP_IMPULSE_HELD : HAP_IMPULSE_INTERPOLATED;
  return HAP_OK;
}

static hap_status take_probe(run_options *options, const option *self, const char *value,
                             hap_detail *detail)
{
  static const char *const names[] = {[HAP_PROBE_SHARED] = "shared",
                                      [HAP_PROBE_PAPER] = "paper",
                                      [HAP_PROBE_OPERATING] = "operating"};
  (void)self;
  for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
    if (strcmp(value, names[i]) == 0) {
      options->rig.research.probe = (hap_probe)i;
      return HAP_OK;
    }
  }
  return options_fail(detail, "\"%.60s\" is not shared, paper or operating", value);
}

static hap_status take_priority(run_options *options, const option *self, const char *value,
                                hap_detail *detail)
{
  char *end = NULL;
  long number = strtol(value, &end, 10);
  if (end == value || *end != '\0' || number < (long)self->low || number > (long)self->high) {
    return options_fail(detail, "\"%.60s\" is not a whole number from %g to %g", value, self->low,
                        self->high);
  }
  options->rig.def.rt_priority = (int32_t)number;
  return HAP_OK;
}

static hap_status take_flag(run_options *options, const option *self, const char *value,
                            hap_detail *detail)
{
  (void)value;
  (void)detail;
  *(bool *)((char *)options + self->offset) = true;
  return HAP_OK;
}

_Static_assert(sizeof(hap_drive) == sizeof(int) && sizeof(run_action) == sizeof(int), "int");

/* The option's low, into a member of the size of an int. */
static hap_status take_constant(run_options *options, const option *self, const char *value,
                                hap_detail *detail)
{
  const int constant = (int)self->low;
  (void)value;
  (void)detail;
  memcpy((char *)options + self->offset, &constant, sizeof constant);
  return HAP_OK;
}

static const option table[] = {
    {"--scene", "NAME[:N]",
     "scene, N: how many bodies where it takes that (default row10); or a file,\n"
     "MJCF or URDF: what is left out of it comes line by line on stderr",
     take_text, offsetof(run_options, rig.scene), 0, 0},
    {"--strict", NULL, "a file of which anything would be left out is refused", take_flag,
     offsetof(run_options, strict), 0, 0},
    {"--model", "NAME", "single, impulse, accelerance, contact (default)", take_model, 0, 0, 0},
    {"--device", "SPEC",
     "device of the next pointer, such as virtual or replay:hand.csv\n"
     "(default, and virtual alone: the scene's own simulated hand); further end\n"
     "effectors of it take the scene's further hands",
     take_device, 0, 0, 0},
    {"--identity", "FILE", "what --identify wrote, for the --device before it", take_identity, 0, 0,
     0},
    {"--identify", "FILE",
     "no session: moves the one --device, which nobody must hold, finds its\n"
     "mass, damping, friction, delay and quantum and writes them to FILE",
     take_text, offsetof(run_options, identify_path), 0, 0},
    {"--calibrate", "FILE",
     "no session: a person holds the grip of the one --device, a spidar, at its\n"
     "home, then moves it all over its workspace for --seconds (default 60) or\n"
     "until Enter; the model with what was found is written to FILE",
     take_text, offsetof(run_options, calibrate_path), 0, 0},
    {"--reconnect", NULL,
     "a device that was lost is started again until it answers; then the force\n"
     "comes back over 20 ms (default: a lost device ends the run)",
     take_flag, offsetof(run_options, reconnect), 0, 0},
    {"--check-device", "SPEC",
     "no session: holds the device against the contract of hapode/device_impl.h, with\n"
     "a small force; prints ok or not ok for each point; let go of the grip",
     take_text, offsetof(run_options, check.spec), 0, 0},
    {"--check-force", "N", "the largest force of the check (default 0.3), 0: none at all",
     take_number, offsetof(run_options, check.force), 0, CONFORM_FORCE_MAX},
    {"--check-limits", NULL,
     "also ask for more than the device can, and for what is no number: if it is\n"
     "wrong, it may give all its force for a moment",
     take_flag, offsetof(run_options, check.limits), 0, 0},
    {"--check-unplug", "S", "also ask a person to pull its plug, S seconds for each turn",
     take_number, offsetof(run_options, check.unplug_s), 0.001, 3600},
    {"--check-wait", "S", "seconds of warning before it is energised (default 5)", take_number,
     offsetof(run_options, check.wait_s), 0, 3600},
    {"--physics-hz", "F", "steps of the world a second, 1 to 1000 (default 60)", take_number,
     offsetof(run_options, rig.def.physics_hz), 1, 1000},
    {"--haptic-hz", "F", "ticks of the haptic loop a second, 100 to 20000 (default 1000)",
     take_number, offsetof(run_options, rig.def.haptic_hz), 100, 20000},
    {"--contact-hz", "F",
     "model contact: contact passes a second, 20 to 1000 (default: as --accuracy says,\n"
     "200 at 0.5)",
     take_number, offsetof(run_options, rig.expert.contact_hz), 20, 1000},
    {"--iterations", "N|world",
     "of QuickStep, 1 to 10000, or as many as the scene has whatever --accuracy says\n"
     "(default: these at 0.5)",
     take_iterations, offsetof(run_options, rig.expert.iterations), 1, 10000},
    {"--substeps", "N",
     "parts of a step of the world, 1 to 64, each with its own collision phase (default 1); model\n"
     "contact",
     take_count, offsetof(run_options, rig.expert.substeps), 1, 64},
    {"--look-ahead", "S",
     "bodies are looked for so many seconds beyond two steps of the world, and a model of it may\n"
     "be so much older, 0 to 1 (default 0)",
     take_number, offsetof(run_options, rig.expert.look_ahead), 0, 1},
    {"--sweeps", "N",
     "model contact: over all rows, in each solve of a tick, 2 to 10000; 2: no direct\n"
     "solve (default: until it is solved, or the tick has no more time)",
     take_count, offsetof(run_options, rig.expert.max_sweeps), 2, 10000},
    {"--range", "N|all",
     "model contact: bodies of the loop, so many contacts from the neighbours, 0 to\n"
     "1024, or all that hang together (default: all, from --accuracy 0.2 on)",
     take_range, offsetof(run_options, rig.expert.range_hops), 0, 1024},
    {"--serve", "WORLD",
     "the scene's world alone, under that name, for hands of other processes; until Ctrl-C or for\n"
     "--seconds. --look-ahead: round trip and jitter of the way (default 0.1)",
     take_text, offsetof(run_options, far.serve), 0, 0},
    {"--connect", "WORLD",
     "the scene's hands alone, in the world that another process serves, with the same --scene",
     take_text, offsetof(run_options, far.connect), 0, 0},
    {"--hand-name", "NAME", "what the server is told (default hand)", take_text,
     offsetof(run_options, far.name), 0, 0},
    {"--certificates", "FOLDER",
     "of --serve and --connect: over the network, encrypted, with whoever has certificates of the\n"
     "same authority (docs/remote.md; default: inside this machine)",
     take_text, offsetof(run_options, far.certificates), 0, 0},
    {"--insecure", NULL, "likewise over the network, with anybody", take_flag,
     offsetof(run_options, far.insecure), 0, 0},
    {"--interface", "NAME", "of the network, by name or address (default: DDS chooses)", take_text,
     offsetof(run_options, far.interface_name), 0, 0},
    {"--peers", "LIST", "addresses with commas between them, where there is no multicast",
     take_text, offsetof(run_options, far.peers), 0, 0},
    {"--dds-domain", "N", "0 to 230 (default 67)", take_count, offsetof(run_options, far.domain), 0,
     230},
    {"--seconds", "S", "length of the run (default: the scene's)", take_number,
     offsetof(run_options, seconds), 0.001, 86400},
    {"--lockstep", NULL, "virtual clock, as fast as it goes, reproducible", take_constant,
     offsetof(run_options, rig.def.drive), HAP_DRIVE_LOCKSTEP, 0},
    {"--model-age", "S", "lockstep: seconds from a physics step's start to the use of its result",
     take_number, offsetof(run_options, model_age_s), 0, 200},
    {"--impulse-pose", "NAME", "model impulse shows bodies held or interpolated (default)",
     take_pose, 0, 0, 0},
    {"--probe", "NAME",
     "model accelerance: shared zero probe (default), as in the paper, or operating:\n"
     "about the forces that the pointers give",
     take_probe, 0, 0, 0},
    {"--reuse", "M",
     "what testing simulations found is used again while nothing has moved by more, in\n"
     "metres, 0 to 0.01 (default: as --accuracy says, 1e-7 at 0.5); 0: each step\n"
     "measures anew",
     take_number, offsetof(run_options, rig.expert.reuse), 0, 0.01},
    {"--lookback", "SHARE",
     "of physics' time, 0 to 0.5 (default 0), in which the last moments are gone over as\n"
     "model single has them: the error of the felt force, as force_error",
     take_number, offsetof(run_options, lookback), 0, 0.5},
    {"--accuracy", "A", "0 to 1 (default 0.5): the dial of all settings that are not given",
     take_number, offsetof(run_options, rig.def.accuracy), 0, 1},
    {"--force-error", "SHARE",
     "of the force, 0.001 to 1: the dial goes to the least accuracy with which looking back\n"
     "tells no more (--lookback 0.1 where that is not given)",
     take_number, offsetof(run_options, rig.expert.force_error_wanted), 0.001, 1},
    {"--tick-share", "SHARE",
     "of a tick's period, 0.01 to 1: the dial of the tick is turned back to fit into it",
     take_number, offsetof(run_options, rig.expert.tick_share), 0.01, 1},
    {"--physics-share", "SHARE", "of a period of physics, likewise", take_number,
     offsetof(run_options, rig.expert.physics_share), 0.01, 1},
    {"--max-force", "N", "limit of the force on a hand (default 20)", take_number,
     offsetof(run_options, rig.max_force), 1e-6, 1e6},
    {"--stiffness", "F", "of the pointers' contacts, N/m (default: the scene's)", take_number,
     offsetof(run_options, rig.stiffness), 1e-3, 1e9},
    {"--friction", "MU", "of the pointers, 0 to 10 (default: the scene's)", take_number,
     offsetof(run_options, rig.friction), 0, 10},
    {"--finger-radius", "M",
     "radius by which the pointers, as soft fingers, hold against turning (default:\n"
     "the scene's), 0: not",
     take_number, offsetof(run_options, rig.finger_radius), 0, 1},
    {"--coupling", "NAME[:K]",
     "of hand and world: direct, proxy or auto (default), which takes the proxy for\n"
     "more than the device holds; god-object or virtual, as in the literature. K: what\n"
     "the device holds, N/m (default: its own figures)",
     take_coupling, offsetof(run_options, rig.coupling_stiffness), 1e-3, 1e9},
    {"--virtual-mass", "KG", "of the tool of coupling virtual (default 0.1)", take_number,
     offsetof(run_options, rig.virtual_mass), 1e-6, 1e6},
    {"--effects", "LIST", "such as friction=off,torque=auto, or all=on; see --list", take_effects,
     0, 0, 0},
    {"--effects-table", NULL, "after the summary, a line for each effect: why, and what it costs",
     take_flag, offsetof(run_options, effects_table), 0, 0},
    {"--trace", "FILE", "every tick as a row of a CSV file", take_text,
     offsetof(run_options, trace_path), 0, 0},
    {"--plot", "FILE", "picture of the run as SVG, drawn by gnuplot", take_text,
     offsetof(run_options, plot_path), 0, 0},
    {"--view", NULL,
     "a window on the run until it is closed, or for --seconds: the mouse pulls the\n"
     "hand, F1 lists the keys (docs/view.md)",
     take_flag, offsetof(run_options, window.wanted), 0, 0},
    {"--keys", "LIST", "of the window, such as quit=x,scene-next=off, or all=off", take_keys, 0, 0,
     0},
    {"--html", "FILE", "the run as one page for a browser, which turns and replays it", take_text,
     offsetof(run_options, html_path), 0, 0},
    {"--shot", "FILE", "picture of the scene as PNG, when the force is strongest; needs no display",
     take_text, offsetof(run_options, shot.path), 0, 0},
    {"--shot-at", "S", "the picture is of this time of the run", take_number,
     offsetof(run_options, shot.at), 0, 86400},
    {"--frames", "DIR", "such pictures 30 times a second, as frame_00000.png and so on", take_text,
     offsetof(run_options, shot.frames), 0, 0},
    {"--shot-size", "WxH", "pixels of these pictures and of the window (default 1280x720)",
     take_pixels, 0, 320, 8192},
    {"--camera", "POINTS",
     "of these pictures: x,y,z of the eye, then of what it looks at, m (default: all\n"
     "that moves is in the picture)",
     take_camera, 0, 0, 0},
    {"--black-box", "FILE", "after a fault, the last 256 ticks before it as a CSV file", take_text,
     offsetof(run_options, black_box_path), 0, 0},
    {"--record", "FILE", "all that enters the run, for --play (docs/recording.md)", take_text,
     offsetof(run_options, record_path), 0, 0},
    {"--record-limit", "MIB", "size at which the recording ends, 0.0625 to 1e6 (default 1024)",
     take_number, offsetof(run_options, recording.limit_mib), 0.0625, 1e6},
    {"--play", "FILE",
     "what --record wrote, once more, bit for bit; says where it is not. Scene,\n"
     "model, rates and hands are those of the file",
     take_text, offsetof(run_options, play_path), 0, 0},
    {"--play-incomplete", NULL, "--play of a file that breaks off: up to there", take_flag,
     offsetof(run_options, recording.incomplete), 0, 0},
    {"--rt-priority", "N", "SCHED_FIFO priority of the haptic thread (default 80), 0: none",
     take_priority, 0, 0, 98},
    {"--no-realtime", NULL, "do not ask for real-time rights", take_constant,
     offsetof(run_options, rig.def.rt_priority), 0, 0},
    {"--list", NULL, "scenes with their parameters, models, devices, effects", take_constant,
     offsetof(run_options, action), RUN_LIST, 0},
    {"--list-probe", NULL,
     "as --list, and asks the serial port of each USB adapter for boards: bytes are\n"
     "sent there, also to machines that are no haptic devices",
     take_constant, offsetof(run_options, action), RUN_PROBE, 0},
    {"--doctor", NULL,
     "what of this machine helps or hinders: kernel, limits, timer, libraries, ports;\n"
     "a line each, with what to type; 2 s; opens no port; exit 1: there is a problem",
     take_constant, offsetof(run_options, action), RUN_DOCTOR, 0},
    {"--json", NULL, "--doctor as JSON (docs/doctor.md)", take_flag, offsetof(run_options, json), 0,
     0},
    {"--help", NULL, "this text", take_constant, offsetof(run_options, action), RUN_HELP, 0},
    {"--version", NULL, "version of the library", take_constant, offsetof(run_options, action),
     RUN_VERSION, 0},
};

#define OPTIONS (sizeof table / sizeof table[0])

static const option *option_find(const char *argument, size_t length)
{
  for (size_t i = 0; i < OPTIONS; ++i) {
    if (strlen(table[i].name) == length && memcmp(argument, table[i].name, length) == 0) {
      return &table[i];
    }
  }
  return NULL;
}

static hap_status fail_unknown(const char *argument, hap_detail *detail)
{
  int used = snprintf(detail->text, sizeof detail->text,
                      "there is no option \"%.60s\"; options:", argument);
  for (size_t i = 0; i < OPTIONS && used < (int)sizeof detail->text; ++i) {
    used += snprintf(detail->text + used, sizeof detail->text - (size_t)used, " %s", table[i].name);
  }
  return HAP_ERROR_ARGUMENT;
}

/* What a recording does not answer. */
static bool beside_play(const option *o)
{
  static const char *const names[] = {"--play",    "--play-incomplete",
                                      "--seconds", "--trace",
                                      "--plot",    "--black-box",
                                      "--list",    "--list-probe",
                                      "--shot",    "--shot-at",
                                      "--frames",  "--shot-size",
                                      "--camera",  "--view",
                                      "--keys",    "--html",
                                      "--help",    "--version"};
  bool found = false;
  for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
    found = found || strcmp(names[i], o->name) == 0;
  }
  return found;
}

/* Takes the option at argv[*at], as "--name value" or "--name=value", and moves *at to its end. */
static hap_status take_option(char **argv, int *at, run_options *out, hap_detail *detail)
{
  const char *argument = argv[*at];
  size_t length = strcspn(argument, "=");
  const option *found = option_find(argument, length);
  if (found == NULL) {
    return fail_unknown(argument, detail);
  }
  const char *value = argument[length] == '=' ? argument + length + 1 : NULL;
  if (found->value == NULL && value != NULL) {
    return options_fail(detail, "%s takes no value", found->name);
  }
  if (found->value != NULL && value == NULL) {
    value = argv[++*at];
  }
  if (found->value != NULL && value == NULL) {
    return options_fail(detail, "%s needs a value: %s %s", found->name, found->name, found->value);
  }
  if (out->not_beside_play == NULL && !beside_play(found)) {
    out->not_beside_play = found->name;
  }
  hap_detail why = {""};
  hap_status status = found->take(out, found, value, &why);
  return status < HAP_OK ? options_fail(detail, "%s: %.480s", found->name, why.text) : HAP_OK;
}

/* --coupling says it of the pointers, the effect "proxy" of those that leave it to the library. */
static hap_status join_coupling(run_options *o, hap_detail *detail)
{
  hap_coupling coupling = o->rig.coupling;
  hap_effect_wish proxy =
      o->effects.of_all[HAP_EFFECT_PROXY] ? HAP_EFFECT_AUTO : o->effects.wish[HAP_EFFECT_PROXY];
  bool spring = coupling != HAP_COUPLING_DIRECT && coupling != HAP_COUPLING_AUTO;
  if (spring && o->rig.def.model != HAP_MODEL_CONTACT) {
    return options_fail(detail, "--coupling: %s needs --model contact",
                        hap_coupling_name(coupling));
  }
  if (o->coupling_given && coupling != HAP_COUPLING_AUTO && proxy != HAP_EFFECT_AUTO &&
      spring != (proxy == HAP_EFFECT_ON)) {
    return options_fail(detail, "--coupling: --effects asks for something else by proxy=");
  }
  if (o->rig.virtual_mass > 0.0 && coupling != HAP_COUPLING_VIRTUAL) {
    return options_fail(detail, "--virtual-mass: it belongs to --coupling virtual");
  }
  return HAP_OK;
}

static hap_status join_friction(const run_options *o, hap_detail *detail)
{
  return o->effects.wish[HAP_EFFECT_FRICTION] == HAP_EFFECT_OFF && o->rig.friction > 0.0
             ? options_fail(detail, "--friction: --effects asks for something else by friction=off")
             : HAP_OK;
}

static bool texts_same(const char *a, const char *b)
{
  return a != NULL && b != NULL && strcmp(a, b) == 0;
}

/* --record and the effect "recording" are two names of one thing. */
static hap_status join_recording(run_options *o, hap_detail *detail)
{
  hap_effect_wish *wish = &o->effects.wish[HAP_EFFECT_RECORDING];
  bool named = !o->effects.of_all[HAP_EFFECT_RECORDING];
  if (*wish == HAP_EFFECT_ON && named && o->record_path == NULL) {
    return options_fail(detail, "--effects: recording=on needs a file: --record FILE");
  }
  if (*wish == HAP_EFFECT_OFF && o->record_path != NULL) {
    return options_fail(detail, "--record: --effects asks for something else by recording=off");
  }
  *wish = *wish == HAP_EFFECT_ON ? HAP_EFFECT_AUTO : *wish; /* the file says it */
  return HAP_OK;
}

static hap_status check_recording(const run_options *o, hap_detail *detail)
{
  const char *file = o->play_path != NULL ? o->play_path : o->record_path;
  const char *name = o->play_path != NULL ? "--play" : "--record";
  if (o->play_path != NULL && o->not_beside_play != NULL) {
    return options_fail(detail, "--play: the file says what to run; leave out %s",
                        o->not_beside_play);
  }
  if (o->recording.incomplete && o->play_path == NULL) {
    return options_fail(detail, "--play-incomplete: only with --play");
  }
  if (o->recording.limit_mib > 0.0 && o->record_path == NULL) {
    return options_fail(detail, "--record-limit: only with --record");
  }
  if (o->record_path != NULL && o->rig.def.drive == HAP_DRIVE_LOCKSTEP) {
    return options_fail(
        detail, "--record: not with --lockstep, which does the same on every run by itself");
  }
  if (o->record_path != NULL && o->identify_path != NULL) {
    return options_fail(detail, "--record: --identify runs no session");
  }
  if (o->record_path != NULL && o->check.spec != NULL) {
    return options_fail(detail, "--record: --check-device runs no session");
  }
  if (texts_same(file, o->trace_path) || texts_same(file, o->plot_path) ||
      texts_same(file, o->black_box_path)) {
    return options_fail(detail, "%s: the same file as --trace, --plot or --black-box", name);
  }
  return HAP_OK;
}

static hap_status check_shot(const run_options *o, hap_detail *detail)
{
  const run_shot_options *s = &o->shot;
  bool alone = o->identify_path != NULL || o->calibrate_path != NULL || o->check.spec != NULL;
  if (s->path == NULL && s->at >= 0.0) {
    return options_fail(detail, "--shot-at: only with --shot");
  }
  if (o->window.wanted && (s->path != NULL || s->frames != NULL || alone)) {
    return options_fail(detail,
                        "--view: not with --shot, --frames, --identify, --calibrate or "
                        "--check-device");
  }
  if (o->window.keys_given && !o->window.wanted) {
    return options_fail(detail, "--keys: only with --view");
  }
  if (s->path == NULL && s->frames == NULL) {
    return s->camera_given && !o->window.wanted
               ? options_fail(detail, "--camera: only with --shot, --frames or --view")
               : HAP_OK;
  }
  if (texts_same(s->path, o->trace_path) || texts_same(s->path, o->plot_path) ||
      texts_same(s->path, o->black_box_path) || texts_same(s->path, o->record_path) ||
      texts_same(s->path, o->play_path)) {
    return options_fail(detail, "--shot: the same file as that of another option");
  }
  return alone ? options_fail(detail,
                              "--shot, --frames: not with --identify, --calibrate or "
                              "--check-device, which show no scene")
               : HAP_OK;
}

static hap_status check_html(const run_options *o, hap_detail *detail)
{
  const char *path = o->html_path;
  if (path == NULL) {
    return HAP_OK;
  }
  if (texts_same(path, o->trace_path) || texts_same(path, o->plot_path) ||
      texts_same(path, o->black_box_path) || texts_same(path, o->record_path) ||
      texts_same(path, o->play_path) || texts_same(path, o->shot.path)) {
    return options_fail(detail, "--html: the same file as that of another option");
  }
  bool alone = o->identify_path != NULL || o->calibrate_path != NULL || o->check.spec != NULL;
  return alone || o->window.wanted
             ? options_fail(detail,
                            "--html: not with --view, --identify, --calibrate or --check-device")
             : HAP_OK;
}

static hap_status check_calibrate(const run_options *o, hap_detail *detail)
{
  if (o->calibrate_path == NULL) {
    return HAP_OK;
  }
  if (o->identify_path != NULL || o->check.spec != NULL || o->record_path != NULL ||
      o->play_path != NULL) {
    return options_fail(detail,
                        "--calibrate: not with --identify, --check-device, --record or --play");
  }
  if (o->rig.device_count != 1) {
    return options_fail(detail, "--calibrate: takes exactly one --device, there are %zu",
                        o->rig.device_count);
  }
  return HAP_OK;
}

static hap_status check_error(run_options *o, hap_detail *detail)
{
  hap_expert_def *expert = &o->rig.expert;
  bool wanted = expert->force_error_wanted > 0.0;
  if (wanted && o->lookback == 0.0) {
    return options_fail(
        detail,
        "--force-error: --lookback 0 leaves nothing that tells the error; give it 0.1, "
        "say, or leave it out");
  }
  expert->lookback = wanted ? LOOKBACK_SHARE : 0.0;
  if (o->lookback >= 0.0) {
    expert->lookback = o->lookback;
  }
  return expert->lookback > 0.0 && o->rig.def.model == HAP_MODEL_SINGLE
             ? options_fail(
                   detail,
                   "%s: --model single is what the force is held against, so that it has no "
                   "error; take another one",
                   wanted ? "--force-error" : "--lookback")
             : HAP_OK;
}

static hap_status check_budget(const run_options *o, hap_detail *detail)
{
  const hap_session_def *def = &o->rig.def;
  const hap_expert_def *expert = &o->rig.expert;
  const char *name = expert->tick_share > 0.0 ? "--tick-share" : "--physics-share";
  bool budget = expert->tick_share > 0.0 || expert->physics_share > 0.0;
  if (budget && def->drive == HAP_DRIVE_LOCKSTEP) {
    return options_fail(
        detail,
        "%s: not with --lockstep, which does the same on every run, however long it "
        "takes; give --accuracy instead",
        name);
  }
  return expert->tick_share > 0.0 && def->model != HAP_MODEL_CONTACT
             ? options_fail(
                   detail,
                   "--tick-share: a tick of --model %s has nothing that could be left out; take "
                   "--model contact, or leave it away",
                   hap_model_name(def->model))
             : HAP_OK;
}

/* What --serve and --connect need and cannot have. */
static hap_status check_far(run_options *o, hap_detail *detail)
{
  const run_far_options *f = &o->far;
  const char *name = f->serve != NULL ? "--serve" : "--connect";
  if (f->serve == NULL && f->connect == NULL) {
    bool any = f->name != NULL || f->certificates != NULL || f->insecure ||
               f->interface_name != NULL || f->peers != NULL || f->domain >= 0;
    return any ? options_fail(detail,
                              "--hand-name, --certificates, --insecure, --interface, "
                              "--peers, --dds-domain: only with --serve or --connect")
               : HAP_OK;
  }
  if (f->serve != NULL && f->connect != NULL) {
    return options_fail(detail, "--serve: not with --connect; start two programs");
  }
  if (o->rig.def.model != HAP_MODEL_CONTACT || o->rig.def.drive == HAP_DRIVE_LOCKSTEP ||
      o->record_path != NULL || o->play_path != NULL || o->identify_path != NULL ||
      o->calibrate_path != NULL || o->check.spec != NULL || o->rig.expert.lookback > 0.0) {
    return options_fail(detail,
                        "%s: model contact in real time alone; not with --lockstep, --lookback, "
                        "--record, --play, --identify, --calibrate or --check-device",
                        name);
  }
  if (f->serve != NULL && (o->rig.device_count > 0 || o->trace_path != NULL ||
                           o->plot_path != NULL || o->black_box_path != NULL)) {
    return options_fail(detail, "--serve: hands and traces are those of --connect");
  }
  o->far.shown =
      o->html_path != NULL || o->shot.path != NULL || o->shot.frames != NULL || o->window.wanted;
  if (f->serve != NULL && o->rig.expert.look_ahead == 0.0) {
    o->rig.expert.look_ahead = LOOK_AHEAD_S;
  }
  o->rig.serves = f->serve != NULL;
  return HAP_OK;
}

/* What only several options together can get wrong. */
static hap_status options_check(run_options *o, hap_detail *detail)
{
  hap_detail why = {""};
  hap_session_def *def = &o->rig.def;
  if (def->physics_hz > def->haptic_hz) {
    return options_fail(detail, "--physics-hz: %g is more than --haptic-hz, which is %g",
                        def->physics_hz, def->haptic_hz);
  }
  if (o->model_age_s >= 0.0) {
    double ticks = round(o->model_age_s * def->haptic_hz);
    if (def->drive != HAP_DRIVE_LOCKSTEP) {
      return options_fail(detail,
                          "--model-age: only with --lockstep; in real time the age is what it is");
    }
    if (ticks > LATENCY_TICKS_MAX) {
      return options_fail(detail,
                          "--model-age: %g s are over %g ticks of the haptic loop; at most %g s",
                          o->model_age_s, LATENCY_TICKS_MAX, LATENCY_TICKS_MAX / def->haptic_hz);
    }
    o->rig.research.physics_latency_ticks = (int32_t)ticks;
  }
  if (texts_same(o->trace_path, o->plot_path)) {
    return options_fail(detail, "--plot: the same file as --trace");
  }
  if (texts_same(o->black_box_path, o->trace_path) || texts_same(o->black_box_path, o->plot_path)) {
    return options_fail(detail, "--black-box: the same file as --trace or --plot");
  }
  if (o->check.spec != NULL && (o->identify_path != NULL || o->rig.device_count > 0)) {
    return options_fail(detail, "--check-device: takes neither --device nor --identify");
  }
  if (o->identify_path != NULL && o->rig.device_count != 1) {
    return options_fail(detail, "--identify: takes exactly one --device, there are %zu",
                        o->rig.device_count);
  }
  if (check_shot(o, detail) < HAP_OK || check_html(o, detail) < HAP_OK ||
      check_calibrate(o, detail) < HAP_OK || check_error(o, detail) < HAP_OK ||
      check_budget(o, detail) < HAP_OK || check_recording(o, detail) < HAP_OK ||
      check_far(o, detail) < HAP_OK || join_recording(o, detail) < HAP_OK ||
      join_coupling(o, detail) < HAP_OK || join_friction(o, detail) < HAP_OK) {
    return HAP_ERROR_ARGUMENT;
  }
  return run_effects_apply(&o->effects, def->model, &o->rig.expert, &why) < HAP_OK
             ? options_fail(detail, "--effects: %.480s", why.text)
             : HAP_OK;
}

hap_status run_options_parse(int argc, char **argv, run_options *out, hap_detail *detail)
{
  hap_status status = HAP_OK;
  memset(out, 0, sizeof *out);
  rig_options_init(&out->rig);
  out->model_age_s = -1.0;
  out->lookback = -1.0;
  out->far.domain = -1;
  out->shot = (run_shot_options){.at = -1.0, .size = {1280, 720}};
  run_keys_init(&out->window.keys);
  out->check.force = CONFORM_FORCE_DEFAULT;
  out->check.wait_s = 5.0;
  for (int at = 1;
       at < argc && status >= HAP_OK && (out->action == RUN_SESSION || out->action == RUN_DOCTOR);
       ++at) {
    status = take_option(argv, &at, out, detail);
  }
  if (status >= HAP_OK && out->json && out->action == RUN_SESSION) {
    return options_fail(detail, "--json: only with --doctor");
  }
  for (int at = 1; at < argc && status >= HAP_OK && out->action == RUN_DOCTOR; ++at) {
    if (strcmp(argv[at], "--doctor") != 0 && strcmp(argv[at], "--json") != 0) {
      status = options_fail(detail, "--doctor: goes with --json alone, not with %.200s", argv[at]);
    }
  }
  return status < HAP_OK || out->action != RUN_SESSION ? status : options_check(out, detail);
}

void run_options_help(FILE *out)
{
  fputs(
      "hapode-run: lets a hand, real or simulated, feel a scene.\n\n"
      "usage: hapode-run [OPTION VALUE | OPTION=VALUE | SWITCH]...\n\n",
      out);
  for (size_t i = 0; i < OPTIONS; ++i) {
    const option *o = &table[i];
    const char *line = o->help;
    int length = (int)strcspn(line, "\n");
    fprintf(out, "  %-15s %-9s %.*s\n", o->name, o->value != NULL ? o->value : "", length, line);
    while (line[length] != '\0') {
      line += length + 1;
      length = (int)strcspn(line, "\n");
      fprintf(out, "%28s%.*s\n", "", length, line);
    }
  }
  fputs(
      "\nA summary comes on stdout, one \"key: value\" a line. Ctrl-C takes the force away and "
      "ends\nthe run with its summary; a second one ends it at once.\n"
      "exit: 0 run complete (also without real-time rights) or stopped by Ctrl-C, 1 it failed or "
      "a\ndevice did, 2 wrong usage\n",
      out);
}
