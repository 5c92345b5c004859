/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/surface.h>

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/safety.h"
#include "base/vec.h"
#include "session/session_internal.h"

#define RIGHT_ANGLE 1e-6
#define CALL_SHARE_MOST 0.5 /* of a haptic period */

static const hap_texture_def texture_defaults = {.cookie = 0x48545831u,
                                                 .pitch = 1e-3,
                                                 .repeats = 1,
                                                 .along_columns = {1.0, 0.0, 0.0},
                                                 .along_rows = {0.0, 1.0, 0.0}};
static const hapi_def_type texture_type = HAPI_DEF_TYPE(hap_texture_def, texture_defaults);

void hap_texture_def_init(hap_texture_def *def, size_t size_of_def)
{
  hapi_def_init(&texture_type, def, size_of_def);
}

static bool axes_are_good(const double a[3], const double b[3])
{
  return fabs(hapi_v3_norm(a) - 1.0) <= RIGHT_ANGLE && fabs(hapi_v3_norm(b) - 1.0) <= RIGHT_ANGLE &&
         fabs(hapi_v3_dot(a, b)) <= RIGHT_ANGLE; /* false for NaN */
}

static hap_status patch_check(const hap_texture_def *def, hap_detail *detail)
{
  const hapi_number_rule rules[] = {HAPI_RULE(def, columns, 1, 4096), HAPI_RULE(def, rows, 1, 4096),
                                    HAPI_RULE(def, pitch, 1e-6, 1.0),
                                    HAPI_RULE(def, repeats, 0, 1)};
  HAPI_TRY(hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail));
  if (!axes_are_good(def->along_columns, def->along_rows)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "along_columns and along_rows are not unit vectors at right angles");
  }
  size_t count = (size_t)def->columns * (size_t)def->rows;
  for (size_t i = 0; i < count; ++i) {
    if (!(fabs(def->heights[i]) <= HAPI_SAFETY_TEXTURE_HEIGHT)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "heights[%zu] is %g m: a texture has -0.003 to 0.003 m; what is higher is a "
                       "shape of its own",
                       i, def->heights[i]);
    }
  }
  return HAP_OK;
}

static hap_status texture_check(const hap_texture_def *def, double haptic_hz, hap_detail *detail)
{
  const hapi_number_rule rules[] = {HAPI_RULE(def, call_most_s, 0.0, CALL_SHARE_MOST / haptic_hz)};
  if ((def->heights == NULL) == (def->height == NULL)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "a texture has heights or the function height");
  }
  if (!hapi_finite(def->origin, 3)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "origin is not finite");
  }
  HAPI_TRY(hapi_numbers_check(rules, 1, detail));
  return def->heights != NULL ? patch_check(def, detail) : HAP_OK;
}

static hap_status texture_fill(const hap_texture_def *def, hapi_texture *out)
{
  *out = (hapi_texture){
      .height = def->height, .arg = def->arg, .most_ns = (int64_t)(1e9 * def->call_most_s)};
  if (def->heights == NULL) {
    return HAP_OK;
  }
  size_t count = (size_t)def->columns * (size_t)def->rows;
  double *heights = hapi_alloc_array(count, sizeof *heights);
  if (heights == NULL) {
    return HAP_ERROR_MEMORY;
  }
  memcpy(heights, def->heights, count * sizeof *heights);
  out->heights = heights;
  out->columns = (uint32_t)def->columns;
  out->rows = (uint32_t)def->rows;
  out->per_m = 1.0 / def->pitch;
  out->repeats = def->repeats;
  hapi_v3_copy(def->along_columns, out->along[0]);
  hapi_v3_copy(def->along_rows, out->along[1]);
  hapi_v3_copy(def->origin, out->origin);
  return HAP_OK;
}

static hap_status texture_put(hapi_textures *textures, const hap_texture_def *def, uint32_t *out)
{
  pthread_mutex_lock(&textures->lock);
  uint32_t count = atomic_load(&textures->count);
  hap_status status = HAP_ERROR_CAPACITY;
  if (count < HAPI_TEXTURES) {
    status = texture_fill(def, &textures->of[count]);
  }
  if (status == HAP_OK) {
    atomic_store_explicit(&textures->count, count + 1, memory_order_release);
    *out = count + 1;
  }
  pthread_mutex_unlock(&textures->lock);
  return status;
}

hap_status hap_session_add_texture(hap_session *session, const hap_texture_def *def,
                                   uint32_t *out_texture)
{
  hap_texture_def checked;
  hap_detail detail = {""};
  if (session == NULL || out_texture == NULL) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  *out_texture = 0;
  hap_status status = hapi_def_read(&texture_type, def, &checked, &detail);
  status = status < HAP_OK ? status : texture_check(&checked, session->def.haptic_hz, &detail);
  if (status < HAP_OK) {
    return hapi_session_note(session, status, &detail);
  }
  if (!(checked.call_most_s > 0.0)) {
    checked.call_most_s = HAPI_SAFETY_CALL_SHARE / session->def.haptic_hz;
  }
  return hapi_session_say(session, texture_put(session->textures, &checked, out_texture), __func__);
}

hap_status hap_session_get_texture(hap_session *session, uint32_t texture, hap_texture_state *out,
                                   size_t size_of_out)
{
  hap_texture_state state;
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (hapi_texture_find(session->textures, texture) == NULL) {
    return hapi_session_say(session, HAP_ERROR_NOT_FOUND, __func__);
  }
  hapi_haptic_get_texture(session->haptic, texture, &state);
  hap_status given = hapi_struct_give(&state, sizeof state, out, size_of_out);
  return hapi_session_say(session, given < HAP_OK || state.is_out == 0 ? given : HAP_END, __func__);
}
