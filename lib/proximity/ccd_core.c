/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/ccd_core.h"

#include "proximity/direction.h"

static void core_center(const void *object, ccd_vec3_t *out)
{
  const hapi_ccd_core *core = object;
  hapi_v3_scale(core->scale, core->solid->inside, out->v);
}

static void core_support(const void *object, const ccd_vec3_t *direction, ccd_vec3_t *out)
{
  const hapi_ccd_core *core = object;
  double unit[3] = {0.0, 0.0, 0.0};
  if (--*core->calls_left < 0) {
    core_center(object, out);
    return;
  }
  hapi_v3_unit(direction->v, unit);
  hapi_solid_support(core->solid, direction->v, out->v);
  hapi_v3_madd(out->v, core->inflation, unit, out->v);
  hapi_v3_scale(core->scale, out->v, out->v);
}

void hapi_ccd_init(ccd_t *ccd, double tolerance)
{
  CCD_INIT(ccd);
  ccd->support1 = core_support;
  ccd->support2 = core_support;
  ccd->center1 = core_center;
  ccd->center2 = core_center;
  ccd->max_iterations = 100;
  ccd->epa_tolerance = tolerance;
  ccd->mpr_tolerance = tolerance;
}
