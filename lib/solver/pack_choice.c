/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "solver/pack_choice.h"

const hapi_pack_work *hapi_pack_work_best(void)
{
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (hapi_pack_work_avx2 != NULL && __builtin_cpu_supports("avx2")) {
    return hapi_pack_work_avx2;
  }
#endif
  return &hapi_pack_work_pairs;
}
