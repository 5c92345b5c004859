/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_PACKS_H
#define HAPODE_SOLVER_PACKS_H

/* Contacts of four pairs of bodies side by side, so that a sweep takes four rows at once. What is
 * side by side must not have a body in common: the pairs of bodies get colours, of which no body
 * has one twice, and a pack is of one colour. A sweep takes the rows without a pack first, then the
 * colours one after the other. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "solver/row.h"

#define HAPI_LANES 4u
#define HAPI_NO_PLACE UINT32_MAX
#define HAPI_NO_PACKABLE UINT32_MAX

/* Contacts of a pack, at most: one below the other, of the same two bodies and directions. */
#define HAPI_PACK_CONTACTS 4u

/* Three rows a lane: normal, then two frictions. An empty lane has zeros. */
typedef struct hapi_pack_contact {
  double arm[3][HAPI_LANES];   /* m, from a's centre, along the directions; of left-handed ones the
                                opposite, as of all that follows from it */
  double drive[3][HAPI_LANES]; /* this and the next: see hapi_row */
  double softness[3][HAPI_LANES];
  double inverse[3][HAPI_LANES];
  double response[3][HAPI_LANES];
  double mu[2][HAPI_LANES];
  double load[HAPI_LANES];        /* N s, that frictions go by at least */
  double coupling[3][HAPI_LANES]; /* of rows 0 and 1, 0 and 2, 1 and 2 */
} hapi_pack_contact;

/* Of two contacts of a pack: what an impulse of the earlier one's row (second index) changes at the
 * later one's (first index), (m/s)/(N s). The way back is the transpose. */
typedef struct hapi_pack_block {
  double of[3][3][HAPI_LANES];
} hapi_pack_block;

/* The directions of the rows are those of all contacts of a lane, at right angles and of length 1.
 * So a contact is three numbers, its arm, and what it does to the others follows from the motion of
 * the bodies against each other at a's centre. */
typedef struct hapi_pack {
  double direction[3][3][HAPI_LANES]; /* of a's rows; b's are opposite */
  double mass_a[HAPI_LANES];          /* inverse, 1/kg */
  double turn_a[6][HAPI_LANES];       /* inverse inertia, world, 1/(kg m^2): xx xy xz yy yz zz */
  double mass_b[HAPI_LANES];          /* this and what else is of b: where it responds only */
  double turn_b[6][HAPI_LANES];
  double across[3][HAPI_LANES];     /* m, from b's centre to a's: world, */
  double arms_apart[3][HAPI_LANES]; /* and as the arms, which are longer by it from b's centre */
  uint32_t a[HAPI_LANES];           /* six times the bodies; empty lanes: 0 */
  uint32_t b[HAPI_LANES];
  uint32_t first; /* contact, and how many one below the other */
  uint32_t count;
  uint32_t block;   /* its first; that of contacts i < j is j (j - 1) / 2 + i on */
  bool paired;      /* b responds */
  bool beside;      /* it and another one next to it have one color and count */
  bool stale;       /* blocks are still those of other arms */
  uint32_t fill[4]; /* not used: all is a multiple of a register, so that none is in two lines */
} hapi_pack;

/* A contact that may be packed: where its rows are, and where it is now. */
typedef struct hapi_packable {
  uint32_t row; /* its normal's */
  uint32_t a;
  uint32_t b;
  uint32_t place; /* contact x HAPI_LANES + lane; HAPI_NO_PLACE: in no pack */
  uint32_t pack;
  uint32_t unit; /* that it belongs to */
  uint64_t made; /* see hapi_row, of what was packed */
} hapi_packable;

/* A packable contact whose rows changed since the last run. */
typedef struct hapi_pack_news {
  uint32_t which; /* index into packables */
  uint32_t row;   /* its normal's */
  bool made;      /* rows made anew; false: same rows, other targets */
} hapi_pack_news;

/* Successive packable contacts of the same bodies and directions, HAPI_PACK_CONTACTS at most. */
typedef struct hapi_pack_unit {
  uint32_t first; /* packable, and how many */
  uint32_t count;
  uint8_t color;
  bool paired;
} hapi_pack_unit;

/* Rows that are in no pack, from one of them to before another. */
typedef struct hapi_loose_rows {
  uint32_t first;
  uint32_t end;
} hapi_loose_rows;

/* Of a sweep's rows. */
typedef struct hapi_corrections {
  double largest; /* m/s */
  double energy2; /* J, sum of impulse^2 x response */
  double opening; /* m/s, largest of rows without bounds, as those of joints are */
} hapi_corrections;

/* By lane, J: see solver_calm.c. */
typedef struct hapi_pack_ray {
  double a[HAPI_LANES];
  double b[HAPI_LANES];
  double size[HAPI_LANES];
} hapi_pack_ray;

/* Blocks of so many contacts, at most. */
#define HAPI_PACK_BLOCKS(contacts) ((size_t)(contacts) * (HAPI_PACK_CONTACTS - 1) / 2 + 1)

struct hapi_aggregate; /* solver/aggregate.h */
struct hapi_aggregate_row;
struct hapi_packs;

/* Of direct solves, by contact: rows and lanes (island_packs.h). */
typedef struct hapi_pack_newton {
  double (*state)[3][HAPI_LANES]; /* 0 fixed, 1 free, 2 tied to its normal */
  double (*gain)[3][HAPI_LANES];
  double (*error)[3][HAPI_LANES];
  double (*saved)[3][HAPI_LANES]; /* impulses */
} hapi_pack_newton;

/* What an inspection has seen, see island.h. */
typedef struct hapi_pack_look {
  double largest;
  double energy2;
  double sum;    /* no number, if one of the rows' was */
  uint32_t free; /* rows */
  bool changed;
  bool outside;
} hapi_pack_look;

/* The 6x6 blocks of a matrix that a pack's lanes add to: of the bodies that answer, and those that
 * move. */
typedef struct hapi_pack_targets {
  double *aa[HAPI_LANES];
  double *ab[HAPI_LANES]; /* this and the next two: where b responds */
  double *ba[HAPI_LANES];
  double *bb[HAPI_LANES];
} hapi_pack_targets;

/* How the packs are worked on; by what the processor can, with the same bits. */
typedef struct hapi_pack_work {
  /* Sets the blocks of packs that are stale. */
  void (*couple)(struct hapi_packs *packs);
  /* Adds what the impulses do to v. */
  void (*push)(const struct hapi_packs *packs, double (*v)[6]);
  void (*sweep)(const struct hapi_packs *packs, double (*v)[6], bool forward, hapi_corrections *io);
  /* See sweep_way in contact_solver.c: the next begin. */
  void (*way_go_on)(double *now, double *begin, double *way, double share, size_t count);
  /* The rows of all lanes, HAPI_LANES a pack. */
  void (*aggregate)(const struct hapi_packs *packs, double (*v)[6], struct hapi_aggregate_row *out);
  /* Of one pack. */
  void (*ray)(const struct hapi_packs *packs, uint32_t index, double (*free)[6], double (*v)[6],
              hapi_pack_ray *out);
  /* Of direct solves, see island.h: states and errors; */
  void (*inspect)(const struct hapi_packs *packs, const hapi_pack_newton *newton, double (*v)[6],
                  bool sticking, hapi_pack_look *out);
  /* errors alone; */
  void (*miss)(const struct hapi_packs *packs, double (*v)[6], double (*out)[3][HAPI_LANES]);
  void (*gains)(const struct hapi_packs *packs, const hapi_pack_newton *newton, double softening);
  /* impulses at their bounds, of rows that are not free, or newton NULL, of all; returns how much
   * they changed, N s; */
  double (*cut)(const struct hapi_packs *packs, const hapi_pack_newton *newton, double (*v)[6]);
  /* the right side, added to dv by body; */
  void (*ask)(const struct hapi_packs *packs, const hapi_pack_newton *newton, double (*dv)[6]);
  /* the matrix, of one pack; */
  void (*assemble)(const struct hapi_packs *packs, const hapi_pack_newton *newton, uint32_t index,
                   const hapi_pack_targets *to);
  /* impulses from the saved ones and from dv by body. v: with the saved ones. */
  void (*answer)(const struct hapi_packs *packs, const hapi_pack_newton *newton, double (*dv)[6],
                 double (*v)[6]);
  /* Of island_matrix.c, which has them without packs as well: columns = (L U)^-1 columns, */
  void (*block_solve)(const double split[36], double io[36]);
  /* and io -= a b. */
  void (*block_multiply_sub)(const double a[36], const double b[36], double io[36]);
} hapi_pack_work;

/* What is known of the rows. */
typedef struct hapi_packed_rows {
  uint64_t made;      /* see hapi_row, the last one; counts also rows that went to another place */
  uint64_t filled;    /* the last one when the packs were filled, */
  uint32_t ready;     /* contacts that may be packed, of the rows so far */
  uint32_t held;      /* and when the packs were filled */
  uint32_t row_count; /* all rows, when the packs were made */
  uint32_t body_count;
  bool anew;     /* the packs are others since all pairs were planned (solver/aggregate.h) */
  bool alike;    /* packs hold the same values as the rows, except for the news */
  uint32_t news; /* how many */
} hapi_packed_rows;

/* Scratch, while the packs are made. */
typedef struct hapi_pack_plan {
  uint32_t *order; /* of the units; HAPI_LANES x contact_capacity, as the next */
  uint32_t *sorted;
  uint32_t *levels; /* by body, as the next: contacts between it and what does not respond */
  uint64_t *colors; /* one bit each */
} hapi_pack_plan;

typedef struct hapi_packs {
  const hapi_pack_work *work; /* NULL: nothing is packed */
  hapi_pack *of;              /* contact_capacity, as the next four */
  hapi_pack_contact *contacts;
  hapi_pack_block *blocks;          /* HAPI_PACK_BLOCKS(contact_capacity) */
  double (*impulse)[3][HAPI_LANES]; /* N s, by contact */
  hapi_packable *packables;         /* HAPI_LANES x contact_capacity, as the next three */
  hapi_pack_news *news;             /* since the last call of hapi_packs_begin */
  hapi_pack_unit *units;
  hapi_loose_rows *loose;
  hapi_pack_plan plan;
  double (*inverse_inertia)[9]; /* in: by body, of what answers by its mass: world, 1/(kg m^2) */
  struct hapi_aggregate *aggregate; /* NULL: no steps of all pairs */
  uint32_t contact_capacity;
  uint32_t body_capacity;
  uint32_t count; /* packs; 0: all rows are loose */
  uint32_t contact_count;
  uint32_t block_count;
  uint32_t packable_count;
  uint32_t unit_count;
  uint32_t loose_count;
  uint32_t loose_rows;
  uint32_t height; /* the highest level; 0: not known */
  bool in_use;     /* in a run: the impulses of packed rows are here */
  bool ahead;      /* after it: they are still here, and the rows have those from before */
  hapi_packed_rows known;
} hapi_packs;

extern const hapi_pack_work hapi_pack_work_pairs;       /* on every processor */
extern const hapi_pack_work *const hapi_pack_work_avx2; /* NULL: not built */

/* The packs of these rows, with their impulses; those of the last call stay where they hold.
 * False: nothing is packed. Rows that are in another place than at the last call have their
 * impulses; of others those in the packs count where they are ahead. */
bool hapi_packs_begin(hapi_packs *packs, hapi_row *rows, uint32_t row_count, uint32_t body_count);
/* The impulses to the rows, and back. */
void hapi_packs_store(hapi_packs *packs, hapi_row *rows);
void hapi_packs_load(const hapi_packs *packs, const hapi_row *rows);
/* A run ends: the impulses stay in the packs, and the rows are not to be asked for them. */
void hapi_packs_end(hapi_packs *packs, hapi_row *rows);
/* Between two runs: the impulses that are ahead come to the rows that are where they were. Others
 * may have been written over them, and have their own. */
void hapi_packs_give_back(hapi_packs *packs, hapi_row *rows);
/* Nothing is known of any rows. */
void hapi_packs_forget(hapi_packs *packs);

/* Of the three rows of a contact, N s: `step` doubles apart. */
typedef struct hapi_impulses {
  const double *of;
  size_t step;
} hapi_impulses;

/* After a run. which: index into packables; row: the normal's, of the same contact. */
static inline hapi_impulses hapi_packs_impulses(const hapi_packs *packs, uint32_t which,
                                                const hapi_row *row)
{
  if (packs->ahead && which < packs->packable_count &&
      packs->packables[which].place != HAPI_NO_PLACE) {
    uint32_t place = packs->packables[which].place;
    return (hapi_impulses){&packs->impulse[place / HAPI_LANES][0][place % HAPI_LANES], HAPI_LANES};
  }
  return (hapi_impulses){&row->impulse, sizeof *row / sizeof(double)};
}

static inline void hapi_packs_add_news(hapi_packs *packs, hapi_pack_news news)
{
  hapi_packed_rows *known = &packs->known;
  known->alike = known->alike && known->news < HAPI_LANES * packs->contact_capacity;
  if (known->alike) {
    packs->news[known->news++] = news;
  }
}

/* Says that the next packable contact has changed; they are counted in the order of their rows.
 * row: its normal's. */
static inline void hapi_packs_note(hapi_packs *packs, uint32_t row, bool made)
{
  hapi_packs_add_news(packs, (hapi_pack_news){packs->known.ready++, row, made});
}

#endif
