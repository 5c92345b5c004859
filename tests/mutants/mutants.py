#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""mutants.py ROOT SCRATCH [--list] [--only TEXT,...] [--like TEXT,...] [--tests TEST,...]
[--sample N] [--seconds S]: whether the tests notice when safety code is wrong.

Mutants are made by rules, from the files of AREAS:
- each number of a "#define" times 10 and by 10,
- each condition of an "if" negated,
- each statement that takes force away left out.

All of them are built once, in a copy of ROOT in SCRATCH: HAPODE_MUTANT in the environment chooses
one. A number that must be a constant of the language gets a build of its own. Each test runs once
without a mutant, and tells the places it passes. A mutant is killed when a test that passes its
place fails or takes too long. Survivors are printed. A second run with the same SCRATCH builds what
has changed, and begins with the tests that killed in the first one. Exit 0: there are none but
those of equivalent.txt, each of which has a line KEY and a line that says why.

--only: files with TEXT in their paths. --like: mutants with TEXT in their lines, as they are
printed. --tests: of the tests that should notice these alone, and no programs that they start.
--sample N takes N mutants, evenly. --seconds S stops when that time is over."""
import argparse
import filecmp
import json
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import time

GUARD_TESTS = ["guard", "guard_session", "faults", "late", "false_input", "oscillation", "declared",
               "session_devices", "pointer_set", "safety_numbers"]
GRIP_TESTS = ["grab", "adhesion"]
FEEL_TESTS = ["axes", "surfaces", "effects", "forces", "bound_forces", "force_calls",
              "surface_magnets", "impact", "forces_stable"]
WATCH_TESTS = ["emergency", "watchdog", "guard_session", "module", "faults_threads"]
SPIDAR_TESTS = ["spidar_device", "spidar_errors", "spidar_frames", "spidar_emulator", "spidar",
                "false_input", "spidar_the"]

CONTACT_TESTS = ["haptic_rt"]

# Pattern of files: tests that should notice, the fast ones first.
AREAS = [
    ("lib/device/emergency.c", WATCH_TESTS),
    ("lib/device/watchdog.c", WATCH_TESTS),
    ("lib/haptic/standstill.c", WATCH_TESTS),
    ("lib/haptic/texture_time.c", ["texture_time", "surfaces"]),
    ("lib/guard/*.c", GUARD_TESTS + GRIP_TESTS),
    ("lib/pointer/device_pace.c", ["device_pace", "false_input"]),
    ("lib/pointer/plausible.c", ["safety_numbers", "false_input", "faults", "late"]),
    ("lib/base/safety.h", GUARD_TESTS + GRIP_TESTS + FEEL_TESTS + WATCH_TESTS +
     SPIDAR_TESTS + CONTACT_TESTS + ["spidar_guard", "device_pace", "vendor"]),
    ("plugins/common/relay*.c", ["vendor", "haply"]),
    ("plugins/forcedimension/forcedimension.c", ["vendor"]),
    ("plugins/openhaptics/openhaptics.c", ["vendor"]),
    ("plugins/haply/haply.c", ["haply"]),
    ("plugins/spidar/guard.c", ["spidar_guard", "spidar"]),
    ("plugins/spidar/belief.c", ["spidar_device", "safety_numbers", "false_input",
                                 "spidar_emulator"]),
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

STATUS = "lib/base/status.c"
DECLARATION = """extern int hapode_mutant;
extern unsigned char *hapode_reached;
#define HAPODE_MUTANT(number) (hapode_reached[number] = 1, hapode_mutant == (number))
"""
# Processes share what is reached, whatever ends them.
DEFINITION = """
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>
int hapode_mutant;
static unsigned char nowhere[10000];
unsigned char *hapode_reached = nowhere;
__attribute__((constructor)) static void mutant_read(void)
{
  const char *text = getenv("HAPODE_MUTANT");
  const char *path = getenv("HAPODE_REACH");
  int file = path != NULL ? open(path, O_RDWR | O_CLOEXEC) : -1;
  hapode_mutant = text != NULL ? atoi(text) : 0;
  if (file >= 0) {
    off_t size = lseek(file, 0, SEEK_END);
    void *all = mmap(NULL, (size_t)size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    hapode_reached = all != MAP_FAILED ? all : nowhere;
    (void)close(file);
  }
}
"""
PASSES, FAILS, HANGS = "passes", "fails", "hangs"
FAILED = re.compile(rb"^(not ok|Bail out!)", re.M)
PASSED = re.compile(rb"^ok \d+ - ((?:(?! # SKIP).)+)$", re.M)


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
        return f"(!{old} == HAPODE_MUTANT({mutants[0].number}))"
    if how == "statement":
        return f"if (!HAPODE_MUTANT({mutants[0].number})) {{ {old} }}"
    times, by = mutants
    return (f"(HAPODE_MUTANT({times.number}) ? {ten_times(times)} : "
            f"HAPODE_MUTANT({by.number}) ? {ten_times(by)} : ({old}))")


def mutate(source, places):
    for begin, end, how, mutants in reversed(places):  # from the end: what is before stays in place
        if not mutants[0].alone:
            source = source[:begin] + written(how, source[begin:end], mutants) + source[end:]
    return source


class Unit:
    """One test of a program of tests, or the whole program where it cannot run one alone."""
    def __init__(self, about, only=""):
        self.command = [about["cmd"][0], f"only={only}"] if only else about["cmd"]
        self.environment = about["env"]
        self.name = f"{about['name']}: {only}" if only else about["name"]
        self.seconds = about["timeout"]
        self.reached = b""  # for each mutant, whether its place is passed
        self.kills = 0

    def sees(self, mutant):
        return mutant.alone or self.reached[mutant.number] != 0


class Scratch:
    def __init__(self, root, folder):
        self.root = root
        self.tree = os.path.join(folder, "tree")
        self.build = os.path.join(folder, "build")
        self.reach = os.path.join(folder, "reach")
        self.texts = {}
        self.needed = []
        self.units = {}  # of each test
        run = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, text=True,
                             check=True)
        self.files = sorted(name for name in run.stdout.split("\0")
                            if os.path.isfile(os.path.join(root, name)))
        self.copy(folder)
        if not os.path.exists(os.path.join(self.build, "build.ninja")):
            # One library: with asserts, as tests have it anyway.
            subprocess.run(["meson", "setup", "-Dlint=disabled", "-Dwerror=false",
                            "-Dwarning_level=0", "-Dbuildtype=plain", "-Dplots=disabled",
                            "-Dasserts=enabled", "-Ddefault_library=static",
                            f"-Dc_args=-include {os.path.join(folder, 'mutant.h')} -w -O1",
                            self.build, self.tree], check=True, stdout=subprocess.DEVNULL)

    def copy(self, folder):
        """Files that are as they were keep their time, so a second run builds what has changed."""
        old = [os.path.relpath(os.path.join(place, name), self.tree)
               for place, _, names in os.walk(self.tree) for name in names]
        for name in set(old) - set(self.files):
            os.remove(os.path.join(self.tree, name))
        for name in self.files:
            source, target = os.path.join(self.root, name), os.path.join(self.tree, name)
            if name == STATUS:
                self.write(name, self.read(name) + DEFINITION)
            elif tests_of(name):
                self.read(name)  # build_all writes it
                os.makedirs(os.path.dirname(target), exist_ok=True)
                if not os.path.exists(target):
                    self.write(name, self.read(name))
            elif not (os.path.exists(target) and filecmp.cmp(source, target, shallow=False)):
                os.makedirs(os.path.dirname(target), exist_ok=True)
                shutil.copy(source, target)
        write_changed(os.path.join(folder, "mutant.h"), DECLARATION)

    def write(self, path, text):
        write_changed(os.path.join(self.tree, path), text)

    def read(self, path):
        """As it was at first: somebody may work in the root meanwhile."""
        if path not in self.texts:
            with open(os.path.join(self.root, path), encoding="utf-8") as f:
                self.texts[path] = f.read()
        return self.texts[path]

    def look(self, wanted, with_programs):
        """Which of these tests there are; what they need is built from then on."""
        run = subprocess.run(["meson", "introspect", "--tests", "--targets", self.build],
                             capture_output=True, text=True, check=True)
        about = json.loads(run.stdout)
        tests = {test["name"]: test for test in about["tests"] if test["name"] in wanted}
        needed = {name for test in tests.values() for name in test["depends"] if with_programs}
        files = {f for target in about["targets"] if target["id"] in needed
                 for f in target["filename"]}
        files |= {test["cmd"][0] for test in tests.values()}
        self.needed = [os.path.relpath(f, self.build) for f in sorted(files)
                       if f.startswith(self.build)]
        return tests

    def make(self):
        """"" or what the compiler says."""
        run = subprocess.run(["ninja", "-C", self.build, *self.needed], capture_output=True,
                             text=True)
        return "" if run.returncode == 0 else run.stdout + run.stderr

    def run(self, unit, number):
        """PASSES, FAILS, as soon as the first check does, or HANGS: far longer than without any
        mutant. And the names of the tests that passed."""
        environment = dict(os.environ, **unit.environment, HAPODE_MUTANT=str(number),
                           HAPODE_REACH=self.reach)
        end = time.monotonic() + PATIENCE_S + PATIENCE * unit.seconds
        said = b""
        with subprocess.Popen(unit.command, env=environment, cwd=self.build, bufsize=0,
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                              start_new_session=True) as run:
            while not FAILED.search(said):
                ready, _, _ = select.select([run.stdout], [], [], end - time.monotonic())
                more = run.stdout.read(65536) if ready else b""
                if not ready or not more:
                    break
                said += more
            hangs = not FAILED.search(said) and not ready
            if hangs or FAILED.search(said):
                os.killpg(run.pid, signal.SIGKILL)
            code = run.wait()
        names = [name.decode() for name in PASSED.findall(said)]
        return HANGS if hangs else FAILS if code or FAILED.search(said) else PASSES, names

    def measure(self, tests, count):
        """Each test alone without a mutant: how long it takes, and which mutants it sees."""
        failing = []
        for name, about in sorted(tests.items()):
            whole = Unit(about)
            self.units[name] = []
            result, names = self.run(whole, 0)
            if result == PASSES and runs_alone(self.texts_of_test(about)):
                # Words are begins of names, and commas part them.
                units = [Unit(about, only) for only in dict.fromkeys(
                    name.split(",")[0] for name in names)]
            else:
                units = [whole]
            for unit in units:
                with open(self.reach, "wb") as f:
                    f.write(bytes(count + 1))
                begin = time.monotonic()
                result, _ = self.run(unit, 0)
                unit.seconds = time.monotonic() - begin
                with open(self.reach, "rb") as f:
                    unit.reached = f.read()
                if result == PASSES:
                    self.units[name].append(unit)
                else:
                    failing.append(unit.name)
        return failing

    def texts_of_test(self, about):
        name = os.path.basename(about["cmd"][0]) + ".c"
        return self.read(os.path.join("tests", name)) if f"tests/{name}" in self.files else ""

    def killer(self, mutant, number, first):
        """The unit that fails with the mutant, and does not without, or None. Those that killed
        most in their time come first."""
        units = [u for test in mutant.tests for u in self.units.get(test, ()) if u.sees(mutant)]
        units.sort(key=lambda u: (u.name != first, u.seconds / (1.0 + u.kills)))
        for unit in units:
            result, _ = self.run(unit, number)
            if result == PASSES:
                continue
            # On a busy machine a test of threads may fail by itself.
            again = self.run(unit, number)[0] if result == FAILS else result
            if again != PASSES and (number == 0 or self.run(unit, 0)[0] == PASSES):
                unit.kills += 1
                return unit
        return None


def write_changed(path, text):
    try:
        with open(path, encoding="utf-8") as f:
            if f.read() == text:
                return
    except FileNotFoundError:
        os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8") as f:
        f.write(text)


def runs_alone(source):
    """Whether "only=NAME" is understood: not by programs with a main of their own."""
    return source != "" and re.search(r"^int main\(", source, re.M) is None


def tests_of(path):
    for pattern, tests in AREAS:
        if re.match(pattern.replace(".", r"\.").replace("*", "[^/]*") + "$", path):
            return tests
    return []


def find_mutants(scratch, only):
    found = {}
    seen = {}
    number = 0
    for path in sorted(filter(tests_of, scratch.files)):
        if not any(text in path for text in only.split(",")):
            scratch.write(path, scratch.read(path))
            continue
        found[path] = places_of(path, scratch.read(path), tests_of(path))
        for mutant in (m for place in found[path] for m in place[3]):
            number += 1
            mutant.number = number
            key = mutant.key()
            mutant.repeat = seen.get(key, 0)
            seen[key] = mutant.repeat + 1
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


def killed_alone(scratch, found, mutant, first):
    """By which test. One that must be built: then it is the only one in its file."""
    source = scratch.read(mutant.path)
    place = next(p for p in found[mutant.path] if mutant in p[3])
    scratch.write(mutant.path, source[:place[0]] + ten_times(mutant) + source[place[1]:])
    said = scratch.make()
    result = "it does not build" if said else scratch.killer(mutant, 0, first)
    scratch.write(mutant.path, mutate(source, found[mutant.path]))
    if not said:
        scratch.make()
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
    parser.add_argument("--like", default="")
    parser.add_argument("--tests", default="")
    return parser.parse_args()


def main():
    options = arguments()
    root, folder = os.path.abspath(options.root), os.path.abspath(options.scratch)
    begin = time.monotonic()
    scratch = Scratch(root, folder)
    found = find_mutants(scratch, options.only)
    mutants = [m for places in found.values() for p in places for m in p[3]]
    if options.list:
        print("\n".join(m.key() for m in mutants))
        return 0
    mutants = [m for m in mutants if any(text in m.key() for text in options.like.split(","))]
    wanted = {test for mutant in mutants for test in mutant.tests}
    wanted &= set(options.tests.split(",")) if options.tests else wanted
    tests = scratch.look(wanted, options.tests == "")
    build_all(scratch, found)
    failing = scratch.measure(tests, sum(len(p[3]) for places in found.values() for p in places))
    if failing:
        print("# these fail without a mutant and are not used: " + ", ".join(failing))
    step = max(1, len(mutants) // options.sample) if options.sample else 1
    known = equivalents_of(root)
    killers = killers_read(folder)
    survivors, tried, equivalent = [], 0, 0
    for mutant in mutants[::step]:
        if options.seconds and time.monotonic() - begin > options.seconds:
            print("# the time is over")
            break
        if mutant.key() in known:
            equivalent += 1
            continue
        tried += 1
        first = killers.get(mutant.key(), "")
        by = (killed_alone(scratch, found, mutant, first) if mutant.alone
              else scratch.killer(mutant, mutant.number, first))
        name = getattr(by, "name", by)
        print(f"{'killed by ' + name if by else 'SURVIVES'}: {mutant.key()}", flush=True)
        if by is None:
            survivors.append(mutant)
        else:
            killers[mutant.key()] = name
            killers_write(folder, killers)
    print(f"# {len(mutants)} mutants, {tried} tried, {tried - len(survivors)} killed, "
          f"{len(survivors)} survive, {equivalent} equivalent")
    for mutant in survivors:
        print("not ok - survives: " + mutant.key())
    return 1 if survivors else 0


def killers_read(folder):
    """Of the last run: the test that killed a mutant is tried first."""
    try:
        with open(os.path.join(folder, "killers.json"), encoding="utf-8") as f:
            return json.load(f)
    except FileNotFoundError:
        return {}


def killers_write(folder, killers):
    with open(os.path.join(folder, "killers.json"), "w", encoding="utf-8") as f:
        json.dump(killers, f, indent=1)


if __name__ == "__main__":
    sys.exit(main())
