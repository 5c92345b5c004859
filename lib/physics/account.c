/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/account.h"

#include <string.h>

#include "base/alloc.h"

bool hapi_account_create(hapi_account *account, uint32_t slots)
{
  account->bodies = hapi_alloc_array(slots, sizeof *account->bodies);
  account->capacity = account->bodies != NULL ? slots : 0;
  return account->bodies != NULL;
}

void hapi_account_finish(hapi_account *account)
{
  hapi_free(account->bodies);
  account->bodies = NULL;
  account->capacity = 0;
}

void hapi_account_reset(hapi_account *account)
{
  memset(account->bodies, 0, account->capacity * sizeof *account->bodies);
}
