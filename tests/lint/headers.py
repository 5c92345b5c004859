#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""headers.py ROOT CC...: each public header compiles alone, twice included, as C11 and as C++17.
A status that is thrown away is warned of where the language has an attribute for it, and never when
it is cast to void."""
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


THROWN = """#include <hapode/session.h>
void look(hap_session *session);
void look(hap_session *session)
{
  %shap_session_start(session);
}
"""


def check_nodiscard(tap, flags, compilers):
    for name, command, warns in compilers:
        if compile_text(command + ["-fsyntax-only", "-"], "int unit;\n"):
            tap.skip(f"a status cast to void, {name}", "the compiler does not have it")
            continue
        run = command + flags + ["-"]
        tap.point(f"a status cast to void is silent, {name}", compile_text(run, THROWN % "(void)"))
        thrown = compile_text(run, THROWN % "")
        good = bool(thrown) == warns
        tap.point(f"a status thrown away is {'' if warns else 'not '}warned of, {name}",
                  [] if good else thrown or ["no warning"])


def find_compilers(cc, cxx):
    """(name, command, whether a status that is thrown away gives a warning)"""
    clang = [c for c in ("clang", "clang-14") if shutil.which(c)][:1]
    found = [("C23", cc + ["-std=c2x", "-x", "c"], True)]
    if clang:
        found.append(("clang in C11", clang + ["-std=c11", "-x", "c"], True))
    if cxx:
        found.append(("C++17", cxx + ["-std=c++17", "-x", "c++"], True))
    version = subprocess.run(cc + ["--version"], capture_output=True, text=True).stdout
    if "Free Software Foundation" in version:
        found.append(("GCC in C11", cc + ["-std=c11", "-x", "c"], False))
    return found


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
    check_nodiscard(tap, flags, find_compilers(cc, cxx))
    tap.done()


main(sys.argv[1], sys.argv[2:])
