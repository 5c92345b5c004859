#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""used.py ROOT: every function of the public headers is in a test, in a program of examples/, and
on a page. What is not has a reason here; a reason that is not needed any more is a fault."""
import re
import sys

import lint

FUNCTION = re.compile(r"\bHAP_API\b[^;{]*?\b(\w+)\s*\([^;{]*\)\s*;")
SAME_EVERYWHERE = re.compile(r"_(init|name|text)$")  # pages name the struct or enum

# Function: why no page has it.
NO_PAGE = {
    "hap_version": "the header says all",
}

# Function: why no program of examples/ shows it.
NO_PROGRAM = {
    "hapode_device_module": "a module is no program: plugins/skeleton is the example",
    "hap_link_create": "a transport is no program: lib/link/link_local.c is the example",
}


def names_in(root, files):
    found = set()
    for name in files:
        found |= set(re.findall(r"\w+", lint.read(root, name)))
    return found


def main(root):
    tap = lint.Tap()
    files = lint.code_files(root)
    functions = {f for name in files if name.startswith("include/") and name.endswith(".h")
                 for f in FUNCTION.findall(lint.without_comments(lint.read(root, name)))}
    tests = names_in(root, [f for f in files if f.startswith("tests/")])
    programs = {name for f in files if f.startswith("examples/")
                for name in re.findall(r"\w+", lint.without_comments(lint.read(root, f)))}
    pages = names_in(root, [f for f in lint.project_files(root) if f.endswith(".md") and
                            (f == "README.md" or f.startswith("docs/"))])
    tap.point("there are functions", [] if functions else ["none found"])
    tap.point("every function is in a test", sorted(functions - tests))
    tap.point("every function is in a program", sorted(functions - programs - NO_PROGRAM.keys()))
    asked = {f for f in functions if not SAME_EVERYWHERE.search(f)}
    tap.point("every function is on a page", sorted(asked - pages - NO_PAGE.keys()))
    tap.point("every exception is needed",
              sorted((NO_PAGE.keys() & pages) | (NO_PROGRAM.keys() & programs) |
                     ((NO_PAGE.keys() | NO_PROGRAM.keys()) - functions)))
    tap.done()


main(sys.argv[1])
