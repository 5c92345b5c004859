/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <dlfcn.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <hapode/link_dds.h>

#include "base/def.h"
#include "base/log.h"
#include "device/module.h"
#include "hapode_folders.h"

/* Links over DDS: checks of what the caller says, and the module that does the rest. */

#define MODULE_FILE "hapode-link-dds.so"
#define SYMBOL "hapode_link_dds_module"
#define PATH_MOST 4096
#define TEXT_MOST 1024u /* of a folder, and of a list of addresses */
#define DOMAIN_MOST 230u

static const hap_link_dds_def def_defaults = {
    .cookie = 0x48444431u, .world = "world", .name = "hand", .domain = 67};
static const hapi_def_type def_type = HAPI_DEF_TYPE(hap_link_dds_def, def_defaults);

void hap_link_dds_def_init(hap_link_dds_def *def, size_t size_of_def)
{
  hapi_def_init(&def_type, def, size_of_def);
}

/* ---- what the caller says ---- */

#define LETTERS "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-"

/* NULL is good where least is 0. */
static bool text_is_good(const char *text, const char *letters, size_t least, size_t most)
{
  size_t length = text != NULL ? strnlen(text, most + 1) : 0;
  return length >= least && length <= most && (text == NULL || strspn(text, letters) == length);
}

static hap_status def_check(const hap_link_dds_def *def, hap_detail *detail)
{
  if (!text_is_good(def->world, LETTERS, 1, 63)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "the name of the world has 1 to 63 letters, digits, '.', '_' or '-'");
  }
  if (!text_is_good(def->name, LETTERS " ", 0, HAP_LINK_NAME_MOST)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "the name of the hand has %u letters, digits, spaces, '.', '_' or '-' at most",
                     HAP_LINK_NAME_MOST);
  }
  if (!text_is_good(def->interface_name, LETTERS ":", 0, 63) ||
      !text_is_good(def->peers, LETTERS ":,", 0, TEXT_MOST)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "interface or peers: names and addresses are expected, peers with a comma "
                     "between them");
  }
  if (def->domain > DOMAIN_MOST || def->insecure > 1) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "domain %u, insecure %u: domains go from 0 to %u, insecure is 0 or 1",
                     def->domain, def->insecure, DOMAIN_MOST);
  }
  if (def->certificates != NULL && def->insecure != 0) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "certificates and insecure: choose one of the two");
  }
  if (def->certificates != NULL &&
      (def->certificates[0] == '\0' || strnlen(def->certificates, TEXT_MOST + 1) > TEXT_MOST)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "the folder of certificates has no name, or one "
                     "that is too long");
  }
  bool alone = def->certificates == NULL && def->insecure == 0;
  return alone && (def->interface_name != NULL || def->peers != NULL)
             ? hapi_fail(detail, HAP_ERROR_ARGUMENT,
                         "interface and peers are for a link over the network: give it "
                         "certificates, or say that it may be insecure")
             : HAP_OK;
}

/* ---- the module ---- */

/* Beside the code that runs here, which is a library or a program. */
static bool module_find(char out[PATH_MOST])
{
  static const char *const places[] = {"/", "/hapode/", "/../" HAPODE_LIBDIR "/hapode/", "/../"};
  static const int here;
  Dl_info info;
  char own[PATH_MOST];
  ssize_t length = 0;
  if (dladdr(&here, &info) == 0 || info.dli_fname == NULL) {
    return false;
  }
  if (strchr(info.dli_fname, '/') != NULL && realpath(info.dli_fname, own) != NULL) {
    length = (ssize_t)strlen(own);
  } else { /* the program, which was found by its name */
    length = readlink("/proc/self/exe", own, sizeof own - 1);
  }
  while (length > 0 && own[length - 1] != '/') {
    --length;
  }
  if (length <= 0) {
    return false;
  }
  own[length - 1] = '\0';
  for (size_t i = 0; i < sizeof places / sizeof places[0]; ++i) {
    char path[2 * PATH_MOST];
    (void)snprintf(path, sizeof path, "%s%s%s", own, places[i], MODULE_FILE);
    if (access(path, F_OK) == 0 && realpath(path, out) != NULL) {
      return true;
    }
  }
  return false;
}

/* ---- what DDS says of itself ---- */

#define SAID_MOST 20u   /* lines: what DDS warns of it warns of again and again */
#define SAID_EACH 1000u /* then one of so many */

static void dds_say(uint32_t error, const char *text)
{
  static atomic_uint said;
  unsigned before = atomic_fetch_add(&said, 1);
  if (before < SAID_MOST) {
    hapi_log(error != 0 ? HAP_LOG_ERROR : HAP_LOG_WARNING, "DDS: %.400s%s", text,
             before + 1 < SAID_MOST ? "" : " (what DDS says next is only counted)");
  } else if (before % SAID_EACH == 0) {
    hapi_log(HAP_LOG_WARNING, "DDS has said %u things by now; the newest: %.400s", before, text);
  }
}

/* ---- opening ---- */

static hap_status module_open(const char *path, const hap_link_dds_module **out, hap_detail *detail)
{
  char found[PATH_MOST];
  void *library = NULL;
  if (path == NULL && !module_find(found)) {
    return hapi_fail(detail, HAP_ERROR_NOT_FOUND,
                     "links over a network need the module " MODULE_FILE
                     ", which is not installed (Debian: hapode-link-dds)");
  }
  HAPI_TRY(hapi_module_load(path != NULL ? path : found, &library, detail));
  const hap_link_dds_module *(*table)(void) = NULL;
  void *symbol = dlsym(library, SYMBOL);
  if (symbol == NULL) {
    return hapi_fail(detail, HAP_ERROR_FORMAT, "%.300s is no module for links over DDS",
                     path != NULL ? path : found);
  }
  memcpy(&table, &symbol, sizeof table);
  *out = table();
  if (*out == NULL || (*out)->abi != HAP_LINK_DDS_ABI || (*out)->size < sizeof **out) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "%.300s is of another version than the library: install both of one",
                     path != NULL ? path : found);
  }
  (*out)->listen(dds_say);
  return HAP_OK;
}

static hap_status dds_open(const hap_link_dds_def *given, uint32_t serves, hap_link **out,
                           hap_detail *detail)
{
  hap_link_dds_def def;
  const hap_link_dds_module *module = NULL;
  void *self = NULL;
  hap_detail unread = {""};
  hap_detail *why = detail != NULL ? detail : &unread;
  if (out == NULL) {
    return hapi_fail(why, HAP_ERROR_ARGUMENT, "a link over DDS: out is NULL");
  }
  *out = NULL;
  HAPI_TRY(hapi_def_read_optional(&def_type, given, &def, why));
  HAPI_TRY(def_check(&def, why));
  hap_status status = module_open(def.module, &module, why);
  if (status < HAP_OK || module == NULL) {
    return status;
  }
  HAPI_TRY(module->open(&def, serves, &self, why));
  return hap_link_create(module->ops, self, out, why);
}

hap_status hap_link_dds_serve(const hap_link_dds_def *def, hap_link **out, hap_detail *detail)
{
  return dds_open(def, 1, out, detail);
}

hap_status hap_link_dds_connect(const hap_link_dds_def *def, hap_link **out, hap_detail *detail)
{
  return dds_open(def, 0, out, detail);
}
