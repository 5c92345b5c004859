/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_BENCH_H
#define HAPODE_BENCH_BENCH_H

/* What the programs of hapode-bench share: the run's options, tables, checks, pictures. */

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include <hapode/attributes.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/status.h>

#define BENCH_COUNT(array) (sizeof(array) / sizeof((array)[0]))

typedef struct bench {
  const char *out;   /* folder of tables and pictures */
  bool quick;        /* shorter sweeps, fewer repeats */
  bool verify;       /* say "ok" or "off" */
  const char *scene; /* accuracy, tick: this one alone; NULL: all */
  const char *only;  /* stability: such points alone, KEY=VALUE,...; NULL: all */
  const char
      *coupling; /* accuracy, impedance: a name of hap_coupling that is measured as well; NULL:
                              none */
  size_t shard;  /* accuracy: 1 .. shards, the part that is measured */
  size_t shards; /* 0: all of it */
  const char *const *merge; /* accuracy: files of shards to make the table of; NULL: measure */
  size_t merge_count;
  const char *estimates; /* accuracy: all, default: rows beside which the session's own estimate is
                            measured; NULL: with quick those of the default, else all */
  long random_worlds;    /* faults: so many of them in place of the scenes; 0: the scenes */
  bool fresh;            /* accuracy: do not go on from what an earlier run has finished */
  int off;               /* checks that were off */
  hap_detail detail;     /* why a program failed */
} bench;

/* Status, and on failure a text in bench.detail. */
typedef hap_status (*bench_fn)(bench *b);

hap_status bench_accuracy(bench *b);
hap_status bench_app(bench *b);
hap_status bench_couplings(bench *b);
hap_status bench_edits(bench *b);
hap_status bench_effects(bench *b);
hap_status bench_faults(bench *b);
hap_status bench_fig5(bench *b);
hap_status bench_fig6(bench *b);
hap_status bench_fig7(bench *b);
hap_status bench_hosting(bench *b);
hap_status bench_impedance(bench *b);
hap_status bench_influence(bench *b);
hap_status bench_input(bench *b);
hap_status bench_jitter(bench *b);
hap_status bench_late(bench *b);
hap_status bench_line(bench *b);
hap_status bench_oscillation(bench *b);
hap_status bench_peers(bench *b);
hap_status bench_poses(bench *b);
hap_status bench_remote(bench *b);
hap_status bench_scaling(bench *b);
hap_status bench_spidar(bench *b);
hap_status bench_spread(bench *b);
hap_status bench_stability(bench *b);
hap_status bench_stopped(bench *b);
hap_status bench_tail(bench *b);
hap_status bench_tick(bench *b);

/* ---- tables, checks ---- */

/* Opens OUT/NAME.csv and writes its header line, NULL: none; NULL on failure. */
FILE *bench_csv_open(bench *b, const char *name, const char *header);
/* status, or where that is good how the table was written. NULL: what open said. */
hap_status bench_csv_close(bench *b, FILE *csv, hap_status status);

hap_status bench_fail(bench *b, hap_status status, const char *format, ...) HAP_PRINTF(3, 4);

/* status; of a bad one bench.detail has what the session says. */
hap_status bench_explain(bench *b, hap_session *session, hap_status status);

/* s of the processor that the calling thread has used. */
double bench_used_seconds(void);

/* One with a spring, by its name; false: there is none. */
bool bench_find_coupling(const char *name, hap_coupling *out);

/* A measured number as a line of stdout. */
void bench_say(const char *format, ...) HAP_PRINTF(1, 2);

/* The same for a number that has a bound: with --verify the line begins with "ok" or "off". */
void bench_check(bench *b, bool good, const char *format, ...) HAP_PRINTF(3, 4);

/* What --verify cannot check, and why. */
void bench_skip(const bench *b, const char *format, ...) HAP_PRINTF(2, 3);

double bench_median(double *values, size_t count);                       /* sorts; 0 of none */
double bench_quantile(const double *sorted, size_t count, double share); /* 0 of none */
double bench_percent(double value, double wanted);                       /* off, signed */
bool bench_within(double value, double wanted, double relative);         /* false for NaN */

/* ---- pictures ---- */

/* What a picture shows, as gnuplot's words, see tools/plot.h. */
typedef void (*bench_draw_fn)(FILE *script, const void *data);

/* OUT/NAME.svg. Without gnuplot one line says that there is no picture, and the status is good. */
hap_status bench_draw(bench *b, const char *name, int width, int height, bench_draw_fn draw,
                      const void *data);

#endif
