#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_scene_oracle.py ROOT TEST_SCENE_FILES ORACLE_FILES: scene files against the newest MuJoCo,
which is a package for node ("npm install @mujoco/mujoco"): all cases of test_scene_files, and the
files in ../shared/scenes. Looked for in HAPODE_MUJOCO_NODE, ROOT and npm's global folder."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

PACKAGE = "node_modules/@mujoco/mujoco/mujoco.js"


def folder(root):
    places = [os.environ.get("HAPODE_MUJOCO_NODE", ""), root]
    if shutil.which("npm"):
        done = subprocess.run(["npm", "root", "-g"], capture_output=True, text=True, check=False)
        places.append(os.path.dirname(done.stdout.strip()))
    return next((place for place in places if place and os.path.exists(f"{place}/{PACKAGE}")), None)


def refused_well(root, program, env):
    """What MuJoCo refuses, and what hapode does, are told apart, and the next file is compared."""
    bad = os.path.join(root, "README.md")
    done = subprocess.run([program, bad, bad], env=env, capture_output=True, text=True, check=False)
    return [line.split()[0] for line in done.stdout.splitlines()] == ["unread", "unread"]


# Both differ from MuJoCo: of the first a line says why. In the second MuJoCo makes one body of two,
# which is as good, but no line says so.
NOTED = """<mujoco><worldbody><body><joint springdamper='.5 1'/><geom size='.1'/></body>
</worldbody></mujoco>"""
SILENT = """<mujoco><compiler fusestatic='true'/><worldbody><body><freejoint/><geom size='.1'/>
<body pos='1 0 0'><geom size='.1'/></body></body></worldbody></mujoco>"""


def judged_well(program, env):
    """What differs with a line is noted, what differs in silence is wrong."""
    words = []
    with tempfile.TemporaryDirectory() as folder:
        for text in (NOTED, SILENT):
            path = pathlib.Path(folder, "scene.xml")
            path.write_text(text, encoding="utf-8")
            done = subprocess.run([program, path], env=env, capture_output=True, text=True,
                                  check=False)
            words.append((done.stdout.split()[:1], done.returncode))
    return words == [(["noted"], 0), (["wrong"], 1)]


def main(root, cases, files):
    place = folder(root)
    if place is None or not shutil.which("node"):
        print("1..0 # SKIP needs node and its package @mujoco/mujoco (npm install @mujoco/mujoco)")
        return 0
    env = dict(os.environ, HAPODE_MUJOCO_NODE=place, HAPODE_SOURCE=root)
    done = subprocess.run([cases], env=env, capture_output=True, text=True, check=False)
    points = [re.sub(r"^(not ok|ok) \d+", r"\1 %d", line) for line in done.stdout.splitlines()
              if re.match(r"(not )?ok |#", line)]
    points.append(("ok %d" if done.returncode == 0 else "not ok %d") + " - test_scene_files ends")
    points.append(("ok %d" if refused_well(root, files, env) else "not ok %d") + " - no scenes")
    points.append(("ok %d" if judged_well(files, env) else "not ok %d") + " - silence is wrong")
    scenes = sorted(pathlib.Path(root, "..", "shared", "scenes").glob("*.xml"))
    if scenes:
        done = subprocess.run([files, *scenes], env=env, capture_output=True, text=True,
                              check=False)
        points += ["# " + line for line in done.stdout.splitlines()]
        good = done.returncode == 0 and re.search("^equal ", done.stdout, re.M) is not None
        good = good and re.search("^noted ", done.stdout, re.M) is None
        points.append(("ok %d" if good else "not ok %d") + " - public scenes are equal")
    count = 0
    for line in points:
        count += line[0] != "#"
        print(line % count if line[0] != "#" else line)
    print(f"1..{count}")
    return any(line.startswith("not") for line in points)


sys.exit(main(os.path.abspath(sys.argv[1]), *sys.argv[2:]))
