#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""safety.py ROOT: the table of constants in docs/safety.md and lib/base/safety.h say the same, and
every constant is used.

Neither can change alone: who changes a number has to find its reason beside it."""
import re
import sys

import lint

PAGE = "docs/safety.md"
HEADER = "lib/base/safety.h"
ROW = re.compile(r"^\| `(HAPI_SAFETY_\w+)` \| ([^|]+?) \| ([^|]+?) \| ([^|]+?) \|$", re.M)
DEFINE = re.compile(r"^#define (HAPI_SAFETY_\w+)[ \t]+(\S+)[ \t]*(?:/\* (.*?) \*/)?", re.M)
NAME = re.compile(r"\bHAPI_SAFETY_\w+")


def table(found):
    return {name: (value, unit) for name, value, unit in found}


def differences(page, header):
    for name in sorted(page.keys() | header.keys()):
        if name not in header:
            yield f"{PAGE}: {name} is not in {HEADER}"
        elif name not in page:
            yield f"{HEADER}: {name} has no row in {PAGE}"
        elif page[name] != header[name]:
            yield (f"{name}: {PAGE} says {' '.join(page[name])}, "
                   f"{HEADER} says {' '.join(header[name])}")


def main(root):
    tap = lint.Tap()
    rows = ROW.findall(lint.read(root, PAGE))
    defines = DEFINE.findall(lint.read(root, HEADER))
    page = table((name, value, unit) for name, value, unit, _ in rows)
    header = table(defines)
    tap.point("there are constants", [] if page and header else ["none found"])
    tap.point("page and header say the same", differences(page, header))
    names = [name for name, *_ in rows]
    tap.point("no constant has two rows", {n for n in names if names.count(n) > 1})
    tap.point("every constant has a reason",
              [name for name, *_, reason in rows if len(reason.split()) < 4])
    used = set()
    for name in lint.code_files(root):
        if name != HEADER and name.startswith(("lib/", "plugins/")):
            used |= set(NAME.findall(lint.without_comments(lint.read(root, name))))
    tap.point("every constant is used", sorted(header.keys() - used))
    tests = re.findall(r"`(test_\w+)`", lint.read(root, PAGE))
    files = lint.code_files(root)
    tap.point("every test of the page exists",
              sorted({t for t in tests if f"tests/{t}.c" not in files}) if tests else ["none"])
    tap.done()


main(sys.argv[1])
