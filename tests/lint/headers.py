#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""headers.py ROOT CC...: each public header compiles alone, twice included, as C11 and as C++17."""
import os
import shlex
import shutil
import subprocess
import sys

import lint

WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only"]


def ode_flags():
    if not shutil.which("pkg-config"):
        return []
    run = subprocess.run(["pkg-config", "--cflags", "ode"], capture_output=True, text=True)
    # the warnings are for our headers, not for ODE's
    return ["-isystem" + f[2:] if f.startswith("-I") else f for f in shlex.split(run.stdout)]


def compile_text(command, text):
    run = subprocess.run(command, input=text, capture_output=True, text=True)
    if run.returncode == 0:
        return []
    return [run.stderr or f"{command[0]}: exit status {run.returncode}"]


def find_cxx():
    for name in [os.environ.get("CXX", ""), "c++", "g++", "clang++"]:
        command = shlex.split(name)
        if command and shutil.which(command[0]):
            probe = command + ["-std=c++17", "-x", "c++", "-fsyntax-only", "-"]
            if not compile_text(probe, "#include <cstddef>\n"):
                return command
    return None


def main(root, cc):
    tap = lint.Tap()
    include = os.path.join(root, "include")
    folder = os.path.join(include, "hapode")
    headers = sorted(n for n in os.listdir(folder) if n.endswith(".h"))
    tap.point("there are public headers", [] if headers else [f"none in {folder}"])
    flags = WARNINGS + ["-I" + include] + ode_flags()
    cxx = find_cxx()
    for name in headers:
        # the typedef: a unit of macros only would be empty, which is not ISO C
        text = f"#include <hapode/{name}>\n" * 2 + "typedef int hapode_unit;\n"
        tap.point(f"{name} as C11", compile_text(cc + ["-std=c11", "-x", "c", *flags, "-"], text))
        if cxx:
            tap.point(f"{name} as C++17",
                      compile_text(cxx + ["-std=c++17", "-x", "c++", *flags, "-"], text))
        else:
            tap.skip(f"{name} as C++17", "needs a C++ compiler")
    tap.done()


main(sys.argv[1], sys.argv[2:])
