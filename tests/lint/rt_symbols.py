#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""rt_symbols.py SANITIZERS ARCHIVE...: the pure tick calls nothing but a short list of functions.

SANITIZERS is meson's b_sanitize. What one archive defines the others may use."""
import re
import shutil
import subprocess
import sys

import lint

ALLOWED = set("""
    memcpy memset memmove memcmp
    sqrt fabs fmin fmax floor ceil trunc round rint nearbyint
    __stack_chk_fail _GLOBAL_OFFSET_TABLE_
    __memcpy_chk __memset_chk __memmove_chk
    hapi_assert_failed
""".split())
SANITIZER = re.compile(r"__(asan|ubsan|tsan|sanitizer)_\w+$")


def symbols(archive):
    """(defined, undefined as {name: member}, problem); a thin archive is read like any other."""
    run = subprocess.run(["nm", "-A", "-P", archive], capture_output=True, text=True)
    defined = set()
    undefined = {}
    for line in run.stdout.splitlines():
        match = re.match(r"(.*): (\S+) (\S)(?: |$)", line)
        if match is None:
            continue
        member, name, kind = match.groups()
        if kind in "Uvw":
            undefined.setdefault(name, member)
        elif kind.isupper() or kind == "i":
            defined.add(name)
    problem = [] if run.returncode == 0 else [run.stderr or f"nm: exit status {run.returncode}"]
    return defined, undefined, problem


def main(sanitizers, archives):
    if not shutil.which("nm"):
        lint.skip_all("needs nm")
    tap = lint.Tap()
    defined = set()
    undefined = {}
    problems = [] if archives else ["no archive given"]
    for archive in archives:
        more_defined, more_undefined, problem = symbols(archive)
        defined |= more_defined
        undefined.update(more_undefined)
        problems += problem or ([] if more_defined else [f"{archive}: defines no symbol"])
    tap.point("nm reads the archive", problems)

    strangers = {name: member for name, member in undefined.items()
                 if name not in defined and name not in ALLOWED and
                 not (sanitizers not in ("", "none") and SANITIZER.match(name))}
    tap.point("the pure tick calls only what is allowed",
              [f"{member}: {name}" for name, member in sorted(strangers.items())]
              if undefined or defined else ["nothing to check"])
    tap.done()


main(sys.argv[1], sys.argv[2:])
