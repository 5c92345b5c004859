/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A shared object, and no device. */

int symbolless_number(void);

int symbolless_number(void)
{
  return 7;
}
