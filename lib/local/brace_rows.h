/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_BRACE_ROWS_H
#define HAPODE_LOCAL_BRACE_ROWS_H

/* What braces bodies outside of the range, as rows: one for each, model CONTACT. */

#include "local/rows.h"

void hapi_brace_rows(const hapi_bodies *bodies, hapi_rows *rows, double period);

#endif
