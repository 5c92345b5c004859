/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LINK_LINK_INTERNAL_H
#define HAPODE_LINK_LINK_INTERNAL_H

#include <hapode/link.h>

/* The transport's own, where the link is of these operations; else NULL. link may be NULL. */
void *hapi_link_self(const hap_link *link, const hap_link_ops *ops);

#endif
