#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_packages.py ROOT [DEBS]: Debian packages, built from a copy of ROOT, then installed, used
and removed in a minimal root of the same release. DEBS: a folder of packages already built.

In the minimal root: hapode-run pushes a row of cubes, the README's program is built by pkg-config
and by CMake and run, pages of the manual and completion are there. Removed, no file is left."""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

USE = r"""#!/bin/sh
# In the minimal root. mmdebstrap keeps standard output to itself: points go to a file.
export LC_ALL=C DEBIAN_FRONTEND=noninteractive
point() {
  name=$1
  shift
  if "$@"; then verdict='ok'; else verdict='not ok'; fi
  echo "$verdict - $name" >> /tmp/points
}
apt_get() { apt-get -y -q -o APT::Sandbox::User=root "$@"; }
tools_alone() { # of those that draw nothing is needed
  apt_get install --no-install-recommends /debs/libhapode1_*.deb /debs/hapode-tools_*.deb &&
    ! dpkg-query -W 'libglfw*' 'libepoxy*' 'libgl1*' 'libx11*' 2>/dev/null | grep .
}
says_what_is_missing() { hapode-run --shot /tmp/x.png 2>&1 | grep 'apt install hapode-view'; }
draws() { # with Mesa's driver, which a viewer recommends
  apt_get install --no-install-recommends libegl1 libgl1-mesa-dri &&
    hapode-run --scene row10 --lockstep --seconds 1 --shot /tmp/x.png &&
    head -c 4 /tmp/x.png | grep -a PNG
}
runs() { hapode-run --scene row10 --lockstep --seconds 1; }
felt() { "$1" | grep 'hand feels'; }
felt_in_python() {
  python3 -c 'import hapode
with hapode.Scene.load("row10") as scene, scene.session(drive="lockstep") as session:
    hand = session.add_hand()
    session.start()
    session.advance(1000)
    assert hand.state.wrench.force[0] < -1.0'
}
by_pkg_config() {
  cc -std=c11 -o /tmp/one /usr/share/doc/hapode/examples/touch_a_cube.c \
    $(pkg-config --cflags --libs hapode) && felt /tmp/one
}
by_cmake() { # folder, what find_package gets after the name
  cmake -S /tmp/consumer -B "$1" "-DWANTED=$2" \
    -DPROGRAM=/usr/share/doc/hapode/examples/touch_a_cube.c &&
    cmake --build "$1" && felt "$1/consumer"
}
static_by_cmake() {
  by_cmake /tmp/static 'COMPONENTS;static' && ! ldd /tmp/static/consumer | grep libhapode
}
programs='hapode-run hapode-bench hapode-view spidar-emulator'
pages() { for p in $programs; do test -s "/usr/share/man/man1/$p.1.gz" || return; done; }
completes() {
  for p in $programs; do
    test -s "/usr/share/bash-completion/completions/$p" || return
  done
  bash -c '. /usr/share/bash-completion/completions/hapode-run && complete -p hapode-run'
}
rules() {
  test -s /usr/lib/udev/rules.d/60-hapode-spidar.rules &&
    test -s /usr/lib/udev/rules.d/60-hapode-forcedimension.rules
}
removes() {
  apt_get purge libhapode1 hapode-link-dds libhapode-common libhapode-dev hapode-tools hapode-view \
    python3-hapode
}
nothing_left() { ! find /usr /etc /var/lib/dpkg/info -iname '*hapode*' | grep .; }
point 'the programs install without anything that draws' tools_alone
point 'without the viewer hapode-run says what to install' says_what_is_missing
point 'installs' apt_get install --no-install-recommends /debs/*.deb
point 'hapode-run pushes a row of cubes' runs
point 'hapode-run draws, by hapode-view' draws
point 'rules of udev' rules
point 'pages of the manual' pages
point 'completion' completes
point 'a session in Python' felt_in_python
point "the README's program by pkg-config" by_pkg_config
point "the README's program by CMake" by_cmake /tmp/built 0.2
point "the README's program by CMake, static" static_by_cmake
point 'removes' removes
point 'nothing is left' nothing_left
"""
# A run that ends before its last point is a failure.
PLANNED = USE.count("\npoint '") + USE.count('\npoint "')
NEEDED = ["dpkg-buildpackage", "dh", "lintian", "mmdebstrap"]


def release():
    for line in pathlib.Path("/etc/os-release").read_text().splitlines():
        if line.startswith("VERSION_CODENAME="):
            return line.split("=")[1].strip('"')
    return "stable"


def logged(command, log, **more):
    """Whether it succeeds; what it says is in the log."""
    with open(log, "a", encoding="utf-8") as said:
        return subprocess.run(command, stdout=said, stderr=said, check=False,
                              **more).returncode == 0


def build(root, folder, log):
    """Packages beside a copy of what git knows, for a build leaves files in debian/."""
    tree = os.path.join(folder, "hapode")
    shutil.copytree(root, tree, symlinks=True, ignore=lambda parent, names: [
        name for name in names if name == ".git" or
        os.path.exists(os.path.join(parent, name, "meson-private"))])
    options = "nocheck parallel=" + str(os.cpu_count())
    return logged(["dpkg-buildpackage", "-us", "-uc", "-b"], log, cwd=tree,
                  env=dict(os.environ, DEB_BUILD_OPTIONS=options))


def lintian(folder, log):
    """Errors alone: a new package has a warning of no bug that it closes."""
    changes = [str(path) for path in pathlib.Path(folder).glob("*.changes")]
    return logged(["lintian", "--allow-root", "--fail-on", "error", *changes], log)


def used(root, folder, log):
    hook = os.path.join(folder, "use.sh")
    pathlib.Path(hook).write_text(USE, encoding="utf-8")
    debs = [str(path) for path in pathlib.Path(folder).glob("*.deb") if "-dbgsym" not in path.name]
    consumer = os.path.join(root, "tests", "consumer")
    logged(["mmdebstrap", "--variant=minbase", "--format=null",
            "--include=gcc,libc6-dev,cmake,make,pkg-config", "--customize-hook=mkdir $1/debs",
            f"--customize-hook=copy-in {' '.join(debs)} /debs",
            f"--customize-hook=copy-in {consumer} {hook} /tmp",
            "--customize-hook=chroot $1 sh /tmp/use.sh",
            f"--customize-hook=copy-out /tmp/points {folder}", release(), "/dev/null"], log)
    points = pathlib.Path(folder, "points")
    return points.read_text(encoding="utf-8").splitlines() if points.exists() else []


def main(root, built):
    missing = [tool for tool in NEEDED if not shutil.which(tool)]
    if not missing and not built:
        missing = subprocess.run(["dpkg-checkbuilddeps"], cwd=root, capture_output=True, text=True,
                                 check=False).stderr.splitlines()
    if not missing and os.geteuid() != 0:
        missing = ["root"]
    if missing:
        print("1..0 # SKIP needs " + ", ".join(missing))
        return
    with tempfile.TemporaryDirectory() as folder:
        log = os.path.join(folder, "log")
        said = []
        if built:
            for path in pathlib.Path(built).iterdir():
                if path.suffix in (".deb", ".changes", ".buildinfo"):
                    shutil.copy(path, folder)
        else:
            said.append(("ok" if build(root, folder, log) else "not ok") + " - builds")
        said.append(("ok" if lintian(folder, log) else "not ok") + " - lintian finds no error")
        said += used(root, folder, log)
        print(f"1..{PLANNED + 1 + (not built)}")
        for number, line in enumerate(said, 1):
            print(line.replace("ok -", f"ok {number} -", 1))
        if len(said) < PLANNED + 1 + (not built) or any(line.startswith("not") for line in said):
            for line in pathlib.Path(log).read_text(errors="replace").splitlines()[-200:]:
                print("# " + line)


main(os.path.abspath(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "")
