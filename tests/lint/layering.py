#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""layering.py ROOT: what may include what, between folders and inside them, one door to the heap,
no exit.

Inside a folder the order of the .c files in meson.build is the flow: a file knows those before it.
An arrow goes from a file to one whose header it includes or one of whose functions it names."""
import fnmatch
import os
import posixpath
import re
import sys

import lint

# The physics side, in the order of the data flow.
PHYSICS_SIDE = ["lib/world", "lib/near", "lib/probe", "lib/research", "lib/accuracy", "lib/physics"]

# The tick likewise.
TICK = ["lib/solver", "lib/pointer", "lib/local", "lib/paper", "lib/guard", "lib/tick"]

# Folder: folders whose headers it may include besides its own and include/hapode. "*": any.
LAYERS = {
    "include/hapode": [],
    "lib/base": [],
    "lib/sync": ["lib/base", "lib/proximity"],
    "lib/proximity": ["lib/base"],
    "lib/wire": ["lib/base", "lib/sync", "lib/proximity"],
    "lib/device": ["lib/base"],
    "lib/link": ["lib/base", "lib/device"],
    "lib/remote": ["lib/base", "lib/sync", "lib/wire"],
    "lib/solver": ["lib/base"],
    "lib/pointer": ["lib/base", "lib/sync"],
    "lib/local": ["lib/base", "lib/sync", "lib/proximity", "lib/solver", "lib/pointer"],
    "lib/paper": ["lib/base", "lib/sync", "lib/pointer", "lib/local"],
    "lib/guard": ["lib/base", "lib/sync", "lib/pointer", "lib/local"],
    "lib/tick": ["lib/base", "lib/sync", *TICK],
    "lib/record": ["lib/base"],
    "lib/contact": ["lib/base", "lib/sync", "lib/proximity", "lib/record"],
    "lib/haptic": ["lib/base", "lib/sync", *TICK, "lib/device", "lib/record"],
    "lib/world": ["lib/base", "lib/sync", "lib/proximity"],
    "lib/near": ["lib/base", "lib/sync", "lib/proximity", "lib/record", *PHYSICS_SIDE],
    "lib/probe": ["lib/base", "lib/sync", "lib/proximity", "lib/world", "lib/near"],
    "lib/research": ["lib/base", "lib/sync", "lib/proximity", "lib/world", "lib/near", "lib/probe"],
    "lib/accuracy": ["lib/base", "lib/sync", "lib/proximity", *TICK, "lib/world", "lib/near",
                     "lib/probe", "lib/research"],
    "lib/physics": ["lib/base", "lib/sync", "lib/proximity", "lib/record", *PHYSICS_SIDE],
    "lib/session": ["lib/*"],
    "lib/scene": ["lib/*", "scenes"],
    "plugins/skeleton": [],
    "plugins/common": ["lib/base", "lib/sync"],
    "plugins/*": ["lib/base", "plugins/common"],
    "scenes": [],
    "view": [],
    "import": ["lib/base"],
    "examples": [],
    "tools": ["*"],
    "tools/conform": ["*"],
    "tools/spidar-emulator": ["*"],
    "bench": ["*"],
    "tests": ["*"],
    "tests/*": ["*"],
}
ODE_USERS = [folder + "/*" for folder in PHYSICS_SIDE] + [
    "include/hapode/ode.h", "lib/scene/*", "scenes/*", "examples/*", "tests/*", "bench/*",
    "tools/*"]
HAPODE_ODE_USERS = ODE_USERS + ["lib/session/*ode*.c"]

# no part of the library: a heap of their own, no header of lib/
MODULES = ("plugins/skeleton/", "plugins/dds/")

QUITTERS = ("lib/base/assert.c",        # a mistake of this library, in builds with asserts
            "plugins/spidar/guard.c")  # forks a process of its own, which ends

# Arrows against the flow that a part may have, by the folders of the part; None: any, for now.
# Other folders have none.
BACKWARD_MAX = {
    "physics": (["lib/physics", "lib/world", "lib/near", "lib/probe", "lib/research",
                 "lib/accuracy"], 15),
    "tick": (TICK, 8),
    "lib/contact": (["lib/contact"], 2),
    "lib/device": (["lib/device"], 5),
    "lib/haptic": (["lib/haptic", "lib/loop"], 1),
    "lib/session": (["lib/session"], 2),
    "plugins/spidar": (["plugins/spidar"], 5),
}
LISTED = re.compile(r"'([^'\n]+\.c)'")
# A function that other files may call: its definition begins in the first column.
DEFINITION = re.compile(
    r"^(?!static\b|typedef\b)[A-Za-z_][\w \t\n*]*?\b(\w+)\([^;{}]*\)\s*\{", re.M)

INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"\n]+)[>"]', re.M)
# a call of the heap, but not of a member or of a hook with such a name
HEAP = re.compile(r"(?<![\w.>*])(malloc|calloc|realloc|reallocarray|free|strdup|strndup|"
                  r"aligned_alloc|posix_memalign|v?asprintf|getline)\s*\(")
QUIT = re.compile(r"(?<![\w.>*])(exit|_exit|_Exit|quick_exit|abort)\s*\(")

SPDX = ("SPDX-FileCopyrightText: hapode contributors", "SPDX-License-Identifier: MIT")


def fits(name, patterns):
    return any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


def layer_of(name):
    """The deepest folder of the table that holds the file; None: the table does not know it."""
    folder = posixpath.dirname(name)
    while folder:
        for layer in LAYERS:
            if fnmatch.fnmatchcase(folder, layer) and folder.count("/") == layer.count("/"):
                return layer
        folder = posixpath.dirname(folder)
    return None


def resolve(root, name, target):
    """The project's file that an #include means, None for any other."""
    for start in (posixpath.dirname(name), "lib", "", "include"):
        path = posixpath.normpath(posixpath.join(start, target))
        if not path.startswith("..") and os.path.isfile(os.path.join(root, path)):
            return path
    return None


def includes(root, name):
    """(line, target as written, project's file or None)"""
    text = re.sub(r"/\*.*?\*/", lambda m: re.sub(r"[^\n]", " ", m.group()),
                  lint.read(root, name), flags=re.S)
    for match in INCLUDE.finditer(text):
        target = match.group(2)
        yield text.count("\n", 0, match.start()) + 1, target, resolve(root, name, target)


def check_layers(root, files):
    for name in files:
        layer = layer_of(name)
        if layer is None:
            yield f"{name}: its folder is not in the table of layering.py"
            continue
        for line, target, path in includes(root, name):
            if path is None or path.startswith("include/hapode/"):
                continue
            other = posixpath.dirname(path)
            # a folder of its own layer; for plugins/* that is the same plugin
            same = other == posixpath.dirname(name) or (
                layer_of(path) == layer and "*" not in layer)
            if not same and not fits(other, LAYERS[layer]):
                yield f"{name}:{line}: {layer} must not include {target}"


def check_ode(root, files):
    for name in files:
        for line, target, path in includes(root, name):
            if target.startswith("ode/") and path is None and not fits(name, ODE_USERS):
                yield f"{name}:{line}: must not include {target}"
            if path == "include/hapode/ode.h" and not fits(name, HAPODE_ODE_USERS):
                yield f"{name}:{line}: must not include {target}"


def listed_units(root, files):
    """{name without ".c": its place in the lists of the meson.build files}"""
    places = {}
    for build in lint.project_files(root):
        if posixpath.basename(build) == "meson.build":
            for name in LISTED.findall(lint.read(root, build)):
                path = posixpath.normpath(posixpath.join(posixpath.dirname(build), name))
                if path in files:
                    places.setdefault(path[:-2], len(places))
    return places


def arrows_inside(root, files):
    """Pairs of units of one folder; a unit is a .c file with its header."""
    texts = {name: lint.without_comments(lint.read(root, name)) for name in files}
    definer = {match.group(1): name[:-2] for name, text in texts.items() if name.endswith(".c")
               for match in DEFINITION.finditer(text)}
    arrows = set()
    for name, text in texts.items():
        ends = {definer[word] for word in set(re.findall(r"\w+", text)) if word in definer}
        ends |= {path[:-2] for _, _, path in includes(root, name) if path is not None}
        arrows |= {(name[:-2], end) for end in ends if end != name[:-2] and
                   posixpath.dirname(end) == posixpath.dirname(name)}
    return arrows


def part_of(folder):
    for part, (folders, most) in BACKWARD_MAX.items():
        if folder in folders:
            return part, most
    return folder, 0


def check_flow(root, files, tap):
    places = listed_units(root, files)
    tap.point("every file is in a list of meson.build",
              [name for name in files if name.endswith(".c") and name[:-2] not in places])
    parts = {}  # part: [most, arrows, those against the flow]
    for begin, end in sorted(arrows_inside(root, files)):
        if begin in places and end in places:
            part, most = part_of(posixpath.dirname(begin))
            row = parts.setdefault(part, [most, 0, []])
            row[1] += 1
            if places[end] > places[begin]:
                row[2].append(f"{begin} -> {posixpath.basename(end)}")
    for part, (most, count, backward) in sorted(parts.items()):
        print(f"# {part}: {len(backward)} of {count} arrows against the flow")
        if most is not None:
            tap.point(f"{part}: at most {most} arrows against the flow",
                      backward if len(backward) > most else [])


def check_calls(root, files, pattern):
    for name in files:
        for number, line in enumerate(lint.without_comments(lint.read(root, name)).split("\n"), 1):
            for match in pattern.finditer(line):
                yield f"{name}:{number}: {match.group(1)}"


def needs_licence(root, name):
    if name.startswith("tests/fuzz/corpus/"):
        return False  # data, and its first bytes may be any
    if name.endswith((".c", ".h", ".py", ".sh")) or name.endswith(("meson.build", "options.txt")):
        return True
    with open(os.path.join(root, name), "rb") as f:
        return f.read(2) == b"#!"


def check_licence(root, names):
    for name in names:
        lines = lint.read(root, name).split("\n")
        if name.endswith((".c", ".h")):
            good = lines[:2] == [f"/* {SPDX[0]}", f" * {SPDX[1]} */"]
        else:
            start = 1 if lines[0].startswith("#!") else 0
            good = lines[start:start + 2] == [f"# {SPDX[0]}", f"# {SPDX[1]}"]
        if not good:
            yield f"{name}:1: the two SPDX lines are not there"


def main(root):
    tap = lint.Tap()
    files = lint.code_files(root)
    inside = [n for n in files if n.startswith(("lib/", "plugins/"))]
    tap.point("there are files to check", [] if inside else ["no .c or .h file in lib/"])
    tap.point("includes go one way", check_layers(root, files))
    check_flow(root, inside, tap)
    tap.point("ODE is included only where it may", check_ode(root, files))
    tap.point("lib/base/alloc.c is the one door to the heap",
              check_calls(root, [n for n in inside if n != "lib/base/alloc.c" and
                                 not n.startswith(MODULES)], HEAP))
    tap.point("nothing ends the process",
              check_calls(root, [n for n in inside if n not in QUITTERS], QUIT))
    tap.point("every file has its licence",
              check_licence(root, [n for n in lint.project_files(root) if needs_licence(root, n)]))
    tap.done()


main(sys.argv[1])
