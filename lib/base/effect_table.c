/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/effect_table.h"

#define ACCELERANCE HAPI_MODEL_BIT(HAP_MODEL_ACCELERANCE)
#define CONTACT HAPI_MODEL_BIT(HAP_MODEL_CONTACT)
#define EVERY \
  (HAPI_MODEL_BIT(HAP_MODEL_SINGLE) | HAPI_MODEL_BIT(HAP_MODEL_IMPULSE) | ACCELERANCE | CONTACT)

const hapi_effect_row hapi_effect_rows[HAP_EFFECTS] = {
    [HAP_EFFECT_TESTING] = {"testing", "testing simulations", ACCELERANCE | CONTACT, ACCELERANCE,
                            false},
    [HAP_EFFECT_CROSS] = {"cross", "cross accelerance between local bodies", ACCELERANCE, 0, true},
    [HAP_EFFECT_CONTACTS] = {"contacts", "contacts between bodies in the loop", CONTACT, 0, true},
    [HAP_EFFECT_PASSES] = {"passes", "contact passes between syncs", CONTACT, 0, false},
    [HAP_EFFECT_JOINTS] = {"joints", "joints in the loop", CONTACT, 0, true},
    [HAP_EFFECT_RANGE] = {"range", "local range beyond the neighbours", CONTACT, 0, false},
    [HAP_EFFECT_RESTITUTION] = {"restitution", "restitution in the loop", CONTACT, 0, true},
    [HAP_EFFECT_FRICTION] = {"friction", "friction on the pointer", EVERY, 0, true},
    [HAP_EFFECT_TORQUE] = {"torque", "torque on the hand", EVERY, 0, true},
    [HAP_EFFECT_GYRO] = {"gyro", "gyroscopic term in the loop", CONTACT, 0, true},
    [HAP_EFFECT_SHAPE] = {"shape", "shape at every tick instead of a plane", CONTACT, 0, true},
    [HAP_EFFECT_PROXY] = {"proxy", "coupling by a proxy", CONTACT, 0, true},
    [HAP_EFFECT_OBSERVER] = {"observer", "energy observer", EVERY, 0, true},
    [HAP_EFFECT_RECORDING] = {"recording", "recording for a replay bit for bit", 0, 0, true},
};
