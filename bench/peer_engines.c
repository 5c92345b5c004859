/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Which engines this build has: meson options bullet, mujoco and jolt. */

#include "bench/peer.h"

static const peer_engine *const engines[] = {
    &peer_ode,
#ifdef HAPODE_PEER_BULLET
    &peer_bullet,
#endif
#ifdef HAPODE_PEER_MUJOCO
    &peer_mujoco,
#endif
#ifdef HAPODE_PEER_JOLT
    &peer_jolt,
#endif
};

static const char *const missing[] = {
#ifndef HAPODE_PEER_BULLET
    "bullet: this build did not find Bullet and a C++ compiler (Debian: libbullet-dev, g++)",
#endif
#ifndef HAPODE_PEER_MUJOCO
    "mujoco: this build did not find MuJoCo (Debian: libmujoco-dev)",
#endif
#ifndef HAPODE_PEER_JOLT
    "jolt: this build was not told where Jolt is (meson option jolt: its prefix)",
#endif
    NULL,
};

const peer_engine *peer_engine_at(size_t index)
{
  return index < sizeof engines / sizeof engines[0] ? engines[index] : NULL;
}

const char *peer_missing_at(size_t index)
{
  return index < sizeof missing / sizeof missing[0] ? missing[index] : NULL;
}
