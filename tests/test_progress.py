# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""Long programs of hapode-bench say on a terminal how far they are, on one line that is gone in the
end, and nowhere else. Argument: hapode-bench."""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import terminal

bench = str(pathlib.Path(sys.argv[1]).resolve())
count = failed = 0

# A program with its table on stdout, what it counts, and how many of them.
RUNS = {
    "stability": (["--quick", "--only", "stiffness=1000,mass=1,delay_ticks=0"], "points"),
    "faults": (["--scene", "coin_1mm"], "scenes"),
}


def point(problem, name):
    global count, failed
    count += 1
    failed += bool(problem)
    if problem:
        print("# " + str(problem).strip().replace("\n", "\n# "))
    print(f"{'not ok' if problem else 'ok'} {count} - {name}", flush=True)


def check(name, words, unit):
    with tempfile.TemporaryDirectory() as folder:
        command = [bench, name, *words, "--out", folder]
        piped = subprocess.run(command, capture_output=True, text=True, timeout=200)
        said, code = terminal.run(command, dict(os.environ))
    point((piped.returncode or piped.stderr) and f"exit {piped.returncode}: {piped.stderr}",
          f"{name}: nothing on a pipe")
    steps = [(int(a), int(b)) for a, b in
             re.findall(rf"\r{name}: (\d+) of (\d+) {unit}", said)]
    wrong = code != piped.returncode or not steps or steps[0][0] != 0
    wrong = wrong or steps != sorted(steps) or any(all_ != steps[0][1] for _, all_ in steps)
    wrong = wrong or steps[-1][0] != steps[0][1]
    point(wrong and f"exit {code}: {said!r}", f"{name}: a terminal is told from none to all")
    timed = re.findall(r", about [\d.]+ (?:s|min|h) left\033", said)
    point(not timed and repr(said), f"{name}: and how long it takes yet")
    kept = terminal.left(said)
    point(kept != piped.stdout and f"{kept!r}\nis not\n{piped.stdout!r}",
          f"{name}: in the end what a pipe gets stands there")


for each, (options, counted) in RUNS.items():
    check(each, options, counted)
print(f"1..{count}")
sys.exit(failed != 0)
