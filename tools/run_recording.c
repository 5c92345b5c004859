/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_recording.h"

#include <inttypes.h>
#include <string.h>

#include "base/log.h"

#define NOTE_BEGIN "hapode-run\nscene "

static const char *const ends[] = {
    [HAP_RECORD_GOES_ON] = "broken_off", [HAP_RECORD_STOPPED] = "stopped",
    [HAP_RECORD_LIMIT] = "limit",        [HAP_RECORD_OVERFLOW] = "overflow",
    [HAP_RECORD_FAILED] = "failed",
};

/* What the world was built from. */
static hap_status read_note(run_recording *r, const char *path, hap_detail *detail)
{
  const char *note = r->info.note;
  size_t begin = strlen(NOTE_BEGIN);
  size_t size = r->info.note_size;
  if (size <= begin || memcmp(note, NOTE_BEGIN, begin) != 0) {
    return hapi_fail(
        detail, HAP_ERROR_UNSUPPORTED,
        "--play %.300s: was recorded by another program, which alone can build its world", path);
  }
  const char *end = memchr(note + begin, '\n', size - begin);
  size_t length = end != NULL ? (size_t)(end - note) - begin : 0;
  if (length == 0 || length >= sizeof r->scene) {
    return hapi_fail(detail, HAP_ERROR_FORMAT, "--play %.300s: it does not name its scene", path);
  }
  memcpy(r->scene, note + begin, length);
  return HAP_OK;
}

static hap_status open_player(run_options *options, run_recording *out, hap_detail *detail)
{
  hap_detail why = {""};
  hap_play_extent extent = options->recording.incomplete ? HAP_PLAY_INCOMPLETE : HAP_PLAY_WHOLE;
  hap_status status = hap_player_open(options->play_path, extent, &out->player, &why);
  if (status < HAP_OK) {
    snprintf(detail->text, sizeof detail->text, "--play %.490s", why.text);
    return status;
  }
  (void)hap_player_get_info(out->player, &out->info, sizeof out->info);
  status = read_note(out, options->play_path, detail);
  if (status < HAP_OK) {
    return status;
  }
  options->rig.scene = out->scene;
  options->rig.player = out->player;
  options->rig.devices[0] = "recording";
  options->rig.device_count = 1;
  return hap_player_get_def(out->player, &options->rig.def, &options->rig.expert,
                            &options->rig.research);
}

hap_status run_recording_open(run_options *options, run_recording *out, hap_detail *detail)
{
  memset(out, 0, sizeof *out);
  if (options->play_path != NULL) {
    return open_player(options, out, detail);
  }
  if (options->record_path != NULL) {
    hap_record_def_init(&out->def, sizeof out->def);
    int size = snprintf(out->note, sizeof out->note, NOTE_BEGIN "%.200s\n", options->rig.scene);
    out->def.path = options->record_path;
    out->def.note = out->note;
    out->def.note_size = (size_t)size;
    if (options->recording.limit_mib > 0.0) {
      out->def.max_bytes = (uint64_t)(options->recording.limit_mib * 1048576.0);
    }
    options->rig.record = &out->def;
  }
  return HAP_OK;
}

void run_recording_close(run_recording *recording)
{
  hap_player_close(recording->player);
  recording->player = NULL;
}

static bool print_record(const run_options *options, const hap_session *session, FILE *out,
                         hap_detail *detail)
{
  hap_record_state state;
  hap_detail why = {""};
  hap_status status = hap_session_record_state(session, &state, sizeof state, &why);
  if (status == HAP_ERROR_STATE) {
    return true;
  }
  fprintf(out, "record_end: %s\n", ends[state.end]);
  fprintf(out, "record_ticks: %" PRIu64 "\n", state.ticks);
  fprintf(out, "record_bytes: %" PRIu64 "\n", state.bytes);
  fprintf(out, "record_lost_ticks: %" PRIu64 "\n", state.lost_ticks);
  if (status == HAP_RECORD_ENDED) {
    fprintf(stderr,
            "hapode-run: --record %s: ended before the run, after %" PRIu64
            " ticks: %s; it can be "
            "played up to there\n",
            options->record_path, state.ticks,
            state.end == HAP_RECORD_LIMIT ? "--record-limit is reached"
                                          : "the disk was too slow for it");
  }
  snprintf(detail->text, sizeof detail->text, "--record %.200s: %.280s", options->record_path,
           why.text);
  return status >= HAP_OK;
}

static bool print_play(const run_recording *recording, FILE *out, hap_detail *detail)
{
  hap_play_difference difference;
  (void)hap_player_difference(recording->player, &difference, sizeof difference);
  bool alike = difference.what == HAP_DIFFERENCE_NONE;
  fprintf(out, "replay: %s\n", alike ? "identical" : "differs");
  fprintf(out, "record_end: %s\n", ends[recording->info.end]);
  fprintf(out, "record_ticks: %" PRIu64 "\n", recording->info.ticks);
  fprintf(out, "record_edits: %" PRIu64 "\n", recording->info.edits);
  if (!alike) {
    snprintf(detail->text, sizeof detail->text, "the replay %.255s%s%s", difference.text,
             recording->info.edits > 0
                 ? "; the application changed its world meanwhile, which is not in the recording"
                 : "",
             difference.other_system
                 ? "; it was recorded with another C library, whose last digits may be others"
                 : "");
  }
  return alike;
}

bool run_recording_print(const run_recording *recording, const run_options *options,
                         const hap_session *session, FILE *out, hap_detail *detail)
{
  bool good = recording->player == NULL || print_play(recording, out, detail);
  return good && (options->record_path == NULL || print_record(options, session, out, detail));
}
