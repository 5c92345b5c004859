/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "view/view.h"

void view_role_colour(hap_body_role role, float out_rgb[3])
{
  static const float colours[][3] = {
      [HAP_ROLE_WORLD] = {0.78F, 0.79F, 0.80F},   [HAP_ROLE_LOOP] = {0.93F, 0.48F, 0.12F},
      [HAP_ROLE_RESTING] = {0.24F, 0.56F, 0.74F}, [HAP_ROLE_MEASURED] = {0.58F, 0.38F, 0.78F},
      [HAP_ROLE_EDGE] = {0.55F, 0.68F, 0.62F},    [HAP_ROLE_DRIVEN] = {0.30F, 0.66F, 0.36F},
  };
  size_t known = (size_t)role < sizeof colours / sizeof colours[0] ? (size_t)role : 0;
  memcpy(out_rgb, colours[known], sizeof colours[known]);
}
