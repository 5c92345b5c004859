#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""private_words.py ROOT: no file tells of the machine it was written on, or of a package host."""
import os
import re
import sys

import lint

# In pieces, so that this file does not hold them.
FOLDERS = ["/" + name + "/" for name in ("work", "root")]
HOSTS = [name + "." + rest for name, rest in (
    ("deb", "debian.org"), ("security", "debian.org"), ("archive", "ubuntu.com"),
    ("pypi", "org"), ("files", "pythonhosted.org"), ("registry", "npmjs.org"),
    ("proxy", "golang.org"), ("static", "crates.io"))]
# a folder only where a path begins: "../network/root/x" is not one
PATTERN = re.compile(r"(?<![\w.})-])(?:%s)|(?<![\w.-])(?:%s)" % (
    "|".join(map(re.escape, FOLDERS)), "|".join(map(re.escape, HOSTS))))


def main(root):
    tap = lint.Tap()
    problems = []
    names = lint.project_files(root)
    for name in names:
        with open(os.path.join(root, name), "rb") as f:
            data = f.read()
        if b"\0" in data:
            continue
        for number, line in enumerate(data.decode("utf-8", "replace").split("\n"), 1):
            for match in PATTERN.finditer(line):
                problems.append(f"{name}:{number}: {match.group()}")
    tap.point("there are files to check", [] if names else ["none found"])
    tap.point("no file names a private path or a package host", problems)
    tap.done()


main(sys.argv[1])
