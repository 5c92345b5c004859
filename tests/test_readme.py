# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""The programs of README and docs/editing.md are the examples, and the examples run. Arguments: source
root, binaries touch_a_cube, frame_loop, edit_while_running."""
import pathlib
import re
import subprocess
import sys

root = pathlib.Path(sys.argv[1])
readme = (root / "README.md").read_text(encoding="utf-8")
editing = (root / "docs/editing.md").read_text(encoding="utf-8")
points = []


def example_of(name):
    return (root / "examples" / name).read_text(encoding="utf-8").split("\n", 2)[2].strip()


def shows(page, text):
    block = re.search(r"```c\n(.*?)```", page, re.S)
    return block is not None and block.group(1).strip() == text


example = example_of("touch_a_cube.c")


def point(good, name, note=""):
    points.append(good)
    if note and not good:
        print("# " + note.replace("\n", "\n# "))
    print(f"{'ok' if good else 'not ok'} {len(points)} - {name}")


point(shows(readme, example), "the README shows the example")
point(len(example.splitlines()) <= 45, "the example is short")
run = subprocess.run([sys.argv[2]], capture_output=True, text=True, timeout=30)
point(run.returncode == 0, "the example runs", run.stderr)
rows = re.findall(r"^cube at (-?[0-9.]+) m, hand feels (-?[0-9.]+) N$", run.stdout, re.M)
point(len(rows) == 90, "it prints a line a frame", f"{len(rows)} lines")
point(any(float(f) < -0.2 for _, f in rows), "the hand feels the cube")
point(bool(rows) and float(rows[-1][0]) > 0.01, "the cube moves")
run = subprocess.run([sys.argv[3]], capture_output=True, text=True, timeout=30)
point(run.returncode == 0, "the frame loop runs", run.stderr)
rows = re.findall(r"^frame +\d+: box at (-?[0-9.]+) m, hand at (-?[0-9.]+) m, gap (-?[0-9.]+) mm$",
                  run.stdout, re.M)
point(len(rows) == 12, "it prints every tenth frame", f"{len(rows)} lines")
point(bool(rows) and float(rows[-1][0]) > 0.05, "the box slides")
point(bool(rows) and -2.0 < float(rows[-1][2]) <= 0.5, "the drawn hand touches the drawn box", run.stdout)
point("examples/frame_loop.c" in readme, "the README speaks of it")
point(shows(editing, example_of("edit_while_running.c")), "docs/editing.md shows the example")
run = subprocess.run([sys.argv[4]], capture_output=True, text=True, timeout=60)
point(run.returncode == 0, "the example of docs/editing.md runs", run.stderr)
said = re.match(r"3 cubes made anew, 0 lost; at most ([0-9.]+) N", run.stdout)
point(said is not None and float(said.group(1)) > 0.2, "the hand feels what is edited", run.stdout)
for target in re.findall(r"\]\((?!http)([^)]+)\)", readme):
    point((root / target).exists(), f"{target} exists")
print(f"1..{len(points)}")
sys.exit(0 if all(points) else 1)
