#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_hardening.py HARDENING SANITIZE OPTIMIZATION BINARY...: whether the flags of meson.build are
in the binaries. HARDENING is what the build took: link, full or off. Stack protector, fortified
functions and CET are looked for with full."""
import re
import shutil
import subprocess
import sys


def readelf(binary, *what):
    return subprocess.run(["readelf", "-W", *what, binary], capture_output=True, text=True,
                          check=True).stdout


def link_problems(binary):
    head, segments, dynamic = (readelf(binary, what) for what in ("-h", "-l", "-d"))
    if not re.search(r"Type:\s+DYN", head):
        yield "not position independent"
    if "GNU_RELRO" not in segments:
        yield "no RELRO"
    if not re.search(r"BIND_NOW|Flags:.*\bNOW\b", dynamic):
        yield "binds lazily: a first call of zero would lock in the system's loader"
    stack = re.search(r"GNU_STACK.*", segments)
    if stack is None or re.search(r"\bRWE\b", stack.group()):
        yield "its stack can be executed"
    if "TEXTREL" in dynamic:
        yield "its code is written to when it is loaded"
    if re.search(r"LOAD.*\bRWE\b", segments):
        yield "has memory that can be written and executed"


def compile_problems(binary, sanitize, optimization):
    symbols = readelf(binary, "-s")
    if "__stack_chk_fail" not in symbols:
        yield "no stack protector"
    if sanitize == "none" and optimization not in ("0", "g") and not re.search(
            r"__\w+_chk\b", symbols.replace("__stack_chk", "")):
        yield "no fortified functions"


def has_cet(binary):
    """The linker drops the mark where one object, of the C library say, lacks it."""
    return "IBT" in readelf(binary, "-n") or None


def main(hardening, sanitize, optimization, binaries):
    if not shutil.which("readelf"):
        print("1..0 # SKIP needs readelf")
        return
    if hardening == "off":
        print("1..0 # SKIP hardening is off")
        return
    number = 0
    for binary in binaries:
        problems = list(link_problems(binary))
        if hardening == "full":
            problems += compile_problems(binary, sanitize, optimization)
        number += 1
        for problem in problems:
            print(f"# {binary}: {problem}")
        print(f"{'not ok' if problems else 'ok'} {number} - {binary.rsplit('/', 1)[-1]}")
        if hardening == "full" and not has_cet(binary):
            number += 1
            print(f"ok {number} - CET # SKIP the C library's own objects have no CET mark")
    print(f"1..{number}")


main(sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4:])
