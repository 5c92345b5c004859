/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/stability/cases.h"

#define ALL (CONTACT | SINGLE | ACCELERANCE | IMPULSE)
#define TWO (CONTACT | SINGLE)

/* Every hard case that the library is to hold. Each is run in lockstep, the loop at 1 kHz, the world at
 * 60 Hz (in model single at 1 kHz), against the hand model of the virtual device, with the guard's
 * shaping switched off. After every tick the bounds of bounds.h are looked at.
 *
 * Who claims what. Contact claims all. Single claims what the world holds at 1 kHz with an explicit
 * contact spring: T^2 k / m < 4, and a device that holds k by itself. Accelerance and impulse are the
 * paper's, with its limits: they claim a soft contact with something that hardly moves. What a model
 * does not claim is run with the argument "all" and printed, not judged.
 *
 * kg: of each body; size: what the builder takes it for; N/m: of the pointer's contact; s: of the run;
 * room: m, that no body gets away from where it started. */

/* clang-format off */
const case_row stability_cases[] = {
  /* name                              builder                n  kg    size  N/m  hand     s    judged   room */
  {"1 g cube pressed, 100 N/m",        build_press,           1, 1e-3,  0,    1e2, RELAXED, 1.0, TWO,     0.05},
  {"1 g cube pressed, 10 kN/m",        build_press,           1, 1e-3,  0,    1e4, TENSE,   1.0, CONTACT, 0.05},
  {"1 g cube pressed, 1 MN/m",         build_press,           1, 1e-3,  0,    1e6, TENSE,   1.0, CONTACT, 0.05},
  {"1 g cube pushed, 100 N/m",         build_push,            1, 1e-3,  0,    1e2, RELAXED, 1.0, TWO,     1.0},
  {"1 g cube pushed, 1 MN/m",          build_push,            1, 1e-3,  0,    1e6, TENSE,   1.0, CONTACT, 1.0},
  {"1000 kg cube pressed, 2 kN/m",     build_press,           1, 1e3,   0,    2e3, TENSE,   1.0, ALL,     0.01},
  {"1000 kg cube pushed, 1 MN/m",      build_push,            1, 1e3,   0,    1e6, TENSE,   1.0, CONTACT, 0.01},
  {"1000 kg cube, device of 5 N",      build_push,            1, 1e3,   0.2,  2e3, TENSE,   1.0, TWO,     0.01,
     .max_force = 5},
  {"cube pushed, device of 1 N",       build_push,            1, 0.2,   0,    2e3, TENSE,   1.0, TWO,     0.3,
     .max_force = 1},
  {"two cubes, upper 1e-3 of lower",   build_press_unequal,   2, 1.0,   1e-3, 2e3, RELAXED, 1.0, CONTACT, 0.05},
  {"two cubes, upper 0.1 of lower",    build_press_unequal,   2, 1.0,   0.1,  2e3, RELAXED, 1.0, TWO,     0.01},
  {"two cubes, upper 10 x lower",      build_press_unequal,   2, 0.1,   10,   2e3, RELAXED, 1.0, TWO,     0.01},
  {"two cubes, upper 1e3 x lower",     build_press_unequal,   2, 1e-2,  1e3,  2e3, RELAXED, 1.0, CONTACT, 0.05},
  {"stack of 10",                      build_press,          10, 0.1,   0,    2e3, RELAXED, 1.0, CONTACT, 0.02},
  {"stack of 20",                      build_press,          20, 0.1,   0,    2e3, RELAXED, 1.0, CONTACT, 0.02},
  {"stack of 30",                      build_press,          30, 0.1,   0,    2e3, RELAXED, 1.0, CONTACT, 0.02},
  /* 80: more than the 64 bodies that the loop moves itself. */
  {"guided row of 2",                  build_row,             2, 0.1,   0,    2e3, TENSE,   1.0, TWO,     0.2},
  {"guided row of 10",                 build_row,            10, 0.1,   0,    2e3, TENSE,   1.0, TWO,     0.2},
  {"guided row of 40",                 build_row,            40, 0.1,   0,    2e3, TENSE,   0.5, CONTACT, 0.2},
  {"guided row of 80",                 build_row,            80, 0.1,   0,    2e3, TENSE,   0.5, CONTACT, 0.2,
     .late = true},
  {"row of 2, reversing, 100 ms",      build_row_reversing,   2, 0.1,   0,    2e3, TENSE,   1.0, TWO,     0.5},
  {"row of 10, reversing, 100 ms",     build_row_reversing,  10, 0.1,   0,    2e3, TENSE,   1.0, TWO,     0.5},
  {"row of 40, reversing, 100 ms",     build_row_reversing,  40, 0.1,   0,    2e3, TENSE,   0.5, CONTACT, 0.5},
  {"row of 80, reversing, 100 ms",     build_row_reversing,  80, 0.1,   0,    2e3, TENSE,   0.5, CONTACT, 0.5,
     .late = true},
  {"cube wedged between two walls",    build_walls,           1, 0.2,   0,    2e3, TENSE,   1.0, CONTACT, 0.1},
  {"ball wedged in a groove",          build_groove,          1, 0.2,   0,    1e4, TENSE,   1.0, CONTACT, 0.1},
  {"funnel with 12 balls",             build_funnel,         12, 0.02,  0,    2e3, RELAXED, 1.0, CONTACT, 0.5},
  {"flap against stops of its hinge",  build_stop,            1, 0.5,   0,    2e3, TENSE,   1.0, TWO,     0.1},
  {"the same, world at 1 kHz",         build_stop,            1, 0.5,   0,    2e3, TENSE,   1.0, CONTACT, 0.1,
     .physics_hz = 1000},
  {"flap, stops that throw back half", build_stop,            1, 0.5,   0.5,  2e3, TENSE,   1.0, CONTACT, 0.1},
  {"flap, stops that throw back all",  build_stop,            1, 0.5,   1.0,  2e3, TENSE,   1.0, CONTACT, 0.1},
  {"cube on a rail with 0.2 mm of play",build_play,           1, 0.2,   1e-4, 2e3, TENSE,   1.0, CONTACT, 0.01},
  {"weight of 1000 links on 4 of them",build_weight,          4, 0.01,  1e3,  2e3, RELAXED, 1.2, CONTACT, 0.2},
  {"closed loop of hinges, redundant", build_loop,            3, 0.2,   0,    2e3, RELAXED, 1.0, TWO,     0.5},
  {"chain of 3",                       build_chain,           3, 0.05,  0,    2e2, RELAXED, 1.2, CONTACT, 0.2},
  /* Where the hand is far, ODE alone has the chain, and at 60 Hz it opens the joints by millimetres. */
  {"chain of 10",                      build_chain,          10, 0.05,  0,    2e2, RELAXED, 1.2, CONTACT, 1.1,
     .late = true},
  /* At 60 Hz ODE alone lets it come apart when it is pushed, with the exact dWorldStep as well. */
  {"chain of 30",                      build_chain,          30, 0.05,  0,    2e2, RELAXED, 1.2, CONTACT, 3.1,
     .late = true, .physics_hz = 250},
  {"light stand of the paper's Fig. 8",build_lightstand,      0, 0,     0,    2e3, RELAXED, 5.6, CONTACT, 0.3},
  /* Single: ODE's explicit gyroscopic term makes energy. */
  {"top at 100 rad/s",                 build_top,             1, 0.2,   100,  2e3, RELAXED, 1.0, CONTACT, 1.0},
  {"top at 1000 rad/s",                build_top,             1, 0.2,   1e3,  2e3, RELAXED, 1.0, CONTACT, 1.0},
  {"plate 100x100x1 mm, at its corner",build_plate,           1, 0.078, 0,    2e3, RELAXED, 1.0, CONTACT, 0.1},
  {"plate 100x100x1 mm in the air",    build_plate_free,      1, 0.078, 0,    2e3, RELAXED, 1.0, CONTACT, 2.0},
  {"1 mm cube of 1e-6 kg",             build_speck,           1, 1e-6,  1e-3, 2e3, RELAXED, 1.0, CONTACT, 1.0},
  {"100 m box of 1e6 kg",              build_block,           1, 1e6,   100,  2e3, TENSE,   1.0, ALL,     0.01},
  /* More of the scene far away: tests/test_offset.c. */
  {"10 km away: cube pushed",          build_push,            1, 0.2,   0,    2e3, TENSE,   1.0, TWO,     0.3,
     .origin = 1e4},
  {"10 km away: row of 10",            build_row,            10, 0.1,   0,    2e3, TENSE,   1.0, CONTACT, 0.2,
     .origin = 1e4},
  /* given, k depth^2 / 2: the spring that the hand starts in. */
  {"50 mm deep at the start",          build_inside,          1, 1.0,   0.05, 2e3, RELAXED, 1.0, CONTACT, 1.0,
     .given = 2.5, .depth = 0.05},
  /* Pointer teleported by 0.5 m; physics stalled 200 ms; 1 to 50 ticks dropped; clock jitter; NaN, Inf,
   * 1e30 from the device: tests/test_faults.c. */
  {"proxy without mass and damping",   build_push,            1, 0.2,   0,    1e4, TENSE,   1.0, CONTACT, 0.3,
     .coupling_stiffness = 500},
  {"cube pushed through a proxy, 9 N", build_push,            1, 1.0,   0,    1e4, TENSE,   1.0, CONTACT, 0.3,
     .device_damping = 0.5},
  {"proxy that hardly couples",        build_push,            1, 0.2,   0,    1e4, TENSE,   1.0, CONTACT, 0.3,
     .coupling_stiffness = 1e-3},
  /* 1e7 ticks, | |q| - 1 | < 1e-12: tests/test_drift.c; in contact: suite long of this program. */
  {"chatter +-1 um, 100 Hz, 2 kN/m",   build_chatter,         1, 0.2,   1e-6, 2e3, RIGID,   1.0, TWO,     0.01},
  {"chatter +-1 um, 100 Hz, 1 MN/m",   build_chatter,         1, 0.2,   1e-6, 1e6, RIGID,   1.0, CONTACT, 0.01},
  {"stick-slip under a ramp",          build_stick_slip,      1, 1.0,   0,    2e3, RELAXED, 1.5, TWO,     0.3},
  {"others near at each sync",         build_brush,          20, 0.2,   0,    2e3, RELAXED, 1.5, CONTACT, 0.2},
  {"neighbour at every other sync",    build_flicker,         2, 0.2,   0,    2e3, RELAXED, 1.0, CONTACT, 4.0},
  /* The upper one falls away from the hand, and ODE, at 60 Hz, into the floor. */
  {"cube destroyed under the hand",    build_destroyed,       2, 0.2,   0,    2e3, RELAXED, 1.0, CONTACT, 0.1,
     .late = true},
  /* More of many at once: tests/test_stability.c and "hapode-bench stability". */
  {"8 neighbours at once",             build_many,            8, 0.1,   0,    1e3, TENSE,   1.0, CONTACT, 0.05},
  {"64 neighbours at once",            build_many,           64, 0.1,   0,    1e3, TENSE,   0.6, CONTACT, 0.05},
  {"bar under 8 pointers",             build_bar,             8, 2.0,   0,    2e3, RELAXED, 1.0, CONTACT, 0.05},
  {"cube squeezed by two pointers",    build_squeeze,         1, 0.2,   0,    2e3, TENSE,   1.0, TWO,     0.2},
  {"pointers at both ends, row of 10", build_row_ends,       10, 0.1,   0,    2e3, TENSE,   1.0, CONTACT, 0.2},
  {"cube fixed to the world",          build_fixed,           1, 0.2,   0,    2e3, TENSE,   1.0, TWO,     0.01},
  {"sleeping cube touched",            build_asleep,          1, 0.2,   0,    2e3, RELAXED, 1.5, TWO,     0.2},
  {"impact through 10 balls within H", build_impacts,        10, 0.1,   0,    2e3, ALONE,   0.5, CONTACT, 2.0},
  {"mu = 0",                           build_push_sliding,    1, 0.2,   0,    2e3, RELAXED, 1.0, TWO,     2.0},
  /* The cube is thrown over its edge, and falls where ODE alone moves it. gain, 0.024: at 60 Hz it comes down a
   * millimetre into the floor, and what it sank by is given back when the loop lifts it out. With the world at
   * 250 Hz and more it is 0.0001. */
  {"mu = infinity",                    build_push_rough,      1, 0.2,   0,    2e3, TENSE,   1.0, TWO,     0.3,
     .gain = 0.026},
  {"mu = infinity, world at 1 kHz",    build_push_rough,      1, 0.2,   0,    2e3, TENSE,   1.0, CONTACT, 0.3,
     .physics_hz = 1000},
  {"CFM 0: cubes on each other",       build_press,           4, 0.2,   0,    2e3, TENSE,   1.0, TWO,     0.02,
     .cfm = -1},
  {"CFM 0: guided row of 10",          build_row,            10, 0.1,   0,    2e3, TENSE,   1.0, CONTACT, 0.2,
     .cfm = -1},
  {"H/T not whole: 37 Hz, row of 10",  build_row,            10, 0.1,   0,    2e3, TENSE,   1.0, CONTACT, 0.2,
     .physics_hz = 37},
  {"H = T: 1 kHz, row of 10",          build_row,            10, 0.1,   0,    2e3, TENSE,   1.0, CONTACT, 0.2,
     .physics_hz = 1000},
  {"device 1 ms late, quantum 30 um",  build_push,            1, 0.2,   0,    1e4, TENSE,   1.0, CONTACT, 0.3,
     .device = "delay=0.001,quantum=3e-5"},
  /* Hands with friction. */
  {"1 g cube rubbed, 100 N/m",         build_rub,             1, 1e-3,  0,    1e2, RELAXED, 1.2, TWO,     1.0,
     .mu = 0.8},
  {"1 g cube rubbed, 1 MN/m",          build_rub,             1, 1e-3,  0,    1e6, TENSE,   1.2, CONTACT, 1.0,
     .coupling_stiffness = 3200, .mu = 0.8},
  {"cube rubbed",                      build_rub,             1, 0.2,   0,    2e3, RELAXED, 1.2, TWO,     0.3,
     .mu = 0.8},
  {"cube rubbed on ice",               build_rub_sliding,     1, 0.2,   0,    2e3, RELAXED, 1.2, TWO,     1.0,
     .mu = 0.8},
  {"1000 kg cube rubbed, 1 MN/m",      build_rub,             1, 1e3,   0,    1e6, TENSE,   1.2, CONTACT, 0.01,
     .mu = 0.8},
  {"1000 kg cube held, mu 10",         build_rub,             1, 1e3,   0,    2e3, RELAXED, 1.2, TWO,     0.01,
     .mu = 10},
  /* gain: of cubes that have fallen, where ODE alone moves them, no hand near. */
  {"stack of 5 rubbed",                build_rub,             5, 0.1,   0,    2e3, RELAXED, 1.2, CONTACT, 0.5,
     .mu = 0.8, .gain = 0.02},
  {"cube rubbed through a proxy",      build_rub,             1, 0.2,   0,    1e4, TENSE,   1.2, CONTACT, 0.3,
     .coupling_stiffness = 1e3, .mu = 0.8},
  {"1 g cube rubbed through a proxy",  build_rub,             1, 1e-3,  0,    1e6, TENSE,   1.2, CONTACT, 1.0,
     .coupling_stiffness = 1e3, .mu = 0.8},
  {"rubbed, 1 ms late, quantum 30 um", build_rub,             1, 0.2,   0,    2e3, RELAXED, 1.2, CONTACT, 0.3,
     .device = "delay=0.001,quantum=3e-5", .mu = 0.8},
  {"ball rolled by a finger",          build_rub_ball,        1, 0.2,   0,    2e3, RELAXED, 1.2, CONTACT, 1.0,
     .mu = 0.8},
  {"top at 100 rad/s rubbed",          build_rub_top,         1, 0.2,   100,  2e3, RELAXED, 1.2, CONTACT, 2.0,
     .mu = 0.5},
  {"cube pinched, lifted, swung",      build_pinch,           1, 0.2,   0,    2e3, TENSE,   2.0, TWO,     0.5,
     .mu = 0.8},
  {"the same with soft fingers",       build_pinch,           1, 0.2,   0,    2e3, TENSE,   2.0, TWO,     0.5,
     .mu = 0.8, .finger = 6e-3},
  {"1 g pinched softly, 1 MN/m",       build_pinch,           1, 1e-3,  0,    1e6, TENSE,   2.0, CONTACT, 1.0,
     .mu = 0.8, .finger = 6e-3},
  {"pinched softly through proxies",   build_pinch,           1, 0.05,  0,    1e4, TENSE,   2.0, CONTACT, 0.5,
     .coupling_stiffness = 1e3, .mu = 0.8, .finger = 6e-3},
  /* gain: what the shares of the tool's points make when it tilts under load (docs/numerics.md); the energy
   * observer, which is off here, gives none of it to the hand: tests/test_tool_bodies.c. */
  {"tool on a wall, 2 kN/m",           build_tool_press,      0, 0,     0,    2e3, RELAXED, 1.4, TWO,     0.01,
     .gain = 0.05},
  {"tool on a wall, 1 MN/m",           build_tool_press,      0, 0,     0,    1e6, TENSE,   1.4, CONTACT, 0.01},
  {"tool on a stack of 5 light cubes", build_tool_press,      5, 5e-3,  0,    2e3, RELAXED, 1.4, CONTACT, 0.05,
     .gain = 0.05},
  {"tool on a stack, 1 MN/m",          build_tool_press,      3, 5e-3,  0,    1e6, TENSE,   1.4, CONTACT, 0.05},
  {"tool wedged between walls",        build_tool_wedge,      0, 0,     0,    2e3, RELAXED, 1.1, TWO,     0.01},
  {"tool wedged between walls, 1 MN/m",build_tool_wedge,      0, 0,     0,    1e6, TENSE,   1.1, CONTACT, 0.01},
  {"tool rubs a wall, 2 kN/m",         build_tool_rub,        0, 0,     0,    2e3, RELAXED, 2.0, TWO,     0.01,
     .mu = 0.8},
  {"tool rubs a wall, soft finger",    build_tool_rub,        0, 0,     0,    2e3, RELAXED, 2.0, TWO,     0.01,
     .mu = 0.8, .finger = 6e-3},
  {"tool rubs a wall, 1 MN/m",         build_tool_rub,        0, 0,     0,    1e6, TENSE,   2.0, CONTACT, 0.01,
     .mu = 0.8},
  {"tool rubs a cube",                 build_tool_rub,        1, 0.2,   0,    2e3, RELAXED, 2.0, TWO,     0.3,
     .mu = 0.8},
  {"tool rubs a 1 g cube, 1 MN/m",     build_tool_rub,        1, 1e-3,  0,    1e6, TENSE,   2.0, CONTACT, 1.0,
     .mu = 0.8},
  {"tool rubs a 1000 kg cube, 1 MN/m", build_tool_rub,        1, 1e3,   0,    1e6, TENSE,   2.0, CONTACT, 0.01,
     .mu = 0.8},
  /* gain: again the shares, which change between points that have been pulled along by unlike ways. */
  {"tool holds a 1000 kg cube, mu 10", build_tool_rub,        1, 1e3,   0,    2e3, RELAXED, 2.0, TWO,     0.01,
     .mu = 10, .gain = 0.02},
  {"tool rubs a stack of 5",           build_tool_rub,        5, 0.1,   0,    2e3, RELAXED, 2.0, CONTACT, 0.5,
     .mu = 0.8},
  {"tool rubs through a proxy",        build_tool_rub,        1, 0.2,   0,    1e4, TENSE,   2.0, CONTACT, 0.3,
     .coupling_stiffness = 1e3, .mu = 0.8, .finger = 6e-3},
  {"tool rubs, 1 ms late, 30 um",      build_tool_rub,        1, 0.2,   0,    2e3, RELAXED, 2.0, CONTACT, 0.3,
     .device = "delay=0.001,quantum=3e-5", .mu = 0.8},
  {"cube pinched by flat fingers",     build_tool_pinch,      1, 0.2,   0,    2e3, TENSE,   2.0, TWO,     0.5,
     .mu = 0.8},
  {"1 g in flat fingers, 1 MN/m",      build_tool_pinch,      1, 1e-3,  0,    1e6, TENSE,   2.0, CONTACT, 1.0,
     .mu = 0.8},
  {"flat fingers, proxies",            build_tool_pinch,      1, 0.05,  0,    1e4, TENSE,   2.0, CONTACT, 0.5,
     .coupling_stiffness = 1e3, .mu = 0.8, .finger = 6e-3},
  /* Hand-over between two threads: the sessions of tests/test_exchange.c under the thread sanitizer. */
};
/* clang-format on */

const size_t stability_case_count = sizeof stability_cases / sizeof stability_cases[0];
