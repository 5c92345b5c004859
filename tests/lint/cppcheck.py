#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""cppcheck.py ROOT [--all]: cppcheck over the units that changed since the branch began, or over
all; not over tests; for Linux with threads and SSE."""
import os
import shutil
import subprocess
import sys

import lint

FOLDERS = ("lib", "plugins", "scenes", "view", "import", "tools", "bench", "examples")
OPTIONS = [
    "--std=c11", "--enable=warning,performance,portability", "--inline-suppr", "--quiet",
    "--error-exitcode=1", "--template={file}:{line}: {message} [{id}]",
    "-D__linux__", "-D__SSE2__", "-D_GNU_SOURCE", "-DdDOUBLE",
    # the system's and ODE's headers are not ours
    "--suppress=missingIncludeSystem",
]


def main(root, whole):
    os.nice(19)
    if not shutil.which("cppcheck"):
        lint.skip_all("needs cppcheck")
    tap = lint.Tap()
    units = [name for name in lint.code_files(root) if name.endswith(".c")]
    for folder in FOLDERS:
        chosen = [name for name in units if name.split("/")[0] == folder]
        count = len(chosen)
        if not whole:
            chosen = lint.changed_units(root, chosen, ["tests/lint/cppcheck.py"])
        print(f"# {folder}: {len(chosen)} of {count} units", flush=True)
        said = [] if count else [f"there is no unit in {folder}/"]
        if chosen:
            command = ["cppcheck", *OPTIONS, "-I", "include", "-I", "lib", "-I", ".", *chosen]
            run = subprocess.run(command, cwd=root, capture_output=True, text=True)
            said = run.stderr.splitlines() + run.stdout.splitlines()
            said = said or [f"cppcheck: exit status {run.returncode}"]
            said = said if run.returncode != 0 else []
        tap.point(f"cppcheck, {folder}", said)
    tap.done()


main(sys.argv[1], "--all" in sys.argv[2:])
