#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""format.py ROOT: every C file is as clang-format 14 would write it (other versions differ)."""
import re
import shutil
import subprocess
import sys

import lint


def find_clang_format():
    for name in ("clang-format-14", "clang-format"):
        if shutil.which(name):
            version = subprocess.run([name, "--version"], capture_output=True, text=True).stdout
            if re.search(r"\bversion 14\.", version):
                return name
    return None


def main(root):
    tool = find_clang_format()
    if tool is None:
        lint.skip_all("needs clang-format 14")
    tap = lint.Tap()
    files = lint.code_files(root)
    tap.point("there are files to check", [] if files else ["no .c or .h file found"])
    if files:
        run = subprocess.run([tool, "--dry-run", "-Werror", "--style=file", *files], cwd=root,
                             capture_output=True, text=True)
        where = {}  # the first place of each file
        for line in run.stderr.splitlines():
            match = re.match(r"([^:]+):\d+:\d+: error: ", line)
            if match:
                where.setdefault(match.group(1), line)
        problems = list(where.values())
        if run.returncode and not problems:
            problems = [run.stderr or f"{tool}: exit status {run.returncode}"]
        tap.point(f"{len(files)} files are formatted", problems)
    tap.done()


main(sys.argv[1])
