/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "device/module.h"

#include <dlfcn.h>
#include <errno.h>
#include <link.h>
#include <stdbool.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/log.h"
#include "device/device.h"
#include "device/module_file.h"

/* The loaded code drives motors, so it must be the named file and no other: a whole path, no search
 * through LD_LIBRARY_PATH or the working folder, and nobody else may have put it there.
 *
 * Each device holds the library once, and the system's loader counts: the code goes with the last
 * device. By then no thread runs in it: ops->close has returned, and hapi_emergency_remove has
 * waited for every call of zero.
 *
 * All symbols are bound while it is loaded (RTLD_NOW). Bound at first use, the first zero would
 * call the system's loader, which locks, from a signal handler. */

#define SYMBOL "hapode_device_module"
#define PATH_SHOWN 200 /* characters of a path in a text */

typedef ElfW(Ehdr) elf_header;
typedef const hap_device_ops *(*module_fn)(uint32_t host_abi);

typedef struct module {
  const char *path;
  void *library;
  hap_detail *detail;
} module;

static hap_status module_fail(const module *m, hap_status status, const char *what, const char *why)
{
  return hapi_fail(m->detail, status, "module %.*s: %s%.200s", PATH_SHOWN, m->path, what, why);
}

/* ---- what the file is ---- */

/* Of the code that runs here; NULL: it cannot be told. */
static const elf_header *own_header(void)
{
  static const int here;
  Dl_info info;
  const elf_header *header = NULL;
  if (dladdr(&here, &info) != 0) {
    header = info.dli_fbase;
  }
  return header != NULL && memcmp(header->e_ident, ELFMAG, SELFMAG) == 0 ? header : NULL;
}

static const char *machine_name(unsigned machine)
{
  static const struct {
    unsigned machine;
    const char *name;
  } names[] = {{EM_X86_64, "x86-64"}, {EM_386, "i386"},    {EM_AARCH64, "arm64"},
               {EM_ARM, "arm"},       {EM_RISCV, "riscv"}, {EM_PPC64, "ppc64"}};
  for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
    if (names[i].machine == machine) {
      return names[i].name;
    }
  }
  return "another one";
}

/* Linkers put the table of sections at the end. Loading a file without its end is a bus error. */
static bool is_cut_off(const elf_header *header, uint64_t file_size)
{
  uint64_t table = (uint64_t)header->e_shnum * header->e_shentsize;
  bool own_form = header->e_ident[EI_CLASS] == (sizeof(void *) == 8 ? ELFCLASS64 : ELFCLASS32);
  return file_size < sizeof *header ||
         (own_form && (header->e_shoff > file_size || header->e_shoff + table > file_size));
}

/* The first bytes of both forms of the header, of 32 and of 64 bits, are the same up to e_machine.
 * The system's loader says of a foreign machine that there is no such file. */
static hap_status check_header(const module *m, const elf_header *header, uint64_t file_size)
{
  const elf_header *own = own_header();
  if (memcmp(header->e_ident, ELFMAG, SELFMAG) != 0) {
    return module_fail(m, HAP_ERROR_FORMAT, "not a shared object: it is no ELF file", "");
  }
  if (is_cut_off(header, file_size)) {
    return module_fail(m, HAP_ERROR_FORMAT, "cut off: the end of the file is missing; copy it anew",
                       "");
  }
  if (own == NULL) {
    return HAP_OK;
  }
  if (header->e_ident[EI_CLASS] != own->e_ident[EI_CLASS] ||
      header->e_ident[EI_DATA] != own->e_ident[EI_DATA] || header->e_machine != own->e_machine) {
    return hapi_fail(m->detail, HAP_ERROR_UNSUPPORTED,
                     "module %.*s: built for another architecture (%s, %s bits), this program is "
                     "%s, %s bits: build it for this one",
                     PATH_SHOWN, m->path, machine_name(header->e_machine),
                     header->e_ident[EI_CLASS] == ELFCLASS64 ? "64" : "32",
                     machine_name(own->e_machine),
                     own->e_ident[EI_CLASS] == ELFCLASS64 ? "64" : "32");
  }
  if (header->e_type != ET_DYN) {
    return module_fail(m, HAP_ERROR_FORMAT,
                       "an ELF file, but no shared object: link it with -shared", "");
  }
  return HAP_OK;
}

static hap_status check_file(const module *m, int file)
{
  struct stat about;
  elf_header header;
  memset(&header, 0, sizeof header);
  if (fstat(file, &about) != 0 || pread(file, &header, sizeof header, 0) < 0) {
    return module_fail(m, HAP_ERROR_IO, "cannot be read: ", strerror(errno));
  }
  return check_header(m, &header, (uint64_t)about.st_size);
}

/* ---- loading ---- */

/* Without the file's name by which it was loaded. */
static const char *load_cause(const char *name)
{
  const char *cause = dlerror();
  if (cause == NULL) {
    return "no reason given";
  }
  const char *at = strstr(cause, name);
  if (at == cause) {
    at += strlen(name);
    return at + strspn(at, ": ");
  }
  return cause;
}

static hap_status table_find(const module *m, const hap_device_ops **out)
{
  void *symbol = dlsym(m->library, SYMBOL);
  module_fn table;
  _Static_assert(sizeof table == sizeof symbol, "POSIX: dlsym gives functions as well");
  if (symbol == NULL) {
    return module_fail(m, HAP_ERROR_FORMAT, "no device module of hapode: ",
                       "it has no function " SYMBOL
                       " (hidden? declare it as hapode/device_impl.h does)");
  }
  memcpy(&table, &symbol, sizeof table);
  *out = table(HAP_DEVICE_ABI);
  if (*out == NULL) {
    return hapi_fail(m->detail, HAP_ERROR_UNSUPPORTED,
                     "module %.*s: it refuses device ABI %u of this library: build it anew with "
                     "this library's headers",
                     PATH_SHOWN, m->path, HAP_DEVICE_ABI);
  }
  return HAP_OK;
}

/* What is loaded is the file that was checked: the path is looked up once. */
static hap_status module_load(module *m)
{
  char name[HAPI_MODULE_LOAD_PATH];
  int file = -1;
  HAPI_TRY(hapi_module_file_open(m->path, &file, m->detail));
  hap_status status = check_file(m, file);
  if (status == HAP_OK) {
    hapi_module_file_name(file, name, sizeof name);
    m->library = dlopen(name, RTLD_NOW | RTLD_LOCAL);
    if (m->library == NULL) {
      status = module_fail(m, HAP_ERROR_IO, "cannot be loaded: ", load_cause(name));
    }
  }
  close(file);
  return status;
}

hap_status hapi_module_load(const char *path, void **out_library, hap_detail *detail)
{
  module m = {.path = path, .detail = detail};
  HAPI_TRY(module_load(&m));
  *out_library = m.library;
  return HAP_OK;
}

static hap_status module_open(module *m, const char *args, hap_device **out)
{
  const hap_device_ops *ops = NULL;
  hap_detail why = {""};
  HAPI_TRY(module_load(m));
  hap_status status = table_find(m, &ops);
  if (status >= 0) {
    status = hapi_device_open_ops(ops, NULL, args, out, &why);
    if (status < 0) {
      hapi_fail(m->detail, status, "module %.*s: %.290s", PATH_SHOWN, m->path, why.text);
    }
  }
  if (status < 0) {
    hapi_module_unload(m->library);
    return status;
  }
  (*out)->library = m->library;
  return status;
}

hap_status hapi_module_open(const char *args, hap_device **out, hap_detail *detail)
{
  size_t length = strcspn(args, ",");
  if (length == 0 || args[0] != '/') {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "module: expected the whole path of a shared object, module:/PATH/FILE.so"
                     "[,ARGS], not '%.*s': it is not searched for, because it holds motors",
                     length < PATH_SHOWN ? (int)length : PATH_SHOWN, args);
  }
  char *path = hapi_alloc(length + 1);
  if (path == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "module: out of memory");
  }
  memcpy(path, args, length);
  module m = {.path = path, .detail = detail};
  hap_status status = module_open(&m, args[length] == ',' ? args + length + 1 : "", out);
  hapi_free(path);
  return status;
}

void hapi_module_unload(void *library)
{
  if (library != NULL) {
    (void)dlclose(library);
  }
}
