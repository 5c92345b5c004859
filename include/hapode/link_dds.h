/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LINK_DDS_H
#define HAPODE_LINK_DDS_H

/* Links (hapode/link.h) over a network, by DDS: the library Eclipse Cyclone DDS. It is in a module
 * of its own, hapode-link-dds.so, which is loaded by the calls below; the library needs nothing of
 * it (docs/remote.md).
 *
 * Without certificates a link goes over the loopback interface alone, so to other processes of the
 * same machine. Whoever may send there can join and be a world; so can everybody on the network
 * with insecure set. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/link.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* A link over DDS. It has a size and may grow at its end. Texts are copied. */
typedef struct hap_link_dds_def {
  uint32_t size;   /* set by hap_link_dds_def_init */
  uint32_t cookie; /* set by hap_link_dds_def_init */
  /* Of the world: links of another world do not meet. 1..63 letters, digits, '.', '_' and '-'.
   * Default "world" */
  const char *world;
  /* Of a client, told to the server: at most HAP_LINK_NAME_MOST letters, digits, spaces, '.', '_'
   * and '-'. Default "hand" */
  const char *name;
  /* Folder of DDS Security: identity_ca.pem, certificate.pem, key.pem, permissions_ca.pem,
   * governance.p7s, permissions.p7s. Whoever has none of the same authorities cannot join, and
   * cannot listen, as far as the governance says. NULL (default): none, loopback alone */
  const char *certificates;
  uint32_t insecure; /* 1: over the network without certificates. Default 0 */
  uint32_t domain;   /* of DDS, 0..230, default 67. One process has one kind of link in each */
  /* Network interface by its name or address; NULL (default): DDS chooses. On the loopback
   * interface, where neither certificates nor insecure are given */
  const char *interface_name;
  /* Addresses of other machines with a comma between them, where multicast does not reach them.
   * NULL (default): multicast */
  const char *peers;
  /* Whole path of the module. NULL (default): beside the library or the program, or in the folder
   * of libraries beside the program's */
  const char *module;
} hap_link_dds_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_link_dds_def_init(hap_link_dds_def *def, size_t size_of_def);

/* [control] The server's end. def NULL: the defaults. May block while the network is looked at.
 * HAP_ERROR_ARGUMENT: a text is out of range, or interface_name and peers without certificates or
 * insecure. HAP_ERROR_NOT_FOUND: no module, certificate or interface. HAP_ERROR_UNSUPPORTED: the
 * module is of another version, or DDS has no security. HAP_ERROR_STATE: the process has the DDS
 * domain otherwise. HAP_ERROR_IO: DDS has failed. HAP_ERROR_MEMORY. detail, which may be NULL, says
 * more. From the first link on, what Cyclone DDS says of itself in this process goes to the log of
 * hap_hooks and not to stderr. */
HAP_NODISCARD HAP_API hap_status hap_link_dds_serve(const hap_link_dds_def *def, hap_link **out,
                                                    hap_detail *detail);

/* [control] A client's end. It looks for a server of the world from its first poll on, and joins
 * the first that answers. Errors as above. */
HAP_NODISCARD HAP_API hap_status hap_link_dds_connect(const hap_link_dds_def *def, hap_link **out,
                                                      hap_detail *detail);

/* ---- for the module ---- */

/* Goes up when a member below, or one of hap_link_ops or hap_link_dds_def, changes its meaning. */
#define HAP_LINK_DDS_ABI 1u

/* What the module's function hapode_link_dds_module gives. Final. */
typedef struct hap_link_dds_module {
  uint32_t abi;            /* HAP_LINK_DDS_ABI of the module's build */
  uint32_t size;           /* sizeof of the module's build */
  const hap_link_ops *ops; /* of what open makes */
  /* def is checked. serves 1: the server's end. Errors as above. */
  hap_status (*open)(const hap_link_dds_def *def, uint32_t serves, void **out_self,
                     hap_detail *detail);
  /* Before open: where warnings of DDS go while there are links; error 1: they are errors. Called
   * by any thread. */
  void (*listen)(void (*say)(uint32_t error, const char *text));
} hap_link_dds_module;

HAP_END_DECLS

#endif
