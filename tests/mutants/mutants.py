#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""mutants.py ROOT SCRATCH [--list] [--only TEXT,...] [--sample N] [--seconds S]: whether the
tests notice when safety code is wrong.

Mutants are made by rules, from the files of AREAS:
- each number of a "#define" times 10 and by 10,
- each condition of an "if" negated,
- each statement that takes force away left out.

All of them are built once, in a copy of ROOT in SCRATCH: HAPODE_MUTANT in the environment chooses
one. A number that must be a constant of the language gets a build of its own. A mutant is killed
when a test of its area fails or takes too long. Survivors are printed. Exit 0: there are none but
those of equivalent.txt, each of which has a line KEY and a line that says why.

--sample N takes N of them, evenly. --seconds S stops when that time is over."""
import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time

GUARD_TESTS = ["guard", "guard_session", "faults", "late", "false_input"]
WATCH_TESTS = ["emergency", "watchdog", "guard_session", "module", "faults_threads"]
SPIDAR_TESTS = ["spidar_device", "spidar_errors", "spidar_frames", "spidar_emulator", "spidar",
                "false_input", "spidar_the"]

# Pattern of files: tests that should notice, the fast ones first.
AREAS = [
    ("lib/device/emergency.c", WATCH_TESTS),
    ("lib/device/watchdog.c", WATCH_TESTS),
    ("lib/haptic/standstill.c", WATCH_TESTS),
    ("lib/guard/lateness.c", ["late", "guard"]),
    ("lib/guard/*.c", GUARD_TESTS + ["session_devices"]),
    ("lib/pointer/plausible.c", ["false_input", "faults", "late"]),
    ("lib/base/safety.h", GUARD_TESTS + WATCH_TESTS + SPIDAR_TESTS + ["spidar_guard"]),
    ("plugins/spidar/guard.c", ["spidar_guard", "spidar"]),
    ("plugins/spidar/belief.c", ["spidar_device", "false_input", "spidar_emulator"]),
    ("plugins/spidar/serial.c", ["spidar_errors", "spidar", "spidar_emulator"]),
    ("plugins/spidar/line.c", ["spidar_emulator", "spidar_errors", "spidar"]),
    ("plugins/spidar/cycle.c", ["spidar_frames", "spidar_emulator", "spidar"]),
    ("plugins/spidar/tensions.c", ["spidar_tensions", "spidar_emulator", "spidar"]),
    ("plugins/spidar/heat.c", ["spidar_tensions", "spidar_emulator"]),
    ("plugins/spidar/spidar.c", SPIDAR_TESTS),
]

PATIENCE = 4.0  # a test may take so much longer on a busy machine
PATIENCE_S = 10.0

NUMBER = re.compile(r"^#define (\w+) (-?[0-9][0-9.e+-]*)(?=\s|$)", re.M)
CONDITION = re.compile(r"\bif \(")
TAKES_FORCE = re.compile(r"^( *)((?:\(void\)!?)?(?:[\w.]+->zero|send_zeros|hapi_guard_cut|"
                         r"hap_emergency_zero|zero_once|[a-z_]+_zero)\([^;{]*\);)", re.M)
COMMENT = re.compile(r"/\*.*?\*/", re.S)
STRING = re.compile(r'"(?:[^"\\\n]|\\.)*"')

DECLARATION = "extern int hapode_mutant;\n"
DEFINITION = """
#include <stdlib.h>
int hapode_mutant;
__attribute__((constructor)) static void mutant_read(void)
{
  const char *text = getenv("HAPODE_MUTANT");
  hapode_mutant = text != NULL ? atoi(text) : 0;
}
"""


class Mutant:
    def __init__(self, path, kind, text, tests):
        self.path, self.kind, self.text, self.tests = path, kind, " ".join(text.split()), tests
        self.number = 0
        self.repeat = 0
        self.name = None  # of a constant
        self.value = None
        self.alone = False  # has a build of its own

    def key(self):
        more = f" #{self.repeat}" if self.repeat else ""
        return f"{self.path}: {self.kind}: {self.text}{more}"


def blanked(source):
    """The same length, without what stands in comments and strings."""
    def spaces(match):
        return re.sub(r"[^\n]", " ", match.group())
    return STRING.sub(spaces, COMMENT.sub(spaces, source))


def closing(text, at):
    depth = 0
    for i in range(at, len(text)):
        depth += (text[i] == "(") - (text[i] == ")")
        if depth == 0:
            return i
    raise ValueError("parentheses do not match")


def places_of(path, source, tests):
    """[(begin, end, how to write it, its mutants)]"""
    bare = blanked(source)
    places = []
    for m in NUMBER.finditer(bare):
        times, by = (Mutant(path, kind, m.group(), tests) for kind in ("x 10", "/ 10"))
        for mutant in (times, by):
            mutant.name, mutant.value = m.group(1), m.group(2)
        places.append((m.start(2), m.end(2), "number", [times, by]))
    for m in CONDITION.finditer(bare):
        end = closing(bare, m.end() - 1)
        mutant = Mutant(path, "negated", source[m.end() - 1:end + 1], tests)
        places.append((m.end() - 1, end + 1, "condition", [mutant]))
    if path.endswith(".c"):
        for m in TAKES_FORCE.finditer(bare):
            mutant = Mutant(path, "left out", source[m.start(2):m.end(2)], tests)
            places.append((m.start(2), m.end(2), "statement", [mutant]))
    return sorted(places, key=lambda place: place[0])


def ten_times(mutant):
    factor = "10.0" if re.search(r"[.e]", mutant.value) else "10"
    return f"(({mutant.value}) {'*' if mutant.kind == 'x 10' else '/'} {factor})"


def written(how, old, mutants):
    if how == "condition":
        return f"(!{old} == (hapode_mutant == {mutants[0].number}))"
    if how == "statement":
        return f"if (hapode_mutant != {mutants[0].number}) {{ {old} }}"
    times, by = mutants
    return (f"(hapode_mutant == {times.number} ? {ten_times(times)} : "
            f"hapode_mutant == {by.number} ? {ten_times(by)} : ({old}))")


def mutate(source, places):
    for begin, end, how, mutants in reversed(places):  # from the end: what is before stays in place
        if not mutants[0].alone:
            source = source[:begin] + written(how, source[begin:end], mutants) + source[end:]
    return source


class Scratch:
    def __init__(self, root, folder):
        self.root = root
        self.tree = os.path.join(folder, "tree")
        self.build = os.path.join(folder, "build")
        self.texts = {}
        self.needed = []
        self.tests = {}
        self.seconds = {}
        shutil.rmtree(folder, ignore_errors=True)
        names = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, text=True,
                               check=True).stdout.split("\0")
        for name in filter(None, names):
            target = os.path.join(self.tree, name)
            os.makedirs(os.path.dirname(target), exist_ok=True)
            shutil.copy2(os.path.join(root, name), target)
        with open(os.path.join(folder, "mutant.h"), "w", encoding="utf-8") as f:
            f.write(DECLARATION)
        with open(os.path.join(self.tree, "lib/base/status.c"), "a", encoding="utf-8") as f:
            f.write(DEFINITION)
        # One library: with asserts, as tests have it anyway.
        subprocess.run(["meson", "setup", "-Dlint=disabled", "-Dwerror=false", "-Dwarning_level=0",
                        "-Dbuildtype=plain", "-Dplots=disabled", "-Dasserts=enabled",
                        "-Ddefault_library=static",
                        f"-Dc_args=-include {os.path.join(folder, 'mutant.h')} -w -O1",
                        self.build, self.tree], check=True, stdout=subprocess.DEVNULL)

    def write(self, path, text):
        with open(os.path.join(self.tree, path), "w", encoding="utf-8") as f:
            f.write(text)

    def read(self, path):
        """As it was copied: somebody may work in the root meanwhile."""
        if path not in self.texts:
            with open(os.path.join(self.tree, path), encoding="utf-8") as f:
                self.texts[path] = f.read()
        return self.texts[path]

    def look(self, wanted):
        """Which of these tests there are; what they need is built from then on."""
        run = subprocess.run(["meson", "introspect", "--tests", "--targets", self.build],
                             capture_output=True, text=True, check=True)
        about = json.loads(run.stdout)
        tests = {test["name"]: test for test in about["tests"] if test["name"] in wanted}
        needed = {name for test in tests.values() for name in test["depends"]}
        files = {f for target in about["targets"] if target["id"] in needed
                 for f in target["filename"]}
        files |= {test["cmd"][0] for test in tests.values()}
        self.needed = [os.path.relpath(f, self.build) for f in sorted(files)
                       if f.startswith(self.build)]
        self.tests = tests

    def make(self):
        """"" or what the compiler says."""
        run = subprocess.run(["ninja", "-C", self.build, *self.needed], capture_output=True,
                             text=True)
        return "" if run.returncode == 0 else run.stdout + run.stderr

    def fails(self, test, number):
        """Whether the test fails with that mutant, or takes far longer than without any."""
        about = self.tests[test]
        patience = PATIENCE_S + PATIENCE * self.seconds.get(test, about["timeout"])
        environment = dict(os.environ, **about["env"], HAPODE_MUTANT=str(number))
        with subprocess.Popen(about["cmd"], env=environment, cwd=self.build, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                              start_new_session=True) as run:
            try:
                said, _ = run.communicate(timeout=patience)
            except subprocess.TimeoutExpired:
                os.killpg(run.pid, signal.SIGKILL)
                return True
        return run.returncode != 0 or re.search(r"^(not ok|Bail out!)", said, re.M) is not None

    def measure(self):
        """Those that fail without a mutant; of the others, how long they take."""
        failing = set()
        for test in sorted(self.tests):
            begin = time.monotonic()
            if self.fails(test, 0):
                failing.add(test)
            self.seconds[test] = time.monotonic() - begin
        return failing

    def killer(self, tests, number):
        """The first test that fails, or None."""
        return next((test for test in tests if self.fails(test, number)), None)


def find_mutants(root, scratch, only):
    files = subprocess.run(["git", "ls-files", "lib", "plugins"], cwd=root, capture_output=True,
                           text=True, check=True).stdout.split()
    found = {}
    seen = {}
    number = 0
    for pattern, tests in AREAS:
        expression = re.compile(pattern.replace(".", r"\.").replace("*", "[^/]*") + "$")
        for path in filter(expression.match, files):
            if path in found or not any(text in path for text in only.split(",")):
                continue
            found[path] = places_of(path, scratch.read(path), tests)
            for mutant in (m for place in found[path] for m in place[3]):
                number += 1
                mutant.number = number
                mutant.repeat = seen.get(mutant.key(), 0)
                seen[mutant.key()] = mutant.repeat + 1
    return found


def build_all(scratch, found):
    """Constants that the compiler wants to know are built alone."""
    constants = {m.name: places for places in found.values() for p in places for m in p[3]
                 if m.name}
    for _ in range(10):
        for path, places in found.items():
            scratch.write(path, mutate(scratch.read(path), places))
        said = scratch.make()
        named = {name for name in re.findall(r"expansion of macro '(\w+)'", said)
                 if name in constants}
        named |= {name for name in constants if re.search(rf"error:.*\n[^\n]*\b{name}\b", said)}
        if not said:
            return
        if not named:
            sys.exit("the mutants do not build:\n" + said[-3000:])
        for mutant in (m for places in found.values() for p in places for m in p[3]):
            mutant.alone = mutant.alone or mutant.name in named
    sys.exit("the mutants do not build")


def killed_alone(scratch, found, mutant, tests):
    """By which test. One that must be built: then it is the only one in its file."""
    source = scratch.read(mutant.path)
    place = next(p for p in found[mutant.path] if mutant in p[3])
    scratch.write(mutant.path, source[:place[0]] + ten_times(mutant) + source[place[1]:])
    said = scratch.make()
    result = "it does not build" if said else scratch.killer(tests, 0)
    scratch.write(mutant.path, mutate(source, found[mutant.path]))
    return result


def equivalents_of(root):
    with open(os.path.join(root, "tests/mutants/equivalent.txt"), encoding="utf-8") as f:
        lines = [line.rstrip("\n") for line in f if line.strip() and not line.startswith("#")]
    return {key: why.strip() for key, why in zip(lines[::2], lines[1::2])}


def arguments():
    parser = argparse.ArgumentParser()
    parser.add_argument("root")
    parser.add_argument("scratch")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--only", default="")
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=0.0)
    return parser.parse_args()


def main():
    options = arguments()
    root = os.path.abspath(options.root)
    begin = time.monotonic()
    scratch = Scratch(root, os.path.abspath(options.scratch))
    found = find_mutants(root, scratch, options.only)
    mutants = [m for places in found.values() for p in places for m in p[3]]
    if options.list:
        print("\n".join(m.key() for m in mutants))
        return 0
    scratch.look({t for m in mutants for t in m.tests})
    build_all(scratch, found)
    failing = scratch.measure()
    if failing:
        print("# these fail without a mutant and are not used: " + " ".join(sorted(failing)))
    step = max(1, len(mutants) // options.sample) if options.sample else 1
    known = equivalents_of(root)
    survivors, tried, equivalent = [], 0, 0
    for mutant in mutants[::step]:
        if options.seconds and time.monotonic() - begin > options.seconds:
            print("# the time is over")
            break
        if mutant.key() in known:
            equivalent += 1
            continue
        tried += 1
        tests = [t for t in mutant.tests if t in scratch.tests and t not in failing]
        by = (killed_alone(scratch, found, mutant, tests) if mutant.alone
              else scratch.killer(tests, mutant.number))
        print(f"{'killed by ' + by if by else 'SURVIVES'}: {mutant.key()}", flush=True)
        if by is None:
            survivors.append(mutant)
    print(f"# {len(mutants)} mutants, {tried} tried, {tried - len(survivors)} killed, "
          f"{len(survivors)} survive, {equivalent} equivalent")
    for mutant in survivors:
        print("not ok - survives: " + mutant.key())
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
