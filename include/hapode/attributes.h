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

/* A status that must be looked at, or cast to void. It comes first in a declaration. Before C23 and
 * C++17 only clang has one that the cast silences; GCC's warn_unused_result warns all the same. */
#if defined(__cplusplus) && __cplusplus >= 201703L
#define HAP_NODISCARD [[nodiscard]]
#elif !defined(__cplusplus) && defined(__STDC_VERSION__) && __STDC_VERSION__ > 201710L
#define HAP_NODISCARD [[nodiscard]]
#elif defined(__clang__)
#define HAP_NODISCARD __attribute__((warn_unused_result))
#else
#define HAP_NODISCARD
#endif

/* A text that is checked as printf's. */
#if defined(__GNUC__)
#define HAP_PRINTF(format_index, first_argument) \
  __attribute__((format(printf, format_index, first_argument)))
#else
#define HAP_PRINTF(format_index, first_argument)
#endif

/* Around declarations: they are those of C, in C++ too. */
#ifdef __cplusplus
#define HAP_BEGIN_DECLS extern "C" { /* before the first declaration */
#define HAP_END_DECLS }              /* behind the last one */
#else
#define HAP_BEGIN_DECLS /* before the first declaration */
#define HAP_END_DECLS   /* behind the last one */
#endif

#endif
