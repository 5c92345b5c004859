#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_aarch64.py ROOT [SYSROOT]: hapode for another processor. Debian's arm64 packages are
extracted into a folder (or are in SYSROOT), hapode is cross-compiled against them, and test
programs run under emulation. The felt force is compared with that of this processor."""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

root = pathlib.Path(sys.argv[1]).resolve()
PACKAGES = "libc6-dev,libgcc-12-dev,libode-dev,libccd-dev,zlib1g-dev,libserialport-dev," \
           "libexpat1-dev,libqhull-dev"
# Solver, contacts, joints, guard, files, devices: what has numbers and bits in it. What needs a
# clock in real time is left out: an emulator is too slow for it on a busy machine.
TESTS = ("ball_nearest", "velocity", "solver_apart", "contact_solver", "joints", "guard", "field",
         "scene", "touches", "lanes", "key_file", "exchange", "spidar_kinematics")
CROSS = """
[binaries]
c = 'aarch64-linux-gnu-gcc'
cpp = 'aarch64-linux-gnu-g++'
ar = 'aarch64-linux-gnu-ar'
strip = 'aarch64-linux-gnu-strip'
pkgconfig = 'pkg-config'
exe_wrapper = ['qemu-aarch64-static', '-L', '{sysroot}']
[properties]
sys_root = '{sysroot}'
pkg_config_libdir = ['{sysroot}/usr/lib/aarch64-linux-gnu/pkgconfig',
                     '{sysroot}/usr/share/pkgconfig']
[built-in options]
c_args = ['--sysroot={sysroot}']
c_link_args = ['--sysroot={sysroot}']
[host_machine]
system = 'linux'
cpu_family = 'aarch64'
cpu = 'aarch64'
endian = 'little'
"""
NEEDED = ("mmdebstrap", "aarch64-linux-gnu-gcc", "qemu-aarch64-static", "meson", "ninja")
OFF = [f"-D{name}=disabled" for name in ("view", "python", "openxr", "docs", "plots", "bullet",
                                         "mujoco", "lint")]
SCENE = ["--scene", "slide", "--lockstep", "--seconds", "2"]
points = []


def point(problem, name):
    points.append(not problem)
    if problem:
        print("# " + problem.strip()[-4000:].replace("\n", "\n# "))
    print(f"{'not ok' if problem else 'ok'} {len(points)} - {name}", flush=True)
    return not problem


def run(*command, timeout=3600):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True,
                          timeout=timeout, check=False)
    said = done.stdout + done.stderr
    return said, "" if done.returncode == 0 else said or f"exit status {done.returncode}"


def release():
    text = pathlib.Path("/etc/os-release").read_text("utf-8")
    found = re.search(r"^VERSION_CODENAME=\"?(\w+)", text, re.M)
    return found[1] if found else "stable"


def extract(folder):
    sysroot = folder / "sysroot"
    return sysroot, run("mmdebstrap", "--variant=extract", "--architectures=arm64",
                        "--include=" + PACKAGES, "--format=directory", release(), sysroot)[1]


def force_of(said):
    found = re.search(r"^peak_force_n: ([0-9.]+)", said, re.M)
    return float(found[1]) if found else None


def compare(build, sysroot, native):
    here, problem = run(native, *SCENE)
    there, more = run("qemu-aarch64-static", "-L", sysroot, build / "hapode-run", *SCENE)
    problem = problem or more
    a, b = force_of(here), force_of(there)
    if problem or a is None or b is None:
        return problem or here + there
    return "" if a > 0.1 and abs(a - b) < 0.001 * a else f"{a} N here, {b} N there"


def try_build(folder, sysroot, native):
    cross, build = folder / "cross", folder / "build"
    cross.write_text(CROSS.format(sysroot=sysroot), "utf-8")
    if not point(run("meson", "setup", build, root, "--cross-file", cross,
                     "--buildtype=debugoptimized", *OFF)[1], "set up for aarch64"):
        return
    wanted = [f"tests/test_{name}" for name in TESTS]
    if not point(run("ninja", "-C", build, "hapode-run", "hapode-bench", *wanted)[1],
                 f"builds: library, programs, {len(TESTS)} tests"):
        return
    said = run("file", "-L", build / "hapode-run")[0] if shutil.which("file") else "aarch64"
    point("" if "aarch64" in said else said, "for that processor")
    for name in TESTS:
        said, problem = run("qemu-aarch64-static", "-L", sysroot, build / f"tests/test_{name}")
        bad = "\n".join(line for line in said.splitlines() if line.startswith(("not ok", "#")))
        good = re.search(r"^ok 1\b", said, re.M)
        point(problem and (bad or problem) or ("" if good else said), f"test {name}, emulated")
    if native is not None:
        point(compare(build, sysroot, native), "the same force as on this processor, within 0.1 %")


def main():
    missing = [tool for tool in NEEDED if not shutil.which(tool)]
    if missing:
        print("1..0 # SKIP needs " + ", ".join(missing) +
              " (Debian: gcc-aarch64-linux-gnu qemu-user-static mmdebstrap)")
        return 0
    native = next((path for path in (root / "build/hapode-run",) if path.exists()), None)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        if len(sys.argv) > 2:
            sysroot, problem = pathlib.Path(sys.argv[2]).resolve(), ""
        else:
            sysroot, problem = extract(folder)
        if point(problem, "Debian's arm64 packages are extracted"):
            try_build(folder, sysroot, native)
    print(f"1..{len(points)}")
    return 0 if all(points) else 1


sys.exit(main())
