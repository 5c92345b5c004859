#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_options.py ROOT [NAME...]: builds hapode with each option off alone, by gcc and by clang,
static and shared, and tries each build: the simulation gives the same bits, the README's program is
built against it, and it is installed. NAME: only these builds."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

root = pathlib.Path(sys.argv[1]).resolve()
wanted = sys.argv[2:]
# Engines to compare with take long to build against, and change nothing else.
COMMON = ["--buildtype=debugoptimized", "-Dbullet=disabled", "-Dmujoco=disabled", "-Dlint=disabled",
          "-Dtests=disabled"]
BUILDS = {  # name: compiler, options
    "gcc": ("gcc", []),
    "clang": ("clang", []),
    "gcc, static": ("gcc", ["-Ddefault_library=static"]),
    "gcc, shared": ("gcc", ["-Ddefault_library=shared"]),
    "clang, static": ("clang", ["-Ddefault_library=static"]),
    "clang, shared": ("clang", ["-Ddefault_library=shared"]),
    "release": ("gcc", ["--buildtype=release"]),
    "debug": ("gcc", ["--buildtype=debug"]),
    "lanes=plain": ("gcc", ["-Dlanes=plain"]),
    "hardening=off": ("gcc", ["-Dhardening=off"]),
    "asserts=disabled": ("gcc", ["-Dasserts=disabled"]),
}
OPTIONS = ("serial", "haply", "view", "python", "scene_files", "openxr", "docs", "plots",
           "dds")
BUILDS |= {f"{name}=disabled": ("gcc", [f"-D{name}=disabled"]) for name in OPTIONS}
# What a build without the option says where it is asked for it; where that can be asked.
REFUSED = {
    "view=disabled": (["--scene", "row10", "--shot", "x.png"], "meson option view"),
    "haply=disabled": (["--scene", "row10", "--device", "haply"], "built without libwslay"),
    "dds=disabled": (["--serve", "w", "--seconds", "0.1"], "hapode-link-dds"),
    "scene_files=disabled": (["--scene", "x.urdf"], "built without expat"),
    "plots=disabled": (["--scene", "row10", "--lockstep", "--seconds", "0.1", "--plot", "x.svg"],
                       "no picture"),
}
hashes = {}
count = failed = 0


def point(problem, name):
    global count, failed
    count += 1
    failed += bool(problem)
    if problem:
        print("# " + problem.strip()[-3000:].replace("\n", "\n# "))
    print(f"{'not ok' if problem else 'ok'} {count} - {name}", flush=True)


def skip(name, reason):
    global count
    count += 1
    print(f"ok {count} - {name} # SKIP {reason}", flush=True)


def run(command, **more):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True,
                          timeout=1800, check=False, **more)
    said = done.stdout + done.stderr
    return said, "" if done.returncode == 0 else said or f"exit status {done.returncode}"


def simulate(build, name):
    said, problem = run([build / "hapode-run", "--scene", "row10", "--lockstep", "--seconds", "1"])
    found = re.search(r"^trace_hash: (\w+)$", said, re.M)
    if problem or not found:
        return problem or said
    hashes[name] = found[1]
    return "" if len(set(hashes.values())) == 1 else f"other bits than before: {hashes}"


def consume(build, compiler):
    """The README's program against the folder of the build."""
    env = dict(os.environ, PKG_CONFIG_PATH=str(build / "meson-uninstalled"))
    static = [] if list(build.glob("lib/*.so")) else ["--static"]
    flags, problem = run(["pkg-config", *static, "--cflags", "--libs", "hapode"], env=env)
    program = build / "touch_a_cube_apart"
    problem = problem or run([compiler, "-std=c11", "-o", program,
                              root / "examples/touch_a_cube.c", *flags.split()])[1]
    if not problem:
        said, problem = run([program], env=dict(os.environ, LD_LIBRARY_PATH=str(build / "lib")))
        problem = problem or ("" if "hand feels" in said else said)
    return problem


def install(build, stage):
    problem = run(["meson", "install", "-C", build, "--no-rebuild", "--quiet", "--destdir",
                   stage])[1]
    return problem or ("" if list(stage.rglob("hapode.pc")) else "no hapode.pc")


def try_build(name, compiler, options, build, stage):
    compiler = next((c for c in (compiler, compiler + "-14") if shutil.which(c)), None)
    if compiler is None:
        skip(name, "needs " + BUILDS[name][0])
        return
    ccache = ["ccache"] if shutil.which("ccache") else []
    # The builds share most objects. For debuggers alone the folder's name is in them.
    env = dict(os.environ, CC=" ".join([*ccache, compiler]), CCACHE_NOHASHDIR="1")
    problem = run(["meson", "setup", build, root, *COMMON, *options], env=env)[1]
    problem = problem or run(["ninja", "-C", build], env=env)[1]
    problem = problem or simulate(build, name) or consume(build, compiler)
    problem = problem or install(build, stage)
    if not problem and name in REFUSED:
        words, reason = REFUSED[name]
        said = run([build / "hapode-run", *words], cwd=stage)[0]
        problem = "" if reason in said else f"{' '.join(words)} said: {said}"
    point(problem, name)


def main():
    unknown = [name for name in wanted if name not in BUILDS]
    if unknown:
        sys.exit(f"no build {unknown[0]}: {', '.join(BUILDS)}")
    for tool in ("meson", "ninja", "pkg-config"):
        if not shutil.which(tool):
            print(f"1..0 # SKIP needs {tool}")
            return
    for name, (compiler, options) in BUILDS.items():
        if not wanted or name in wanted:
            # In the tree, so that ccache knows what was compiled before.
            with tempfile.TemporaryDirectory(prefix="build-option-", dir=root) as build, \
                    tempfile.TemporaryDirectory() as stage:
                try_build(name, compiler, options, pathlib.Path(build), pathlib.Path(stage))
    print(f"1..{count}")
    sys.exit(1 if failed else 0)


main()
