#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""cppcheck.py ROOT: cppcheck over all code but the tests, for Linux with threads and SSE."""
import os
import shutil
import subprocess
import sys

import lint

FOLDERS = ("lib", "plugins", "scenes", "tools", "bench", "examples")
OPTIONS = [
    "--std=c11", "--enable=warning,performance,portability", "--inline-suppr", "--quiet",
    "--error-exitcode=1", "--template={file}:{line}: {message} [{id}]",
    "-D__linux__", "-D__SSE2__", "-D_GNU_SOURCE", "-DdDOUBLE",
    # the system's and ODE's headers are not ours
    "--suppress=missingIncludeSystem",
]


def main(root):
    if not shutil.which("cppcheck"):
        lint.skip_all("needs cppcheck")
    tap = lint.Tap()
    for folder in FOLDERS:
        command = ["cppcheck", *OPTIONS, "-I", "include", "-I", "lib", "-I", ".", folder]
        run = subprocess.run(command, cwd=root, capture_output=True, text=True)
        said = run.stderr.splitlines() + run.stdout.splitlines()
        said = [] if run.returncode == 0 else said or [f"cppcheck: exit status {run.returncode}"]
        tap.point(f"cppcheck, {folder}", said)
    tap.done()


main(sys.argv[1])
