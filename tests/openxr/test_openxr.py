# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""The VR example behind the real loader: what it asks of a pretend runtime, whose stories have
closed forms for pose and force. Arguments: vr_hand, the pretend runtime."""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

program, runtime = (os.path.abspath(word) for word in sys.argv[1:3])
STIFFNESS, RADIUS, DEPTH, FULL = 1000.0, 0.01, 0.004, 8.0  # N/m, m, m, N of the example
points = []


def point(good, name, note=""):
    points.append(bool(good))
    if note and not good:
        print("# " + note.replace("\n", "\n# "))
    print(f"{'ok' if good else 'not ok'} {len(points)} - {name}", flush=True)


def force_point(good, name, note, said):
    """Of a force, which nothing can be said of where the machine stayed busy."""
    if not good and "ticks came late" in said:
        points.append(True)
        print(f"ok {len(points)} - {name} # SKIP ticks came late, and the force was lowered")
    else:
        point(good, name, note)


def play(story, manifest=True):
    """Exit status, what it printed, and rows of the runtime's log: time, words."""
    with tempfile.TemporaryDirectory() as folder:
        log, file = pathlib.Path(folder, "log"), pathlib.Path(folder, "runtime.json")
        file.write_text(json.dumps({"file_format_version": "1.0.0",
                                    "runtime": {"library_path": runtime}}), encoding="utf-8")
        if not manifest:
            file.unlink()
        env = dict(os.environ, XR_RUNTIME_JSON=str(file), PRETEND_XR_LOG=str(log),
                   PRETEND_XR_STORY=story, XR_LOADER_DEBUG="none")
        done = subprocess.run([program], env=env, capture_output=True, text=True, timeout=60)
        rows = [line.split(" ", 1) for line in log.read_text().splitlines()] if log.exists() else []
    return done.returncode, done.stdout + done.stderr, [(float(t), what) for t, what in rows]


def play_in_time(story):
    """The same; again where a busy machine let ticks come late, which lowers the force."""
    for _ in range(3):
        played = play(story)
        if "ticks came late" not in played[1]:
            break
    return played


def shakes(rows):
    """Time and strength of what the controller was told; 0 where it was stopped."""
    return [(t, float(what.split()[1]) if what.startswith("shake") else 0.0)
            for t, what in rows if what.startswith(("shake", "still"))]


def strengths(rows, begin, end):
    return [a for t, a in shakes(rows) if begin <= t < end]


def check_touch():
    status, said, rows = play_in_time("touch")
    text = "\n".join(f"{t} {what}" for t, what in rows if not what.startswith("frame"))
    point(status == 0, "the example plays to the end", said)
    words = [what for _, what in rows]
    point({"extension XR_MND_headless", "extension XR_KHR_convert_timespec_time"} <= set(words),
          "headless, with the clock's conversion")
    point("bound 4 /user/hand/right/input/grip/pose" in words and
          "bound 100 /user/hand/right/output/haptic" in words, "pose and vibration are bound", text)
    shown = [(t, float(what.split()[1])) for t, what in rows if what.startswith("frame")]
    ahead = [display - t for t, display in shown]
    point(len(shown) > 300 and not [w for w in words if "another time" in w],
          "each frame ends with the time that was predicted for it", f"{len(shown)} frames")
    point(all(a < b for (_, a), (_, b) in zip(shown, shown[1:])) and min(ahead, default=0.0) > 0.0,
          "frames are for later, and later ones for later still", str(ahead[:5]))
    point(not [w for w in words if w.startswith("wrong-thread")],
          "the haptic thread calls nothing of the runtime", text)
    point(not [w for w in words if w.startswith("located")], "the hand is located at about now",
          text)
    point(strengths(rows, 0.0, 0.5) == [], "nothing touched, no vibration", text)
    held = strengths(rows, 0.75, 0.98)
    wanted = STIFFNESS * DEPTH / FULL
    force_point(len(held) > 5 and abs(sorted(held)[len(held) // 2] - wanted) < 0.02,
                "vibration at rest is the force, stiffness times depth", f"{wanted}: {held}", said)
    point(all(0.0 <= a <= 1.0 for _, a in shakes(rows)), "strengths are from 0 to 1", text)
    lost = [(t, a) for t, a in shakes(rows) if 1.0 <= t < 1.8]
    point(len(lost) == 1 and lost[0][1] == 0.0 and lost[0][0] < 1.3,
          "tracking is lost: still, and silent until the next touch", text)
    point(len(strengths(rows, 1.8, 2.2)) > 5, "it touches again", text)
    away = [(t, a) for t, a in shakes(rows) if 2.3 <= t < 2.6]
    point(all(a == 0.0 for _, a in away) and not [w for w in words if "without focus" in w],
          "focus is lost: nothing shakes", text)
    point(any(a > 0.0 for a in strengths(rows, 2.6, 2.75)),
          "it comes back to where the hand is inside the floor", text)
    clicks = re.findall(r"^touch at ([0-9.]+) m/s$", said, re.M)
    point(len(clicks) == 4 and abs(float(clicks[0]) - 0.133) < 0.03 and
          abs(float(clicks[3]) - 0.8) < 0.1, "new touches are told with their speed", said)
    first = strengths(rows, 0.5, 0.57)
    point(first and first[0] > 0.3, "and click", text)
    places = [[float(x) for x in row] for row in
              re.findall(r"^hand at (\S+) (\S+) (\S+) m, \S+ N, box at (\S+) m$", said, re.M)]
    walked = [p for p in places if p[1] > 0.02]
    point(walked and abs(max(p[1] for p in walked) - 0.56) < 0.08 and
          all(abs(p[2] - 0.05) < 0.001 for p in walked),
          "the stick walks the hand along, 0.8 m/s for 0.7 s", str(places))
    point(places and places[-1][3] > 0.53 and places[0][3] == 0.5, "into the box, which it pushes",
          str(places))
    point("ended" in words and words[-1] == "destroyed", "the session ends as it should", text)


def check_faults():
    status, said, rows = play("runtime-dies")
    point(status == 1 and "runtime is gone, error -13" in said, "a runtime that dies is told", said)
    status, said, rows = play_in_time("stalls")
    late = [t for t, what in rows if what == "stalls"]
    after = strengths(rows, 1.3, 2.2)
    force_point(status == 0 and late and "no force:" in said and len(after) > 20 and
                abs(after[-1] - STIFFNESS * DEPTH / FULL) < 0.02,
                "a frame loop that hangs loses the force, and gets it back", said, said)
    status, said, rows = play("nonsense")
    point(status == 0 and not shakes(rows) and "touch" not in said,
          "NaN from the runtime is no hand", said)
    for story, number in (("no-headset", -35), ("pictures-only", -9)):
        status, said, rows = play(story)
        point(status == 0 and f"gives {number}" in said, f"{story}: it says so and exits 0", said)
    status, said, rows = play("touch", manifest=False)
    point(status == 0 and "no VR here" in said and "Monado" in said,
          "no runtime: it says so and exits 0", said)


check_touch()
check_faults()
print(f"1..{len(points)}")
sys.exit(0 if all(points) else 1)
