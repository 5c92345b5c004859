# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
# The summary of hapode-run on stdin; on stdout three sentences: what was pushed, what was felt, how
# exact and how dear it was.
BEGIN { FS = ": " }
{ value[$1] = $2 }

# A share in percent, with two digits that count.
function percent(share) {
  return sprintf("%.2g %%", 100 * share)
}

END {
  if (!("peak_force_n" in value)) {
    print "demo.awk: no summary of hapode-run came in" > "/dev/stderr"
    exit 1
  }
  seconds = value["ticks"] / value["haptic_hz"]
  printf "A simulated hand pushed scene %s for %.3g s: the world took %g steps a second, the hand %g.\n",
    value["scene"], seconds, value["physics_hz"], value["haptic_hz"]
  printf "It was in contact for %.2g s and felt %.3g N at most.\n",
    value["contact_ticks"] / value["haptic_hz"], value["peak_force_n"]
  exact = "How exact the force was is not known, for nothing was gone over again"
  if (value["lookbacks"] > 0) {
    exact = sprintf("The force was off by %s of itself, as a world of %g steps a second tells",
      percent(value["force_error"]), value["haptic_hz"])
  }
  printf "%s; this took %s of a core for the hand and %s for the world, and %d of %d ticks were missed.\n",
    exact, percent(value["haptic_duty"]), percent(value["physics_duty"]), value["missed_ticks"],
    value["ticks"]
}
