#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""make_main.py TEST_FILE OUTPUT: main for the tests of a file, in the order of the file."""
import re
import sys

source, output = sys.argv[1:]
with open(source, encoding="utf-8") as f:
    text = f.read()
if re.search(r"^int main\(", text, re.M):  # its own
    with open(output, "w", encoding="utf-8") as f:
        f.write("extern int tests_have_their_own_main;\n")
    sys.exit(0)
found = re.findall(r"^TEST(_EACH)?\((\w+)", text, re.M)
names = [name for each, name in found]
tables = [name for each, name in found if each]
twice = {name for name in names if names.count(name) > 1}
if not names or twice:
    sys.exit(f"{source}: no TEST" if not names else f"{source}: twice: {', '.join(sorted(twice))}")
set_up = re.search(r"^SET_UP\b", text, re.M)
lines = ['#include "tests/tap.h"', ""]
if set_up:
    lines += ["bool tap_set_up(void);"]
lines += [f"void test_{name}(void);" for name in names]
lines += [f"extern const tap_table rows_{name};" for name in tables]
lines += ["", "static const tap_test tests[] = {"]
lines += [f'    {{"{name}", test_{name}, {f"&rows_{name}" if name in tables else "NULL"}}},'
          for name in names]
lines += ["};", "", "int main(int argc, char **argv)", "{",
          "  return tap_main(tests, sizeof tests / sizeof tests[0], "
          f"{'tap_set_up' if set_up else 'NULL'}, argc, argv);", "}", ""]
with open(output, "w", encoding="utf-8") as f:
    f.write("\n".join(lines))
