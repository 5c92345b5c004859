/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_DDS_DOMAIN_H
#define HAPODE_PLUGINS_DDS_DOMAIN_H

/* What a link needs of DDS before it has topics: a domain with settings, a participant with
 * certificates. */

#include <dds/dds.h>

#include <hapode/link_dds.h>

/* Any thread. A participant of the domain that def asks for, which it makes where it is not there
 * yet. Errors as of hap_link_dds_serve. */
hap_status link_domain_join(const hap_link_dds_def *def, dds_entity_t *out_participant,
                            hap_detail *detail);
/* Whom DDS tells its warnings while there are domains; NULL: stderr. */
void link_domain_listen(void (*say)(uint32_t error, const char *text));
/* Ends the participant, and the domain with the last one. */
void link_domain_leave(uint32_t domain, dds_entity_t participant);

/* Sets *detail and gives status back. */
hap_status link_fail(hap_detail *detail, hap_status status, const char *format, ...)
    HAP_PRINTF(3, 4);

#endif
