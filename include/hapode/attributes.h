/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ATTRIBUTES_H
#define HAPODE_ATTRIBUTES_H

/* The only place where compiler extensions are used. */

/* A function of the library: visible outside of it. */
#ifndef HAP_API
#if defined(__GNUC__)
#define HAP_API __attribute__((visibility("default")))
#else
#define HAP_API
#endif
#endif

/* A status that must be looked at, and a text that is checked as printf's. */
#if defined(__GNUC__)
#define HAP_NODISCARD __attribute__((warn_unused_result))
#define HAP_PRINTF(format_index, first_argument) \
  __attribute__((format(printf, format_index, first_argument)))
#else
#define HAP_NODISCARD
#define HAP_PRINTF(format_index, first_argument)
#endif

#ifdef __cplusplus
#define HAP_BEGIN_DECLS extern "C" {
#define HAP_END_DECLS }
#else
#define HAP_BEGIN_DECLS
#define HAP_END_DECLS
#endif

#endif
