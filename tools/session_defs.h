/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_SESSION_DEFS_H
#define HAPODE_TOOLS_SESSION_DEFS_H

/* The structs that a session and a pointer are made from, for programs that set all of them. */

#include <hapode/expert.h>
#include <hapode/research.h>

/* Defaults. *def refers to the other two, which must stay where they are until the session is
 * created. */
static inline void session_defs_init(hap_session_def *def, hap_expert_def *expert,
                                     hap_research_def *research)
{
  hap_session_def_init(def, sizeof *def);
  hap_expert_def_init(expert, sizeof *expert);
  hap_research_def_init(research, sizeof *research);
  def->expert = expert;
  def->research = research;
}

/* The same of a pointer. */
static inline void pointer_defs_init(hap_pointer_def *def, hap_pointer_expert_def *expert,
                                     hap_pointer_research_def *research)
{
  hap_pointer_def_init(def, sizeof *def);
  hap_pointer_expert_def_init(expert, sizeof *expert);
  hap_pointer_research_def_init(research, sizeof *research);
  def->expert = expert;
  def->research = research;
}

static inline void expert_wish(hap_expert_def *io, hap_effect effect, hap_effect_wish wish)
{
  uint32_t bit = HAP_EFFECT_BIT(effect);
  io->effects_on = wish == HAP_EFFECT_ON ? io->effects_on | bit : io->effects_on & ~bit;
  io->effects_off = wish == HAP_EFFECT_OFF ? io->effects_off | bit : io->effects_off & ~bit;
}

#endif
