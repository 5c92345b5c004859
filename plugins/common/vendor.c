/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/common/vendor.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"

#define SHOWN 160 /* characters of a cause in a text */

static void *library_open(const char *name)
{
  /* Bound at once: bound at the first call, that call would lock in the loader. */
  return dlopen(name, RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
}

/* The loader says the same of a library that is not there and of one that needs another one. */
static bool is_absent(const char *name, const char *cause)
{
  return strncmp(cause, name, strlen(name)) == 0 && strstr(cause, "No such file") != NULL;
}

static hap_status vendor_not_found(const hapi_vendor *vendor, hap_detail *detail)
{
  const char *folders = getenv("LD_LIBRARY_PATH");
  char names[80] = "";
  size_t used = 0;
  for (size_t i = 0; vendor->names[i] != NULL && used < sizeof names; ++i) {
    used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", i > 0 ? ", " : "",
                             vendor->names[i]);
  }
  return hapi_fail(detail, HAP_ERROR_NOT_FOUND,
                   "%s: no %s in LD_LIBRARY_PATH (%.80s) and in the folders of ldconfig; %s, or "
                   "say library=/WHOLE/PATH",
                   vendor->device, names, folders != NULL && *folders != '\0' ? folders : "not set",
                   vendor->install);
}

static hap_status vendor_does_not_load(const hapi_vendor *vendor, const char *cause,
                                       hap_detail *detail)
{
  return hapi_fail(detail, HAP_ERROR_IO,
                   "%s: the maker's library does not load: %.*s; install it again, for this "
                   "processor, with what it needs (ldd shows what is missing)",
                   vendor->device, SHOWN, cause);
}

static hap_status library_load(const hapi_vendor *vendor, const char *path, void **out,
                               hap_detail *detail)
{
  *out = NULL;
  if (*path != '\0') {
    if (*path != '/' || access(path, F_OK) != 0) {
      return hapi_fail(detail, HAP_ERROR_NOT_FOUND,
                       "%s: library=%.200s is not there; it takes the whole path of a shared "
                       "object",
                       vendor->device, path);
    }
    *out = library_open(path);
    const char *cause = *out == NULL ? dlerror() : NULL;
    return *out != NULL ? HAP_OK
                        : vendor_does_not_load(vendor, cause != NULL ? cause : "?", detail);
  }
  for (size_t i = 0; vendor->names[i] != NULL && *out == NULL; ++i) {
    *out = library_open(vendor->names[i]);
    const char *cause = *out == NULL ? dlerror() : NULL;
    if (cause != NULL && !is_absent(vendor->names[i], cause)) {
      return vendor_does_not_load(vendor, cause, detail);
    }
  }
  return *out != NULL ? HAP_OK : vendor_not_found(vendor, detail);
}

static void library_path(void *symbol, char *out, size_t size)
{
  Dl_info about;
  const char *path = dladdr(symbol, &about) != 0 ? about.dli_fname : NULL;
  snprintf(out, size, "%.160s", path != NULL ? path : "the maker's library");
}

hap_status hapi_vendor_load(const hapi_vendor *vendor, const char *path, void **out_library,
                            hapi_vendor_function *out_functions, hap_detail *detail)
{
  char found[200] = "the maker's library";
  HAPI_TRY(library_load(vendor, path, out_library, detail));
  for (size_t i = 0; i < vendor->count; ++i) {
    void *symbol = dlsym(*out_library, vendor->symbols[i].name);
    _Static_assert(sizeof symbol == sizeof out_functions[0],
                   "POSIX: dlsym gives functions as well");
    if (symbol == NULL && vendor->symbols[i].needed) {
      hapi_vendor_unload(*out_library);
      *out_library = NULL;
      return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                       "%s: %s has no function %s: another version, or another library; %s",
                       vendor->device, *path != '\0' ? path : found, vendor->symbols[i].name,
                       vendor->install);
    }
    if (symbol != NULL) {
      library_path(symbol, found, sizeof found);
    }
    memcpy(&out_functions[i], &symbol, sizeof symbol);
  }
  return HAP_OK;
}

void hapi_vendor_unload(void *library)
{
  if (library != NULL) {
    (void)dlclose(library);
  }
}
