/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* For builds with coverage: a process that ends by _exit, such as the SPIDAR's guard, reports what
 * it has run, as others do at exit. */

#include <sys/syscall.h>
#include <unistd.h>

/* Of the compiler. NOLINTNEXTLINE(bugprone-reserved-identifier,readability-identifier-naming) */
extern void __gcov_dump(void);

/* NOLINTNEXTLINE(readability-inconsistent-declaration-parameter-name) */
void _exit(int code)
{
  __gcov_dump();
  for (;;) {
    (void)syscall(SYS_exit_group, code);
  }
}
