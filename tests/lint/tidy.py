#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""tidy.py ROOT BUILD [--all] FOLDER...: clang-tidy 14 (.clang-tidy) over the compiled units of the
folders that changed since the branch began, or over all; one test point a folder."""
import json
import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import lint


def first_commands(build, folder):
    """The first command of a unit that is compiled several times: clang-tidy would run all."""
    with open(os.path.join(build, "compile_commands.json"), encoding="utf-8") as f:
        commands = json.load(f)
    first = {}
    for command in commands:
        first.setdefault((command["directory"], command["file"]), command)
    with open(os.path.join(folder, "compile_commands.json"), "w", encoding="utf-8") as f:
        json.dump(list(first.values()), f)


def units(root, build):
    with open(os.path.join(build, "compile_commands.json"), encoding="utf-8") as f:
        commands = json.load(f)
    paths = {os.path.realpath(os.path.join(c["directory"], c["file"])) for c in commands}
    return sorted(os.path.relpath(p, os.path.realpath(root)) for p in paths)


def tidy(root, build, name):
    run = subprocess.run(["clang-tidy-14", "-p", build, "--quiet", name], cwd=root,
                         capture_output=True, text=True)
    if run.returncode == 0:
        return []
    # what it found, without the sources it quotes; else why it could not look
    found = [line for line in run.stdout.splitlines() if ": error:" in line or ": warning:" in line]
    return found or [f"{name}: {run.stderr.strip()}"]


def main(root, build, folders):
    whole = "--all" in folders
    folders = [f for f in folders if f != "--all"]
    os.nice(19)
    if not shutil.which("clang-tidy-14"):
        lint.skip_all("needs clang-tidy-14")
    if not os.path.exists(os.path.join(build, "compile_commands.json")):
        lint.skip_all("needs compile_commands.json in the build folder")
    tap = lint.Tap()
    names = units(root, build)
    with tempfile.TemporaryDirectory() as commands, ThreadPoolExecutor(os.cpu_count()) as pool:
        first_commands(build, commands)
        for folder in folders:
            chosen = [n for n in names if n.split("/")[0] == folder]
            found = [] if chosen else [f"no unit of {folder}/ is compiled"]
            count = len(chosen)
            if not whole:
                chosen = lint.changed_units(root, chosen, [".clang-tidy"])
            print(f"# {folder}: {len(chosen)} of {count} units", flush=True)
            for problems in pool.map(lambda name: tidy(root, commands, name), chosen):
                found += problems
            tap.point(f"clang-tidy, {folder}", sorted(set(found)))
    tap.done()


main(sys.argv[1], sys.argv[2], sys.argv[3:])
