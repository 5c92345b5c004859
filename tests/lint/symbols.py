#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""symbols.py ROOT LIBRARY: what the shared library exports is what the public headers declare, and
everything that they declare (functions, types, members, enumerators, macros) has a comment."""
import os
import re
import shutil
import subprocess
import sys

import lint

FUNCTION = re.compile(r"\bHAP_API\b[^;{]*?\b(\w+)\s*\([^;{]*\)\s*;")
BLOCK = re.compile(r"typedef (struct|enum) (\w+) \{(.*?)\n\} (\w+);", re.S)
OTHER = re.compile(r"^typedef (?!struct \w+ \{|enum \w+ \{)[^;]*?\b(\w+)(?:\)\([^;]*)?;", re.M)
MACRO = re.compile(r"^#define (\w+)", re.M)
OPAQUE = re.compile(r"^typedef struct (\w+) \1;", re.M)
DIRECTIVES = re.compile(r"(^#(?:if|ifdef|ifndef|else|define)\b.*(?:\\\n.*)*\n)+\Z", re.M)
# A module has it, the library looks it up there.
OF_MODULES = {"hapode_device_module", "hapode_link_dds_module"}
SELF_EVIDENT = re.compile(r"^HAPODE_\w+_H$|^HAP_(BEGIN|END)_DECLS$")


def exported(library):
    run = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True,
                         check=True)
    words = [line.split() for line in run.stdout.splitlines()]
    return {w[-1] for w in words if len(w) >= 3 and w[-2] in "TDBRVW"}


def comment_before(text, at):
    """Whether a comment ends right before the line of this place, a blank line not between."""
    return text[:text.rfind("\n", 0, at) + 1].rstrip(" \n").endswith("*/") and not re.search(
        r"\*/\s*\n\s*\n\s*$", text[:text.rfind("\n", 0, at) + 1])


def items(body):
    """Lines of a struct or enum that declare something: (text, what comes before it)."""
    at = 0
    for line in body.split("\n"):
        begin, at = at, at + len(line) + 1
        code = lint.without_comments(body)[begin:begin + len(line)].strip()
        if re.search(r"[;,]$|^\w+( = [^,]*)?$", code):
            yield line, code, begin


def undocumented_items(name, body):
    commented = False
    for line, code, begin in items(body):
        here = "/*" in line
        # one comment may stand before a group of lines without a blank between
        commented = here or comment_before(body, begin + 1) or (
            commented and not body[:begin].endswith("\n\n"))
        if not commented:
            yield f"{name}: {code}"


def undocumented(header, text):
    for match in FUNCTION.finditer(text):
        if not comment_before(text, match.start()):
            yield f"{header}: {match.group(1)}()"
    for match in BLOCK.finditer(text):
        if not comment_before(text, match.start()) and "/*" not in match.group(3):
            yield f"{header}: {match.group(2)}"
        for problem in undocumented_items(match.group(2), match.group(3)):
            yield f"{header}: {problem}"
    opaque = set(OPAQUE.findall(text))
    for match in OTHER.finditer(text):
        line = text[match.start():text.find("\n", match.end())]
        commented = "/*" in line or comment_before(text, match.start())
        if match.group(1) not in opaque and not commented:
            yield f"{header}: {match.group(1)}"
    seen = set()
    for match in MACRO.finditer(text):
        line = text[match.start():text.find("\n", match.end())]
        # one comment for a group without a blank line between, one for all forms of a macro
        before = re.sub(DIRECTIVES, "", text[:match.start()])
        if not (SELF_EVIDENT.match(match.group(1)) or match.group(1) in seen or "/*" in line or
                before.rstrip(" ").endswith("*/\n")):
            yield f"{header}: {match.group(1)}"
        seen.add(match.group(1))


def main(root, library):
    tap = lint.Tap()
    folder = os.path.join(root, "include", "hapode")
    texts = {n: lint.read(folder, n) for n in sorted(os.listdir(folder)) if n.endswith(".h")}
    declared = {m.group(1) for t in texts.values()
                for m in FUNCTION.finditer(lint.without_comments(t))}
    if not library.endswith(".so") and ".so." not in library:
        tap.skip("exports are what the headers declare", "needs a shared library")
    elif not shutil.which("nm"):
        tap.skip("exports are what the headers declare", "needs nm")
    else:
        have = exported(library)
        tap.point("exports are what the headers declare",
                  [f"declared, not exported: {n}" for n in sorted(declared - have - OF_MODULES)] +
                  [f"exported, not declared: {n}" for n in sorted(have - declared)])
    for name, text in texts.items():
        tap.point(f"everything in {name} has a comment", undocumented(name, text))
    tap.done()


main(sys.argv[1], sys.argv[2])
