# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""The programs of README and docs are the examples, and the examples do what the pages say.
Arguments: source root, the programs. With --update and no programs: writes the examples into the
pages."""
import pathlib
import re
import subprocess
import sys
import tempfile

root = pathlib.Path(sys.argv[1])
PAGES = {  # example: the page that shows it, first of its C blocks
    "touch_a_cube": "README.md",
    "make_touchable": "docs/touchable.md",
    "moving_platform": "docs/platforms.md",
    "choose_stiffness": "docs/stiffness.md",
    "watch_for_buzz": "docs/buzzing.md",
    "late_ticks": "docs/realtime.md",
    "record_and_play": "docs/recording.md",
    "try_device": "docs/devices.md",
    "edit_while_running": "docs/editing.md",
}
BLOCK = re.compile(r"```c\n(.*?)```", re.S)
points = []


def point(good, name, note=""):
    points.append(good)
    if note and not good:
        print("# " + note.replace("\n", "\n# "))
    print(f"{'ok' if good else 'not ok'} {len(points)} - {name}", flush=True)


def read(name):
    return (root / name).read_text(encoding="utf-8")


def example_of(name):
    return read(f"examples/{name}.c").split("\n", 2)[2].strip()


def run(program, *arguments):
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run([str(program.resolve()), *arguments], cwd=folder, capture_output=True,
                              text=True, timeout=60)
    point(done.returncode == 0, f"{program.name} runs", done.stderr + done.stdout)
    return done.stdout


def rows_of(text, pattern):
    return re.findall(pattern, text, re.M)


def check_touch_a_cube(program):
    rows = rows_of(run(program), r"^cube at (-?[0-9.]+) m, hand feels (-?[0-9.]+) N$")
    point(len(rows) == 90, "it prints a line a frame", f"{len(rows)} lines")
    point(any(float(f) < -0.2 for _, f in rows), "the hand feels the cube")
    point(bool(rows) and float(rows[-1][0]) > 0.01, "the cube moves")


def check_frame_loop(program):
    out = run(program)
    rows = rows_of(out, r"^frame +\d+: box at (-?[0-9.]+) m, hand at (-?[0-9.]+) m, "
                        r"gap (-?[0-9.]+) mm$")
    point(len(rows) == 12, "it prints every tenth frame", f"{len(rows)} lines")
    point(bool(rows) and float(rows[-1][0]) > 0.05, "the box slides")
    point(bool(rows) and -2.0 < float(rows[-1][2]) <= 0.5, "the drawn hand touches the drawn box",
          out)


def check_edit_while_running(program):
    out = run(program)
    said = re.match(r"3 cubes made anew, 0 lost; at most ([0-9.]+) N", out)
    point(said is not None and float(said.group(1)) > 0.2, "the hand feels what is edited", out)


def check_make_touchable(program):
    out = run(program)
    said = re.match(r"the hand felt at most ([0-9.]+) N", out)
    point(said is not None and 0.2 < float(said.group(1)) < 20, "the hand pushes the upper box",
          out)


def check_moving_platform(program):
    out = run(program)
    said = re.match(r"in the zone for (\d+) steps of 60; the hand holds ([0-9.]+) N", out)
    point(said is not None and 10 < int(said.group(1)) < 60, "the box comes into the zone", out)
    point(said is not None and float(said.group(2)) > 1.0, "the lift lifts the hand", out)


def check_choose_stiffness(program):
    out = run(program)
    rows = rows_of(out, r"^ *(\d+) N/m: coupling (\w+) *, .* felt as (\d+) N/m$")
    point([row[1] for row in rows] == ["direct", "direct", "proxy", "proxy"],
          "the device holds two of four", out)
    point(len(rows) == 4 and all(int(row[2]) == int(row[0]) for row in rows[:2]) and
          int(rows[3][2]) < 1700, "a proxy is softer", out)


def check_watch_for_buzz(program):
    out = run(program)
    rows = rows_of(out, r"^(\w+) *: +(\d+) turns, energy held back in +(\d+) ticks")
    point(len(rows) == 2 and int(rows[0][1]) > 20 and int(rows[0][2]) > 100, "direct, it buzzes",
          out)
    point(len(rows) == 2 and int(rows[1][1]) < 5 and int(rows[1][2]) == 0,
          "as by default, it does not", out)


def check_late_ticks(program):
    out = run(program)
    said = re.search(r"^(\d+) ticks, (\d+) missed;", out, re.M)
    point(said is not None and int(said.group(1)) > 100, "it counts ticks", out)


def check_record_and_play(program):
    out = run(program, "push.rec")
    point(out == "the replay is the recording\n", "the replay is the recording", out)


def check_try_device(program):
    out = run(program, "virtual:sine=0.05/0/0,hz=1")
    point("3 degrees of freedom" in out and len(rows_of(out, r"^at (-?[0-9.]+) ")) == 10,
          "it prints where the device is", out)


def update():
    for name, page in PAGES.items():
        text = read(page)
        text = BLOCK.sub(lambda _: f"```c\n{example_of(name)}\n```", text, count=1)
        (root / page).write_text(text, encoding="utf-8")


def main(programs):
    sources = {path.stem for path in (root / "examples").glob("*.c")}
    point(sources == {program.stem for program in programs}, "every example is built",
          str(sources ^ {program.stem for program in programs}))
    for name, page in PAGES.items():
        block = BLOCK.search(read(page))
        point(block is not None and block.group(1).strip() == example_of(name),
              f"{page} shows {name}", "tests/test_examples.py ROOT --update writes it")
    point(len(example_of("touch_a_cube").splitlines()) <= 45, "the README's example is short")
    point("examples/frame_loop.c" in read("README.md"), "the README speaks of the frame loop")
    for program in programs:
        globals()[f"check_{program.stem}"](program)
    print(f"1..{len(points)}")
    sys.exit(0 if all(points) else 1)


if sys.argv[2:] == ["--update"]:
    update()
else:
    main([pathlib.Path(word) for word in sys.argv[2:]])
