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
    "trigger_zone": "docs/platforms.md",
    "choose_stiffness": "docs/stiffness.md",
    "watch_for_buzz": "docs/buzzing.md",
    "late_ticks": "docs/realtime.md",
    "record_and_play": "docs/recording.md",
    "try_device": "docs/devices.md",
    "edit_while_running": "docs/editing.md",
    "sound_on_touch": "docs/touches.md",
    "walk_and_reach": "docs/pointers.md",
    "own_device": "docs/writing-a-device.md",
    "own_forces": "docs/forces.md",
    "sandpaper_and_ice": "docs/surfaces.md",
    "ribs": "docs/surfaces.md",
    "tap_materials": "docs/surfaces.md",
    "fridge_magnet": "docs/surfaces.md",
    "push_without_ode": "docs/scene.md",
    "list_a_scene": "docs/scene.md",
    "feel_by_number": "docs/scene.md",
    "edit_a_scene": "docs/scene.md",
    "change_while_running": "docs/editing.md",
    "wish_for_accuracy": "docs/accuracy.md",
    "near_the_hand": "docs/touches.md",
    "wrap_a_device": "docs/writing-a-device.md",
    "grip_and_feel": "docs/grippers.md",
    "two_fingers": "docs/fingers.md",
    "lift_door": "docs/platforms.md",
    "two_hands_with_clutch": "docs/pointers.md",
    "trigger_volume": "docs/force-calls.md",
    "follow_a_path": "docs/force-calls.md",
    "drawer_with_detents": "docs/body-forces.md",
    "tool_in_hand": "docs/grab.md",
    "one_way_platform": "docs/contacts.md",
    "identify_a_device": "docs/devices.md",
    "what_acts": "docs/effects.md",
    "compare_integrations": "docs/decisions/contact-spring.md",
    "scene_of_ones_own": "docs/scene.md",
    "hold_loosely": "docs/grab.md",
    "check_a_recording": "docs/recording.md",
    "after_a_fault": "docs/faults.md",
    "memory_and_log": "docs/faults.md",
    "plot_a_trace": "docs/programs.md",
    "servo_loop": "docs/from-chai3d.md",
    "lossy_link": "docs/remote.md",
    "far_hand": "docs/remote.md",
    "two_hands": "docs/remote.md",
    "two_processes": "docs/remote.md",
}
BLOCK = re.compile(r"```c\n(.*?)```", re.S)
# After the blocks that show parts of a program; a page without it shows all of the program.
PARTS = re.compile(r"^From `examples/(\w+)\.c`", re.M)
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
    rows = rows_of(out, r"^box at (-?[0-9.]+) m, hand at (-?[0-9.]+) m, "
                        r"gap (-?[0-9.]+) mm$")
    point(len(rows) == 12, "it prints every tenth frame", f"{len(rows)} lines")
    point(bool(rows) and float(rows[-1][0]) > 0.05, "the box slides")
    point(bool(rows) and -2.0 < float(rows[-1][2]) <= 0.5, "the drawn hand touches the drawn box",
          out)


def check_edit_while_running(program):
    out = run(program)
    said = re.match(r"3 cubes made anew, 0 lost; at most ([0-9.]+) N", out)
    point(said is not None and float(said.group(1)) > 0.2, "the hand feels what is edited", out)


def check_lossy_link(program):
    out = run(program)
    said = re.search(r"1010 sent; came: (\d+) newest, 10 reliable; 1 left", out)
    point(said is not None and 960 < int(said.group(1)) < 990, "one in twenty is lost", out)


def check_far_hand(program):
    out = run(program)
    rows = rows_of(out, r"^box at (-?[0-9.]+) m, hand feels (-?[0-9.]+) N$")
    point(len(rows) == 4 and rows[0] == ("0.0250", "0.00"), "nothing is touched at first", out)
    point(len(rows) == 4 and float(rows[3][0]) > 0.12, "the hand pushes the box", out)
    point(len(rows) == 4 and all(float(f) < -0.5 for _, f in rows[2:]), "the hand feels it", out)
    point("round trip 100 ms" in out, "the round trip is that of the network", out)


def check_two_hands(program):
    out = run(program)
    rows = rows_of(out, r"^box at (-?[0-9.]+) m, left feels (-?[0-9.]+) N, right (-?[0-9.]+) N$")
    point(len(rows) == 8 and rows[1] == ("0.0250", "0.00", "0.00"), "nothing is touched at first",
          out)
    point(len(rows) == 8 and float(rows[7][0]) > 0.04, "the left hand pushes the box", out)
    point(len(rows) == 8 and float(rows[7][1]) < -5.0 and float(rows[7][2]) > 4.0,
          "and the right hand feels it", out)
    point("2 hands, 1 body shared" in out, "the box is of both", out)


def check_two_processes(program):
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run([str(program.resolve())], cwd=folder, capture_output=True, text=True,
                              timeout=60)
    if "hapode-link-dds" in done.stderr:
        point(done.returncode != 0, "without the module it says what to install", done.stderr)
        return
    rows = rows_of(done.stdout, r"^hand at (-?[0-9.]+) m feels (-?[0-9.]+) N$")
    point(done.returncode == 0 and len(rows) == 7, f"{program.name} runs",
          done.stderr + done.stdout)
    point(any(float(f) < -1.0 for _, f in rows), "the hand feels the other process's box",
          done.stdout)
    point("joined, " in done.stdout, "it has joined", done.stdout)


def check_make_touchable(program):
    out = run(program)
    said = re.match(r"the hand felt at most ([0-9.]+) N", out)
    point(said is not None and 0.2 < float(said.group(1)) < 20, "the hand pushes the upper box",
          out)


def check_moving_platform(program):
    out = run(program)
    said = re.match(r"the hand holds ([0-9.]+) N", out)
    point(said is not None and float(said.group(1)) > 1.0, "the lift lifts the hand", out)


def check_trigger_zone(program):
    out = run(program)
    said = re.match(r"the ball was in the zone for (\d+) steps of 60; "
                    r"the hand, in it, holds ([0-9.]+) N", out)
    point(said is not None and 3 < int(said.group(1)) < 50, "the ball goes through the zone", out)
    point(said is not None and float(said.group(2)) == 0.0, "so does the hand, and feels nothing",
          out)


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
    point(len(rows) == 2 and int(rows[0][1]) > 10 and int(rows[0][2]) > 40, "direct, it buzzes",
          out)
    point(len(rows) == 2 and int(rows[1][1]) < 5 and int(rows[1][2]) == 0,
          "as by default, it does not", out)


def check_late_ticks(program):
    out = run(program)
    said = re.search(r"^(\d+) ticks, (\d+) missed;", out, re.M)
    point(said is not None and int(said.group(1)) > 100, "it counts ticks", out)


def check_sound_on_touch(program):
    out = run(program)
    clicks = rows_of(out, r"^\S+ s  click of wood, (\d+) mN s at ([0-9.]+) m/s$")
    point(len(clicks) >= 2 and float(clicks[1][0]) > float(clicks[0][0]), "a harder tap is louder",
          out)
    point("scraping on wood begins" in out and "scraping on wood ends" in out, "a stroke scrapes",
          out)
    said = re.search(r"^at last on wood with ([0-9.]+) N, of which ([0-9.]+) N rub$", out, re.M)
    point(said is not None and 2.5 < float(said.group(1)) < 3.5, "the finger rests on it", out)


def check_own_device(program):
    rows = rows_of(run(program), r"^([0-9.]+) s  (-?[0-9.]+) N$")
    point(len(rows) == 10, "it prints ten forces", str(rows))
    point(any(1.5 < float(row[1]) < 2.5 for row in rows), "the floor pushes the hand", str(rows))
    point(any(float(row[1]) == 0.0 for row in rows), "and not in the air", str(rows))


def check_walk_and_reach(program):
    out = run(program)
    rows = rows_of(out, r"^hand at (-?[0-9.]+) (-?[0-9.]+) m, feels \S+ (-?[0-9.]+) (-?[0-9.]+) N$")
    point(len(rows) == 12, "it prints every tenth frame", out)
    point(len(rows) == 12 and float(rows[-1][1]) > 0.4, "the person walks on", out)
    point(any(float(row[2]) < -0.2 and float(row[3]) > 1.5 for row in rows),
          "the hand rubs on the table", out)
    point(any(float(row[3]) == 0.0 for row in rows[7:10]), "with the clutch held there is no force",
          out)


def check_sandpaper_and_ice(program):
    rows = rows_of(run(program), r"^ *\S+ mm: (\w+) +presses with ([0-9.]+) N, "
                                 r"rubs with (-?[0-9.]+) N$")
    rubs = {name: max(float(f) for n, _, f in rows if n == name)
            for name in ("ice", "sandpaper", "foam")}
    point(rubs["sandpaper"] > 10 * rubs["ice"] > 10 * rubs["foam"], "sandpaper rubs", str(rubs))
    last = float(rows[-1][1]) if rows else 0.0
    point(0.5 < last < 1.0, "foam is soft", f"{last} N")


def check_ribs(program):
    out = run(program)
    rows = rows_of(out, r"^(\d+) ribs a metre: (\d+) felt on (\d+) mm, function in time$")
    point(len(rows) == 2 and all(abs(int(felt) - 1e-3 * int(a_metre) * int(way)) <= 1.5
                                 for a_metre, felt, way in rows), "each rib is felt", out)


def check_tap_materials(program):
    rows = rows_of(run(program), r"^ *(\d+) ms (\w+) +presses with +(-?[0-9.]+) N, "
                                 r"rings with +(-?[0-9.]+) N +\*$")
    turns = {}
    for name in ("rubber", "wood", "metal"):
        force = [float(f) for _, n, _, f in rows if n == name]
        turns[name] = sum(a * b < 0.0 for a, b in zip(force, force[1:]))
    point(turns["metal"] > turns["wood"] > turns["rubber"] > 0, "metal rings longest", str(turns))
    point(max(abs(float(f)) for _, _, _, f in rows) < 5.0, "no more than 5 N")


def check_fridge_magnet(program):
    rows = rows_of(run(program), r"^ *(\d+) ms hand at +(-?[0-9.]+) +(-?[0-9.]+) m, feels +"
                                 r"(-?[0-9.]+) +(-?[0-9.]+) N, note +(-?[0-9.]+) mm up$")
    at = {int(row[0]): [float(x) for x in row[1:]] for row in rows}
    point(len(rows) == 30 and abs(at[1400][3] + 0.196) < 0.01 and at[1400][4] > 30.0,
          "the note hangs on the finger", str(at[1400]))
    point(at[1800][3] == 0.0 and abs(at[1800][4]) < 1.0, "a jerk drops it", str(at[1800]))
    point(at[2600][2] == 0.0 and at[2800][2] > 0.5, "the door pulls", str(at[2800]))


def check_own_forces(program):
    out = run(program)
    rows = rows_of(out, r"^ *([0-9.]+) mm: +(-?[0-9.]+) N along, +(-?[0-9.]+) N to the rail$")
    point(out.startswith("a spring to the rail, detents along it\n"), "it names them", out)
    along = [abs(float(row[1])) for row in rows]
    point(len(rows) == 20 and max(along[1:9]) <= 0.8 and max(along[12:]) > 0.8,
          "the clicks get harder", str(rows))
    point(all(-1.3 < float(row[2]) < -1.1 for row in rows[1:]), "the rail pulls", str(rows))


def check_trigger_volume(program):
    rows = rows_of(run(program), r"^(inside|outside), entered ([0-9]+) times$")
    point(len(rows) == 12 and {row[0] for row in rows} == {"inside", "outside"} and
          rows[-1][1] == "2", "the hand goes through the volume twice", str(rows))


def check_follow_a_path(program):
    rows = rows_of(run(program), r"^ *\d+ ms: +(\d+) % of the way, +([0-9.]+) mm off$")
    point(len(rows) == 10 and int(rows[-1][0]) >= 99, "the pupil comes to the end", str(rows))
    point(all(float(row[1]) < 3.0 for row in rows), "and stays near the way", str(rows))


def check_drawer_with_detents(program):
    rows = rows_of(run(program),
                   r"^hand +(-?[0-9.]+) mm out, drawer +(-?[0-9.]+) mm: +(-?[0-9.]+) N$")
    off = [float(row[0]) - float(row[1]) for row in rows]
    point(len(rows) == 12 and float(rows[-1][1]) > 90.0 and max(map(abs, off)) < 8.0,
          "the drawer comes along", str(rows))
    point(any(float(row[2]) < -0.5 for row in rows) and any(float(row[2]) > 0.5 for row in rows),
          "the detents hold and let go", str(rows))


def check_push_without_ode(program):
    rows = rows_of(run(program), r"^mallet at (-?[0-9.]+) m, hand feels (-?[0-9.]+) N$")
    point(len(rows) == 5 and float(rows[0][0]) == 0.0 and float(rows[-1][0]) > 0.1,
          "the mallet is pushed on", str(rows))
    point(len(rows) == 5 and abs(float(rows[-2][1]) + 1.95) < 0.1, "the hand feels its friction",
          str(rows))


def check_feel_by_number(program):
    rows = dict(rows_of(run(program), r"^(\w+): (-?[0-9.]+) N$"))
    point(abs(float(rows["foam"]) - 0.8) < 0.01 and abs(float(rows["steel"]) - 8.0) < 0.05,
          "4 mm deep, each tile feels as its number says", str(rows))
    point(abs(float(rows["jar"]) + 0.981) < 0.02, "the jar that was listed hangs on the hand",
          str(rows))


def check_list_a_scene(program):
    out = run(program)
    point("geom 0: box of body 0, 0.30 x 0.02 x 0.30 m" in out, "it lists the door", out)
    turned = re.search(r"^joint 0: kind 1 at ([0-9.]+) rad$", out, re.M)
    point(turned is not None and 0.05 < float(turned.group(1)) < 0.5, "which is half open", out)
    said = re.search(r"^the hand presses on geom 0 of a body of 1 kg, and feels (-[0-9.]+) N$", out,
                     re.M)
    point(said is not None, "the hand presses on it", out)


def check_edit_a_scene(program):
    out = run(program)
    rows = rows_of(out, r"^\d s  table at ([0-9.]+) m, wheel at ([0-9.]+) m, "
                        r"ball ([0-9.]+) m along$")
    table, wheel, ball = ([float(row[i]) for row in rows] for i in range(3))
    point(len(rows) == 6 and all(abs(table[i] - 0.02 * i) < 0.001 for i in range(6)),
          "the table rises from the first second on", out)
    point(len(rows) == 6 and wheel[:4] == [0.5] * 4 and 0.1 < wheel[4] < 0.3,
          "the wheel falls when its axle is taken away", out)
    point(len(rows) == 6 and ball[0] < ball[1] < ball[2] > ball[3] < ball[4] < ball[5],
          "the ball is blown along, put back and blown again", out)


def check_change_while_running(program):
    out = run(program)
    rows = rows_of(out, r"^\d s  .* cube at ([0-9.]+) m, hand feels (-?[0-9.]+) N, (\d+) steps$")
    steps = [int(row[2]) for row in rows]
    point(len(rows) == 6 and float(rows[1][1]) < -1.0, "the hand pushes three cubes", out)
    point(len(rows) == 6 and 85 <= steps[4] - steps[3] <= 95 and steps[5] - steps[4] > 900,
          "rate and model change", out)


def check_wish_for_accuracy(program):
    out = run(program)
    rows = rows_of(out, r"^[0-9.]+ s  tick ([0-9.]+): (.+); physics ([0-9.]+): (.+)$")
    point(len(rows) == 4 and rows[0][1] == rows[0][3] == "asked for", "the dial is as asked", out)
    point(len(rows) == 4 and rows[3][1] == "asked for", "and again in the end", out)


def check_near_the_hand(program):
    out = run(program)
    rows = rows_of(out, r"^[0-9.]+ s  cubes at (-?[0-9.]+) and ([0-9.]+) m, roles (\d) and (\d), "
                        r"(\d) contacts$")
    point(len(rows) == 6 and abs(float(rows[3][1]) - float(rows[3][0]) - 0.05) < 0.001,
          "the cubes go together", out)
    point(len(rows) == 6 and rows[3][2:4] == ("1", "1") and rows[5][2:4] == ("0", "0"),
          "the loop has them while there is a hand", out)
    point(len(rows) == 6 and rows[4][1] == "0.300" and int(rows[4][4]) < int(rows[3][4]),
          "the second one is put elsewhere", out)
    point("ODE told moves of the first cube" in out, "ODE tells what moves", out)


def check_wrap_a_device(program):
    said = re.match(r"at most ([0-9.]+) N, of 20 that the device can\n", run(program))
    point(said is not None and 0.8 < float(said.group(1)) < 1.5, "the hand trembles less")


def check_grip_and_feel(program):
    out = run(program)
    rows = rows_of(out, r"^([0-9.]+) s +([0-9.]+) mm, (-?[0-9.]+) N$")
    point(len(rows) == 10 and float(rows[4][1]) > 30 and abs(float(rows[4][2]) - 2.4) < 0.1,
          "where the springs of egg and fingers agree", out)
    point(out.count("holds the egg") == 1 and out.count("lets it go") == 1,
          "closing and opening are told once", out)
    point("was promised 0." in out or "was promised 1." in out, "what was set is given back", out)


def check_two_fingers(program):
    rows = rows_of(run(program), r"^(-?[0-9.]+) and (-?[0-9.]+) N, cube at ([0-9.]+) m$")
    point(len(rows) == 5 and float(rows[0][1]) == 0.0 and abs(float(rows[1][1]) - 4.5) < 0.1,
          "the fingers close on the cube", str(rows))
    point(len(rows) == 5 and all(abs(float(row[0]) + float(row[1])) < 0.02 for row in rows),
          "they push against each other", str(rows))
    point(len(rows) == 5 and 0.12 < float(rows[-1][2]) < 0.131, "and lift it", str(rows))


def check_one_way_platform(program):
    out = run(program)
    rows = rows_of(out, r"^([0-9.]+) s  box (-?[0-9.]+) m above the platform, hand feels "
                        r"(-?[0-9.]+) N$")
    point(len(rows) == 9, "it prints a line a half second", out)
    point(len(rows) == 9 and float(rows[0][1]) < -0.05 and float(rows[3][1]) > 0.0,
          "the box comes from below", out)
    point(len(rows) == 9 and 2.5 < float(rows[3][2]) < 3.3, "the hand carries the box", out)
    point(len(rows) == 9 and abs(float(rows[-1][1])) < 0.001 and float(rows[-1][2]) == 0.0,
          "the box lies on the platform", out)


def check_lift_door(program):
    out = run(program)
    rows = rows_of(out, r"^([0-9.]+) s  edge at ([0-9.]+) m, hand feels (-?[0-9.]+) N$")
    point(out.count("stopped by a hand") == 1, "a hand stops the door once", out)
    point(len(rows) == 6 and float(rows[1][2]) > 3 and float(rows[-1][2]) == 0.0,
          "the hand feels the door, and then no more", out)
    point(len(rows) == 6 and 0.19 < float(rows[-1][1]) < 0.21, "the door is open again", out)


def check_two_hands_with_clutch(program):
    out = run(program)
    rows = rows_of(out, r"^devices at (\d+) mm, hands at (\d+) and (\d+) mm, box at (\d+) mm$")
    point(len(rows) == 8 and all(row[1] == row[2] for row in rows), "both hands go together", out)
    stands = all(abs(int(held[3]) - int(free[3])) <= 1 for free, held in zip(rows[::2], rows[1::2]))
    point(len(rows) == 8 and stands, "with the clutch held the box stands", out)
    point(len(rows) == 8 and int(rows[-1][3]) > 165, "the box goes farther than the devices", out)
def check_tool_in_hand(program):
    rows = rows_of(run(program),
                   r"^hand at ([0-9.]+) m (holds the hammer|is empty): +(-?[0-9.]+) N, "
                   r" *(-?[0-9.]+) N m$")
    lifted = [row for row in rows if row[0] == "0.150"]
    point(len(rows) == 18, "it prints every fifth frame", str(rows))
    point(len(lifted) > 2 and all(-5.9 < float(row[2]) < -4.0 for row in lifted[1:]),
          "the hand feels the hammer's weight of 4.9 N", str(lifted))
    point(len(lifted) > 2 and all(float(row[3]) > 0.4 for row in lifted[1:]),
          "and how its head pulls the stick down", str(lifted))
    point(rows[-1][1] == "is empty" and float(rows[-1][2]) == 0.0, "it lets go", str(rows[-1:]))


def check_record_and_play(program):
    out = run(program, "push.rec")
    point(out == "the replay is the recording\n", "the replay is the recording", out)


def check_try_device(program):
    out = run(program, "virtual:sine=0.05/0/0,hz=1")
    point("3 degrees of freedom" in out and len(rows_of(out, r"^at (-?[0-9.]+) ")) == 10,
          "it prints where the device is", out)


def check_identify_a_device(program):
    out = run(program)
    rows = rows_of(out, r"^(before|as measured): ([0-9.]+) kg, ([0-9.]+) N s/m, ([0-9.]+) N$")
    heard = re.match(r"last told at (\d+) %\n", out)
    point(heard is not None and 90 <= int(heard.group(1)) <= 100, "it says how far it is", out)
    point([row[0] for row in rows] == ["before", "as measured"] and float(rows[0][1]) == 0.0,
          "the device knows nothing of itself", out)
    point(len(rows) == 2 and all(abs(float(found) - true) <= 0.02 * true for found, true in
                                 zip(rows[1][1:], (0.3, 1.0, 0.2))),
          "and has the figures of the true one then", out)


def check_what_acts(program):
    out = run(program)
    rows = rows_of(out, r"^  (\w+) +(auto|off|on) +(off|on|partly on): (.+) \(.+\)$")
    states = [{row[0]: row[1:] for row in part} for part in (rows[:len(rows) // 2],
                                                             rows[len(rows) // 2:])]
    point(re.match(r"hapode \d+\.\d+\.\d+\n", out) is not None, "it says its version", out)
    point(len(rows) == 28 and len(states[0]) == 14, "it lists all effects twice", out)
    point(states[0]["contacts"] == ("auto", "on", "the scene calls for it") and
          states[0]["gyro"][:2] == ("auto", "off"), "as the scene needs it", out)
    point(states[1]["gyro"] == ("on", "on", "asked for") and
          {n: s for n, s in states[1].items() if n != "gyro"} ==
          {n: s for n, s in states[0].items() if n != "gyro"}, "a wish changes one", out)
    point(len(rows_of(out, r"^cross=on in model contact: .*use model accelerance$")) == 1,
          "what cannot be is told with a remedy", out)


def check_after_a_fault(program):
    out = run(program)
    rows = rows_of(out, r"^(HAP_\w+), (-?[0-9.]+) N$")
    force = [float(row[1]) for row in rows]
    point([row[0] for row in rows] == ["HAP_OK", "HAP_FAULTED", "HAP_OK", "HAP_FAULTED"],
          "the cable comes out and in, then Ctrl-C", out)
    point(len(force) == 4 and force[0] < -5.0 and abs(force[2] - force[0]) < 0.1 and
          force[1] == force[3] == 0.0, "a fault takes the force away, a reset gives it back", out)
    point(out.count("  fault\n") == 2 and "could not be read" in out and
          "hap_emergency_zero was called" in out, "it says what happened", out)
    kept = rows_of(out, r"^  256 ticks kept, the last but one with (-?[0-9.]+) N, the last with "
                        r"(-?[0-9.]+) N$")
    point(len(kept) == 2 and all(float(was) < -5.0 and float(last) == 0.0
                                 for was, last in kept), "the black box has the last ticks", out)


def check_memory_and_log(program):
    out = run(program)
    said = re.search(r"^(\d+) blocks asked for before, (\d+) in 500 ticks$", out, re.M)
    point(said is not None and int(said.group(1)) > 20 and int(said.group(2)) == 0,
          "a running loop asks for no memory", out)
    said = re.search(r"^(\d+) lines logged, (\d+) blocks left$", out, re.M)
    point(said is not None and int(said.group(1)) > 10 and int(said.group(2)) == 0,
          "all memory is given back", out)
    point("error: hap_session_destroy was called in a callback" in out, "a mistake is logged", out)


def check_plot_a_trace(program):
    out = run(program)
    rows = [[float(x) for x in line.split(",")] for line in out.splitlines()[1:]]
    point(out.startswith("t_s,hand_mm,cube_mm,force_n\n") and len(rows) == 600,
          "a row for each tick", f"{len(rows)} rows")
    point(all(abs(b[0] - a[0] - 0.001) < 1e-6 for a, b in zip(rows, rows[1:])), "none is missing")
    pushed = 1e-3 * sum(-row[3] for row in rows)  # N s
    speed = rows[-1][2] - rows[-2][2]  # mm a ms are m/s
    point(pushed > 0.05 and abs(pushed - 0.2 * speed) < 0.01 * pushed,
          "the cube has the momentum that the hand gave", f"{pushed} N s, {speed} m/s")


def check_compare_integrations(program):
    out = run(program)
    rows = rows_of(out, r"^ *(\d+) N/m, (\w+) *: at most ([0-9.]+) N, the ball leaves at "
                        r"([0-9.]+) m/s$")
    speed = {(int(row[0]), row[1]): float(row[3]) for row in rows}
    force = {(int(row[0]), row[1]): float(row[2]) for row in rows}
    point(len(speed) == 8, "four rules and two springs", out)
    # Half of an oscillation: v sqrt(k m), and twice the hand's speed.
    point(all(abs(force[2000, rule] - 0.1 * (2000 * 0.01) ** 0.5) < 0.02 and
              abs(speed[2000, rule] - 0.2) < 0.002 for rule in ("explicit", "midpoint", "auto")),
          "on a soft spring energy is kept", out)
    point(speed[45000, "explicit"] > 0.4 and speed[45000, "midpoint"] < 0.2,
          "on a stiff one the explicit rule makes some", out)
    point(speed[45000, "auto"] == speed[45000, "implicit"] < speed[2000, "implicit"] < 0.2,
          "implicit damps, and is what the library takes there", out)


def check_scene_of_ones_own(program):
    out = run(program)
    rows = rows_of(out, r"^(as made|let pass): ([0-9.]+) ([0-9.]+) ([0-9.]+) ([0-9.]+) m$")
    height = [[float(x) for x in row[1:]] for row in rows]
    point("slide: one cube of 1 kg" in out and len(out.splitlines()) > 20, "it lists scenes", out)
    # 0.2 s of fall, and the last step may be 1/60 s old
    least, most = (0.2 - 0.81 * t * t for t in (0.217, 0.166))
    point(len(rows) == 2 and all(least < h[1] < most for h in height), "they fall as on the moon",
          out)
    point(len(rows) == 2 and abs(height[0][3] - 0.15) < 0.001 and abs(height[1][3] - 0.05) < 0.001,
          "on each other, and through each other", out)


def check_hold_loosely(program):
    out = run(program)
    rows = rows_of(out, r"^up to (\d+) N: the box is at (\d+) mm, the hand feels (-[0-9.]+) N$")
    said = [[float(x) for x in row] for row in rows]
    point(len(said) == 2 and abs(said[0][2] + 0.5 * 9.81) < 0.05 and said[0][1] > 95.0,
          "a strong grip lifts the weight", out)
    point(len(said) == 2 and abs(said[1][2] + 3.0) < 0.05 and said[1][1] == 50.0,
          "a weak one gives way at its force", out)


def check_servo_loop(program):
    rows = rows_of(run(program), r"^(call|geom): at ([0-9.]+) mm ([0-9.]+) N$")
    off = [abs(float(force) - 0.25 * max(40.0 - float(at), 0.0)) for _, at, force in rows]
    point(len(rows) == 10 and max(off) < 0.003, "an old callback and a geom feel as k times depth",
          str(rows))


def check_check_a_recording(program):
    lines = run(program).splitlines()
    point(lines[:2] == ["recorded whole", "1 edit of the application in it"],
          "the file has that something was edited", str(lines))
    point(re.match(r"differs from tick \d+ .*, first in physics step", lines[-1]) is not None,
          "the replay differs from there", str(lines))


def shown(page, name):
    """The blocks of a page that show an example: those before its mark, back to the mark of another
    one; None where the page has no marks, and its first block is all of the program."""
    begin = 0
    for mark in PARTS.finditer(page):
        if mark.group(1) == name:
            return BLOCK.findall(page[begin:mark.start()])
        begin = mark.end()
    return None if begin == 0 else []


def shows(page, name):
    blocks = shown(page, name)
    source = example_of(name)
    if blocks is None:
        first = BLOCK.search(page)
        return first is not None and first.group(1).strip() == source
    return bool(blocks) and all(block in source + "\n" for block in blocks)


def part(lines, old):
    """The lines from the first to the last one of an old part; as many as it had where its last
    line has changed."""
    start = lines.index(old[0])
    try:
        end = lines.index(old[-1], start + 1) if len(old) > 1 else start
    except ValueError:
        end = start + len(old) - 1
    return "\n".join(lines[start:end + 1]) + "\n"


def update():
    """Writes the examples into the pages."""
    for name, page in PAGES.items():
        text = read(page)
        blocks = shown(text, name)
        for block in BLOCK.findall(text)[:1] if blocks is None else blocks:
            new = example_of(name) + "\n"
            if blocks is not None:
                new = part(new.split("\n"), block.rstrip("\n").split("\n"))
            text = text.replace(f"```c\n{block}```", f"```c\n{new}```", 1)
        (root / page).write_text(text, encoding="utf-8")


def main(programs):
    sources = {path.stem for path in (root / "examples").glob("*.c")}
    point(sources == {program.stem for program in programs}, "every example is built",
          str(sources ^ {program.stem for program in programs}))
    for name, page in PAGES.items():
        point(shows(read(page), name), f"{page} shows {name}",
              "tests/test_examples.py ROOT --update writes it")
    for path in sorted((root / "examples").glob("*.c")):
        lines = len(path.read_text(encoding="utf-8").splitlines())
        point(lines <= 120, f"{path.name} has at most 120 lines", f"{lines} lines")
    for path in sorted((root / "examples").glob("*/*.[ch]")):
        lines = len(path.read_text(encoding="utf-8").splitlines())
        point(lines <= 120, f"{path.parent.name}/{path.name} has at most 120 lines",
              f"{lines} lines")
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
