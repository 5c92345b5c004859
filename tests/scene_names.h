/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_SCENE_NAMES_H
#define HAPODE_TESTS_SCENE_NAMES_H

/* The scenes that a user is told of. */

static const char *const names[] = {
    "fig5",          "fig6",      "fig7",  "slide",   "row10", "stack",    "wedge",  "door",
    "lightstand",    "pile",      "tower", "topple",  "edge",  "hit",      "roll",   "roll_capsule",
    "roll_cylinder", "clump8",    "field", "spheres", "hold",  "pendulum", "hinged", "cart",
    "chain",         "telescope", "grasp", "lever",   "peg",   "gallery"};

#endif
