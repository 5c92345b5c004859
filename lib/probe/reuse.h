/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_REUSE_H
#define HAPODE_PROBE_REUSE_H

/* Testing simulations that need not be made again (hap_expert_def.reuse). All that decides what
 * they find is written down when they are made: of the world, of each body of the island, of its
 * contacts, joints and pushes. At the next step it is written down anew and compared value by
 * value. No flag says that something has changed, as the application may change anything. */

#include "probe/reuse_book.h"

bool hapi_reuse_create(hapi_reuse *reuse, const hapi_capacity *capacity);
void hapi_reuse_finish(hapi_reuse *reuse);
void hapi_reuse_reset(hapi_reuse *reuse);
/* Before the collision phase, whose contacts must be noted where it returns true. allowed: false
 * measures all anew. */
bool hapi_reuse_open(hapi_reuse *reuse, const hapi_cycle *cycle, bool allowed);
/* After the islands of a round are gathered: which of them were tested before and are as they
 * were. */
void hapi_reuse_look(hapi_reuse *reuse, hapi_reuse_book *book, const hapi_reuse_input *input,
                     const hapi_pushed *pushed);
bool hapi_reuse_has(const hapi_reuse_book *book, hapi_reuse_kind kind);
/* Of the island of a body; HAPI_REUSE_NONE where it is not under test. */
hapi_reuse_kind hapi_reuse_kind_of(const hapi_reuse_book *book, const hapi_test_set *test,
                                   uint32_t known);
/* Islands of other kinds leave the test set, and what is pushed in them; gathered again they are
 * there. */
void hapi_reuse_select(const hapi_reuse_book *book, hapi_reuse_kind kind, const hapi_slots *slots,
                       hapi_test_set *test, hapi_pushed *pushed);
/* The island of a body under test: what was found is no good, and nothing of it is used again. */
void hapi_reuse_spoil(hapi_reuse_book *book, const hapi_test_set *test, uint32_t known);
/* Last, unless it failed. Returns how much of what is pushed was not measured anew. */
uint32_t hapi_reuse_keep(hapi_reuse_book *book);

#endif
