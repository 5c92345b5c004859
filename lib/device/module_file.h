/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_DEVICE_MODULE_FILE_H
#define HAPODE_DEVICE_MODULE_FILE_H

/* The file of a module: opened once, and only where nobody but root and the user can change it. */

#include <stddef.h>

#include <hapode/status.h>

#define HAPI_MODULE_LOAD_PATH 400

/* [control] Opens path, a whole one, for reading. On the way each folder, link and the file itself
 * must belong to root or the user, and nobody else may write them. detail is not NULL and names
 * path and the place that is wrong. */
HAP_NODISCARD hap_status hapi_module_file_open(const char *path, int *out_file, hap_detail *detail);

/* [control] A name by which the system's loader opens this very file, while it is open; size at
 * least HAPI_MODULE_LOAD_PATH. Two files that are loaded at the same time have different names. */
void hapi_module_file_name(int file, char *out, size_t size);

#endif
