/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/conform/conform_internal.h"

#include <stdlib.h>
#include <string.h>

/* What the library itself refuses when it opens a device (ABI, names, pacing, limits that are not
 * finite) is not looked at again. */

void conform_describe(conform *c)
{
  static const char *const pacings[] = {"virtual", "host", "device"};
  const char *help = c->ops->help;
  const hap_device_info *i = &c->info;
  conform_note(c, "%s: pacing %s, dof %u, %g N, %g N m, %g N/m, quantum %g m", i->name,
               pacings[c->ops->pacing], i->dof, i->max_force, i->max_torque, i->rated_stiffness,
               i->quantum);
  if (help == NULL || *help == '\0' || strchr(help, '\n') != NULL) {
    conform_fail(c, "help is not one line of text");
  }
  if (i->measures_velocity > 1) {
    conform_fail(c, "measures_velocity is %u, neither 0 nor 1", i->measures_velocity);
  }
}

/* The text behind "name:" or "module:PATH," with one argument more. */
static char *more_arguments(const char *spec)
{
  static const char extra[] = "no_such_argument=1";
  const char *args = spec + strcspn(spec, ":");
  if (strncmp(spec, "module:", strlen("module:")) == 0) {
    args = spec + strcspn(spec, ",");
  }
  args += *args != '\0';
  size_t size = strlen(args) + sizeof extra + 1;
  char *more = malloc(size);
  if (more != NULL) {
    (void)snprintf(more, size, "%s%s%s", args, *args != '\0' ? "," : "", extra);
  }
  return more;
}

void conform_arguments(conform *c)
{
  hap_detail detail = {""};
  void *self = NULL;
  char *args = more_arguments(c->options->spec);
  if (args == NULL) {
    conform_fail(c, "out of memory");
    return;
  }
  conform_enter("open", CONFORM_BLOCK_LIMIT_S);
  hap_status status = c->ops->open(NULL, args, &self, &detail);
  if (status >= HAP_OK && self != NULL) {
    c->ops->close(self);
  }
  conform_leave();
  if (status >= HAP_OK) {
    conform_fail(c, "open took the arguments '%s'", args);
  } else if (self != NULL) {
    conform_fail(c, "open failed and gave a self all the same");
  } else if (detail.text[0] == '\0') {
    conform_fail(c, "open failed and said nothing in detail");
  }
  if (!conform_status_is_known(status)) {
    conform_fail(c, "open gave %d, which is no hap_status", (int)status);
  }
  free(args);
}

void conform_open_holds_no_force(conform *c)
{
  if (conform_needs_held(c)) {
    conform_expect_none(c, "opened and not started,");
    c->said.holds_at_open = c->failed;
  }
}

void conform_before_start(conform *c)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  conform_sample sample;
  hap_wrench reached;
  hap_status read = conform_read(c, &sample);
  hap_status written = conform_write(c, &none, &reached);
  c->said.reads_unstarted = read >= HAP_OK;
  c->said.writes_unstarted = written >= HAP_OK;
  if (c->said.reads_unstarted) {
    conform_fail(c, "before start, read gave %s and not an error", hap_status_name(read));
  }
  if (c->said.writes_unstarted) {
    conform_fail(c, "before start, write gave %s and not an error", hap_status_name(written));
  }
}

void conform_stop_before_start(conform *c)
{
  conform_zero(c);
  conform_stop(c);
  conform_expect_none(c, "after zero and stop, never started,");
  conform_zero(c);
}

void conform_start_without_force(conform *c)
{
  hap_status status = conform_start(c);
  if (status < HAP_OK || !conform_status_is_known(status)) {
    conform_fail(c, "start gave %d, %s", (int)status, hap_status_text(status));
    c->said.start_wrong = true;
    return;
  }
  conform_expect_none(c, "started,");
  c->said.holds_at_start = c->failed;
  conform_zero(c);
}
