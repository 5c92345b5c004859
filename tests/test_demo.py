# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""tools/run-demo: on a pipe the summary of hapode-run alone; on a terminal also three sentences and
a picture. Packages and the build are left out; the run is shortened. Arguments: source root,
hapode-run."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import terminal

root = pathlib.Path(sys.argv[1])
program = pathlib.Path(sys.argv[2]).resolve()
count = failed = 0

SETUP = """root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
build=$root/build
packages_view=()
say() { printf '%s\\n' "$*" >&2; }
need_packages() { :; }
build_all() { echo "$@" > "$build/targets"; }
"""
# A second in place of ten.
SHORT = """#!/usr/bin/env bash
words=()
while [ $# -gt 0 ]; do
  case $1 in
    --seconds) words+=(--seconds 1 --no-realtime); shift 2 ;;
    *) words+=("$1"); shift ;;
  esac
done
exec "{program}" "${{words[@]}}"
"""


def point(problem, name):
    global count, failed
    count += 1
    failed += bool(problem)
    if problem:
        print("# " + str(problem).strip().replace("\n", "\n# "))
    print(f"{'not ok' if problem else 'ok'} {count} - {name}", flush=True)


def sentences(summary):
    return subprocess.run(["awk", "-f", root / "tools" / "demo.awk"], input=summary,
                          capture_output=True, text=True, timeout=60)


def without_display():
    return {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}


def keys(text):
    return re.findall(r"^([a-z_0-9]+): ", terminal.left(text), re.M)


def check_sentences():
    made = {"scene": "row10", "ticks": "5000", "haptic_hz": "1000", "physics_hz": "60",
            "contact_ticks": "1250", "peak_force_n": "6.0247", "haptic_duty": "0.03",
            "physics_duty": "0.111", "missed_ticks": "2"}
    text = "".join(f"{k}: {v}\n" for k, v in made.items())
    bare = sentences(text).stdout
    looked = sentences(text + "lookbacks: 8\nforce_error: 0.0123\n").stdout
    wrong = [word for word in ("row10 for 5 s", "60 steps", "the hand 1000", "contact for 1.2 s",
                               "6.02 N", "3 % of a core", "11 % for the world", "2 of 5000 ticks",
                               "is not known") if word not in bare]
    wrong += [word for word in ("off by 1.2 %", "1000 steps a second tells") if word not in looked]
    wrong += [] if looked.count("\n") == 3 else ["three lines"]
    point(", ".join(wrong) and f"{wrong} in\n{bare}{looked}", "three sentences say the numbers")
    empty = sentences("no summary\n")
    point("" if empty.returncode == 1 and "no summary" in empty.stderr and not empty.stdout
          else empty, "without a summary there are none, and that is said")


def check_demo(folder):
    tools = folder / "tools"
    tools.mkdir()
    (folder / "build").mkdir()
    for name in ("run-demo", "demo.awk"):
        shutil.copy(root / "tools" / name, tools)
    (tools / "setup.sh").write_text(SETUP)
    short = folder / "build" / "hapode-run"
    short.write_text(SHORT.format(program=program))
    short.chmod(0o755)
    demo = str(tools / "run-demo")

    piped = subprocess.run([demo], capture_output=True, text=True, timeout=100,
                           env=without_display())
    lines = [line for line in piped.stdout.splitlines() if not re.match(r"[a-z_0-9]+: ", line)]
    wrong = piped.returncode != 0 or lines or "lookbacks" in keys(piped.stdout)
    wrong = wrong or "peak_force_n" not in keys(piped.stdout)
    wrong = wrong or (folder / "build" / "demo.record").exists()
    point(wrong and f"exit {piped.returncode}: {piped.stdout}{piped.stderr}",
          "on a pipe the summary comes alone")

    targets = (folder / "build" / "targets").read_text().split()
    point("" if targets == ["hapode-run", "hapode-view"] else targets,
          "what runs and what draws are built")

    said, code = terminal.run([demo], without_display())
    figures = folder / "build" / "demo.txt"
    wrong = code != 0 or "peak_force_n" in keys(said) or f"all figures: {figures}" not in said
    wrong = wrong or not set(keys(piped.stdout)) - {"picture"} <= set(keys(figures.read_text()))
    wrong = wrong or not re.search(r"^A simulated hand pushed scene row10 for \S+ s:", said, re.M)
    wrong = wrong or "The force was off by" not in said
    wrong = wrong or f"moving picture: {folder / 'build' / 'demo.html'}" not in said
    wrong = wrong or not (folder / "build" / "demo.html").exists()
    still = folder / "build" / "demo.png"
    if still.exists():
        wrong = wrong or still.read_bytes()[:4] != b"\x89PNG" or f"picture: {still}" not in said
    else:  # the program was built without pictures, or there is no EGL: it says so
        wrong = wrong or "hapode-run: " not in said
    point(wrong and f"exit {code}: {said}", "on a terminal three sentences and a picture follow")

    said, code = terminal.run([demo, "--seconds", "1", "--model", "single"], without_display())
    wrong = code != 0 or "A simulated hand" in said or "model: single" not in said
    point(wrong and f"exit {code}: {said}", "with arguments it is hapode-run")

    short.write_text("#!/bin/sh\necho 'scene: row10'\nexit 3\n")
    said, code = terminal.run([demo], without_display())
    point((code != 3 or "A simulated hand" in said) and f"exit {code}: {said}",
          "a run that fails is not talked about")


check_sentences()
with tempfile.TemporaryDirectory() as scratch:
    check_demo(pathlib.Path(scratch))
print(f"1..{count}")
sys.exit(failed != 0)
