#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""structure.py ROOT: parameters, names, structs, headers and line widths (docs/style.md).

Functions and structs are found by universal-ctags; without it those points are skipped."""
import collections
import json
import posixpath
import re
import shutil
import subprocess
import sys

import lint

PARAMETERS_MAX = 6
FIELDS_MAX = 25
LARGE_FIELDS = 20  # a header has at most one struct with more
HEADER_MAX = 300
COLUMNS_MAX = 100

# Messages between threads and what an application fills in or reads as a whole, in its structs or
# in the one that holds a pointer's three: any size.
ANY_SIZE = re.compile(r"^(?:lib/sync/|lib/base/pointer_setup\.h:|"
                      r"include/hapode/.*:hap_\w*(?:_def|_stats)$)")

# Stand-ins for libraries have the functions that their makers declare.
OTHERS_FUNCTIONS = re.compile(r"^tests/modules/standin_\w+\.c$")

# Not written by people, or not for people.
GENERATED = ("tests/abi/", "tests/data/", "tests/fuzz/corpus/")


def is_universal():
    if not shutil.which("ctags"):
        return False
    version = subprocess.run(["ctags", "--version"], capture_output=True, text=True).stdout
    features = subprocess.run(["ctags", "--list-features"], capture_output=True, text=True).stdout
    return "Universal Ctags" in version and "json" in features


def tags_of(root, files):
    # ctags expands no macro by itself: TEST and TEST_EACH of tests/tap.h define functions
    command = ["ctags", "--options=NONE", "--languages=C", "--langmap=C:.c.h", "--kinds-C=fm",
               "-D", "HAP_BEGIN_DECLS=", "-D", "HAP_END_DECLS=", "-I", "HAP_API,HAP_NODISCARD",
               "-D", "TEST(name)=static void name(void)",
               "-D", "TEST_EACH(table, row)=static void test_each_row(row)", "--fields=+nszZSf",
               "--output-format=json", "--sort=no", "-f", "-", "-L", "-"]
    run = subprocess.run(command, cwd=root, input="\n".join(files) + "\n", capture_output=True,
                         text=True, check=True)
    return [json.loads(line) for line in run.stdout.splitlines()]


def parameter_count(signature):
    inner = signature.strip()[1:-1].strip()
    if inner in ("", "void"):
        return 0
    depth = 0
    commas = 0
    for c in inner:
        depth += (c in "([{") - (c in ")]}")
        commas += c == "," and depth == 0
    return commas + 1


def place_of(tag):
    return f"{tag['path']}:{tag['line']}: {tag['name']}"


def crowded_functions(functions):
    for tag in functions:
        count = parameter_count(tag.get("signature", "()"))
        if count > PARAMETERS_MAX and not OTHERS_FUNCTIONS.match(tag["path"]):
            yield f"{place_of(tag)}: {count} parameters"


def one_word_functions(functions):
    for tag in functions:
        if tag.get("file") and "_" not in tag["name"].strip("_"):
            yield place_of(tag)


def fields_by_struct(tags):
    """{(file, struct): count}; what lies in a struct without a name counts for itself."""
    fields = collections.Counter()
    for tag in tags:
        if tag["kind"] == "member" and tag.get("scopeKind") == "struct":
            fields[tag["path"], tag["scope"]] += 1
    return fields


def large_structs(fields):
    for (path, name), count in sorted(fields.items()):
        if count > FIELDS_MAX and not ANY_SIZE.match(f"{path}:{name}"):
            yield f"{path}: {name} has {count} fields"


def crowded_headers(fields):
    large = collections.defaultdict(list)
    for (path, name), count in sorted(fields.items()):
        if count > LARGE_FIELDS and path.endswith(".h") and not path.startswith("lib/sync/"):
            large[path].append(f"{name} ({count})")
    for path, names in large.items():
        if len(names) > 1:
            yield f"{path}: {', '.join(names)}"


def long_headers(root, files):
    for name in files:
        if name.endswith(".h") and not name.startswith("include/"):
            lines = len(lint.read(root, name).splitlines())
            if lines > HEADER_MAX:
                yield f"{name}: {lines} lines"


def is_program_text(root, name):
    if name.startswith(GENERATED):
        return False
    if name.endswith((".c", ".h", ".py", ".sh", ".rules")):
        return True
    if posixpath.basename(name) in ("meson.build", "meson_options.txt"):
        return True
    return lint.read(root, name).startswith("#!")


def wide_lines(root):
    for name in lint.project_files(root):
        if is_program_text(root, name):
            for number, line in enumerate(lint.read(root, name).split("\n"), 1):
                if len(line) > COLUMNS_MAX:
                    yield f"{name}:{number}: {len(line)} columns"


def check_tags(tap, root, files):
    tags = tags_of(root, files)
    functions = [tag for tag in tags if tag["kind"] == "function"]
    fields = fields_by_struct(tags)
    tap.point("functions and structs are found",
              [] if functions and fields else ["ctags finds nothing"])
    tap.point(f"no function has over {PARAMETERS_MAX} parameters", crowded_functions(functions))
    tap.point("static functions name their subject: two words", one_word_functions(functions))
    tap.point(f"no struct has over {FIELDS_MAX} fields", large_structs(fields))
    tap.point(f"a header has one struct of over {LARGE_FIELDS} fields", crowded_headers(fields))


def main(root):
    tap = lint.Tap()
    files = lint.code_files(root)
    if is_universal():
        check_tags(tap, root, files)
    else:
        tap.skip("functions and structs", "needs universal-ctags with json")
    tap.point(f"no internal header is over {HEADER_MAX} lines", long_headers(root, files))
    tap.point(f"no line is over {COLUMNS_MAX} columns", wide_lines(root))
    tap.done()


main(sys.argv[1])
