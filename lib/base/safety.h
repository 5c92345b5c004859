/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_SAFETY_H
#define HAPODE_BASE_SAFETY_H

/* The safety constants: numbers that decide how much force a hand gets, and for how long. Reasons
 * are in the table of docs/safety.md. A test compares the table with this file: name, value, unit.
 *
 * Here and not in lib/guard, as the pointer, the contacts and the plugins have some of them. */

/* ---- a plausible device ---- */
#define HAPI_SAFETY_SPEED_LIMIT 10.0  /* m/s */
#define HAPI_SAFETY_SPIN_LIMIT 100.0  /* rad/s */
#define HAPI_SAFETY_JUMP_S 0.01       /* s */
#define HAPI_SAFETY_STATE_LIMIT 1e6   /* m, m/s, rad/s */
#define HAPI_SAFETY_WRENCH_LIMIT 1e12 /* N, N m */

/* ---- a plausible input ---- */
#define HAPI_SAFETY_ACCELERATION_LIMIT 500.0 /* m/s^2 */
#define HAPI_SAFETY_SWING_LIMIT 300.0        /* m/s^2 */
#define HAPI_SAFETY_STALE_SPEED 0.1          /* m/s */
#define HAPI_SAFETY_CARRY_S 0.004            /* s */
#define HAPI_SAFETY_CARRY_SPEED 1.0          /* m/s */
#define HAPI_SAFETY_CARRY_SPIN 10.0          /* rad/s */
#define HAPI_SAFETY_SPIN_CHANGE 50.0         /* rad/s */
#define HAPI_SAFETY_CONFIRM_S 0.003          /* s */
#define HAPI_SAFETY_JUMP_LEAST 0.0005        /* m */
#define HAPI_SAFETY_DOUBT_FADE_S 0.014       /* s */
#define HAPI_SAFETY_UNEXPLAINED_S 0.03       /* s */
#define HAPI_SAFETY_HANDLE 0.05              /* m */
#define HAPI_SAFETY_MISFIT_S 0.3             /* s */
#define HAPI_SAFETY_JUDGE_S 1e-3             /* s */
#define HAPI_SAFETY_QUANTA 3.0               /* 1 */
#define HAPI_SAFETY_STEP_LEAST 2e-5          /* m */
#define HAPI_SAFETY_GAP_MOST_S 0.02          /* s */
#define HAPI_SAFETY_REST_GAPS 2.0            /* 1 */
#define HAPI_SAFETY_VOTE_TICKS 3.5           /* 1 */
#define HAPI_SAFETY_SOON_SHARE 0.5           /* 1 */
#define HAPI_SAFETY_SURE_SHARE 0.25          /* 1 */
#define HAPI_SAFETY_UNREAD_S 0.02            /* s */
#define HAPI_SAFETY_READ_LATE_S 0.002        /* s */
#define HAPI_SAFETY_DOUBT_FORGET 0.25        /* 1 */
#define HAPI_SAFETY_STRING_SHARE 2.0         /* 1 */
#define HAPI_SAFETY_STALE_QUANTA 6.0         /* 1 */
#define HAPI_SAFETY_SILENCE_S 0.01           /* s */
#define HAPI_SAFETY_AXIS_SPEED 100.0         /* 1/s */
#define HAPI_SAFETY_AXIS_BEYOND 0.05         /* 1 */

/* ---- how fast force comes and goes ---- */
#define HAPI_SAFETY_SLEW_S 0.002     /* s */
#define HAPI_SAFETY_RAMP_IN_S 0.02   /* s */
#define HAPI_SAFETY_FADE_S 0.1       /* s */
#define HAPI_SAFETY_AGE_LEAST_S 0.01 /* s */
#define HAPI_SAFETY_SET_S 0.02       /* s */
#define HAPI_SAFETY_LIMIT_S 0.1      /* s */
#define HAPI_SAFETY_BASE_S 0.05      /* s */

/* ---- late ticks ---- */
#define HAPI_SAFETY_LATE_GAP_S 0.005     /* s */
#define HAPI_SAFETY_LATE_FEW_SHARE 0.03  /* 1 */
#define HAPI_SAFETY_LATE_FEW_S 0.03      /* s */
#define HAPI_SAFETY_LATE_GAP_DECAY_S 0.2 /* s */
#define HAPI_SAFETY_LATE_DOWN_S 0.004    /* s */
#define HAPI_SAFETY_LATE_SLEW_S 0.0125   /* s */
#define HAPI_SAFETY_LATE_HOLD_S 0.08     /* s */
#define HAPI_SAFETY_LATE_BACK_S 0.1      /* s */
#define HAPI_SAFETY_LATE_GAP_MOST_S 0.05 /* s */
#define HAPI_SAFETY_LATE_SHARE 0.5       /* 1 */
#define HAPI_SAFETY_LATE_LOST_S 0.2      /* s */

/* ---- contacts that arrive deep ---- */
#define HAPI_SAFETY_CONTACT_RAMP_S 0.02     /* s */
#define HAPI_SAFETY_CONTACT_DEPTH 0.01      /* m */
#define HAPI_SAFETY_CONTACT_SPEED 0.2       /* m/s */
#define HAPI_SAFETY_CONTACT_PRESS_MOST 10.0 /* m/s */
#define HAPI_SAFETY_TEXTURE_HEIGHT 0.003    /* m */
#define HAPI_SAFETY_IMPACT_FORCE 5.0        /* N */
#define HAPI_SAFETY_IMPACT_POWER 1.0        /* W */
#define HAPI_SAFETY_ADHESION_WAY 0.01       /* m */

/* ---- a grip ---- */
#define HAPI_SAFETY_GRAB_SPEED 0.5  /* m/s */
#define HAPI_SAFETY_GRAB_SPIN 5.0   /* rad/s */
#define HAPI_SAFETY_GRAB_WAIT_S 1.0 /* s */

/* ---- energy ---- */
#define HAPI_SAFETY_OVERDRAFT 0.006      /* 1 */
#define HAPI_SAFETY_OVERDRAFT_LEAST 1e-5 /* J */
#define HAPI_SAFETY_DEBT_AFTER_S 0.3     /* s */
#define HAPI_SAFETY_DEBT_S 0.3           /* s */
#define HAPI_SAFETY_SHAKE_LARGE 0.1      /* 1 */
#define HAPI_SAFETY_SHAKE_S 0.009        /* s */

/* ---- what is declared beside contacts ---- */
#define HAPI_SAFETY_POWER_S 0.1     /* s */
#define HAPI_SAFETY_OWN_SPEED 1.0   /* m/s */
#define HAPI_SAFETY_OWN_SPIN 10.0   /* rad/s */
#define HAPI_SAFETY_OWN_SLIP 1e-4   /* m */
#define HAPI_SAFETY_AXIS_DRIVE 2.0  /* 1/s */
#define HAPI_SAFETY_OWN_MASS 0.05   /* kg */
#define HAPI_SAFETY_OWN_DAMPING 0.5 /* 1 */
#define HAPI_SAFETY_OWN_ANSWER 0.3  /* 1 */
#define HAPI_SAFETY_MAGNET_LAG 0.9  /* 1 */
#define HAPI_SAFETY_CALL_SHARE 0.1  /* 1 */
#define HAPI_SAFETY_CALL_LATE 2.5   /* 1 */
#define HAPI_SAFETY_CALL_FORGET 0.5 /* 1/s */

/* ---- a device that swings by itself, or runs away ---- */
#define HAPI_SAFETY_SWING_LARGE 0.2      /* 1 */
#define HAPI_SAFETY_SWING_LEAST_HZ 3.5   /* Hz */
#define HAPI_SAFETY_SWING_HZ 9.0         /* Hz */
#define HAPI_SAFETY_SWING_ALIKE 0.7      /* 1 */
#define HAPI_SAFETY_SWING_KEPT 0.95      /* 1 */
#define HAPI_SAFETY_SWING_OWN 0.96       /* 1 */
#define HAPI_SAFETY_SWING_STIFFER 1.2    /* 1 */
#define HAPI_SAFETY_SWING_FED 0.15       /* 1 */
#define HAPI_SAFETY_SWING_FAST_S 0.008   /* s */
#define HAPI_SAFETY_SWING_LATE 0.1       /* 1 */
#define HAPI_SAFETY_SWING_LEAST 0.1      /* 1 */
#define HAPI_SAFETY_SWING_DOWN_S 0.02    /* s */
#define HAPI_SAFETY_SWING_HOLD_S 0.5     /* s */
#define HAPI_SAFETY_SWING_BACK_S 1.0     /* s */
#define HAPI_SAFETY_SWING_HALVES 6.0     /* 1 */
#define HAPI_SAFETY_SWING_FORGET 0.2     /* 1/s */
#define HAPI_SAFETY_RUNAWAY_BEGIN 0.08   /* 1 */
#define HAPI_SAFETY_RUNAWAY_FULL 0.24    /* 1 */
#define HAPI_SAFETY_RUNAWAY_KEPT 0.75    /* 1 */
#define HAPI_SAFETY_RUNAWAY_LEAP 0.75    /* 1 */
#define HAPI_SAFETY_RUNAWAY_MASS 1.0     /* kg */
#define HAPI_SAFETY_RUNAWAY_DOWN_S 0.005 /* s */
#define HAPI_SAFETY_RUNAWAY_ASK_S 0.006  /* s */
#define HAPI_SAFETY_RUNAWAY_LEFT 0.4     /* 1 */

/* ---- a loop that stands still ---- */
#define HAPI_SAFETY_LOOK_S 0.005      /* s */
#define HAPI_SAFETY_BLOCKED_S 0.035   /* s */
#define HAPI_SAFETY_BLOCKED_TICKS 4.0 /* 1 */
#define HAPI_SAFETY_UNWOKEN_S 0.1     /* s */
#define HAPI_SAFETY_STOP_WAIT_S 1.0   /* s */

/* ---- a device that a thread talks to ---- */
#define HAPI_SAFETY_SILENT_S 0.01   /* s */
#define HAPI_SAFETY_LOST_S 0.06     /* s */
#define HAPI_SAFETY_UNWRITTEN_S 0.1 /* s */

/* ---- the SPIDAR's guard process ---- */
#define HAPI_SAFETY_GUARD_LOOK_S 0.02  /* s */
#define HAPI_SAFETY_GUARD_STALL_S 0.5  /* s */
#define HAPI_SAFETY_GUARD_ROUNDS 4     /* 1 */
#define HAPI_SAFETY_GUARD_WAIT_S 600.0 /* s */

#endif
