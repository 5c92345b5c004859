#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""abi.py [--renew] ROOT LIBRARY: a program built against the recorded ABI (tests/abi) runs with
this library, as far as abidiff can tell; the report is printed. What was added may be added to the
record with --renew; what was taken away needs a new soversion."""
import os
import re
import shutil
import subprocess
import sys

import lint

DUMP = ["--drop-private-types", "--exported-interfaces-only", "--no-corpus-path",
        "--no-comp-dir-path", "--short-locs", "--no-elf-needed", "--type-id-style", "hash"]
INCOMPATIBLE = 8  # bit of abidiff's exit status
WRONG_USE = 1 | 2


def soname(library):
    run = subprocess.run(["readelf", "-d", library], capture_output=True, text=True, check=True)
    found = re.search(r"Library soname: \[(.*?)\]", run.stdout)
    return found.group(1) if found else None


def has_types(library):
    run = subprocess.run(["readelf", "-S", "-W", library], capture_output=True, text=True,
                         check=True)
    return ".debug_info" in run.stdout


def compare(root, record, library):
    include = os.path.join(root, "include")
    return subprocess.run(
        ["abidiff", "--headers-dir1", include, "--headers-dir2", include, "--no-show-locs",
         "--suppressions", os.path.join(root, "tests", "abi", "compatible.ini"), record, library],
        capture_output=True, text=True)


def renew(root, record, library):
    subprocess.run(["abidw", "--headers-dir", os.path.join(root, "include"), *DUMP, "--out-file",
                    record, library], check=True)
    print(f"wrote {record}")


def check(root, record, library):
    tap = lint.Tap()
    if not os.path.exists(record):
        tap.point("the ABI is recorded", [f"no {record}: make it with --renew"])
        tap.done()
    run = compare(root, record, library)
    report = run.stdout.splitlines() + run.stderr.splitlines()
    bad = run.returncode & (INCOMPATIBLE | WRONG_USE)
    # additions, and changes that abidiff leaves to a person
    for line in [] if bad else report:
        print("# " + line)
    removed = [line for line in report if re.search(r"[1-9]\d* Removed", line)]
    tap.point("nothing was taken away", report if bad or removed else [])
    same = re.search(r"Functions changes summary: 0 Removed, 0 Changed", run.stdout)
    changed = run.returncode & 4 and not same
    tap.point("nothing that is there has changed", report if changed and not bad else [])
    tap.done()


def main(arguments):
    wants_renewal = "--renew" in arguments
    root, library = [a for a in arguments if a != "--renew"]
    for tool in ("abidiff", "abidw", "readelf"):
        if not shutil.which(tool):
            lint.skip_all(f"needs {tool}")
    if ".so" not in library:
        lint.skip_all("needs a shared library")
    if not has_types(library):
        lint.skip_all("needs a library with debug information")
    record = os.path.join(root, "tests", "abi", soname(library) + ".abi")
    (renew if wants_renewal else check)(root, record, library)


main(sys.argv[1:])
