#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_strangers.py ROOT [NAME...]: five people who have never seen hapode, each in a minimal root
of their own, with the commands that the README leads to (tests/strangers). A command under the
name of a page must be on that page."""
import os
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time

root = pathlib.Path(sys.argv[1]).resolve()
scripts = sorted((root / "tests" / "strangers").glob("*.sh"))
chosen = [path for path in scripts if not sys.argv[2:] or path.stem in sys.argv[2:]]
PAGE = re.compile(r"^#: (\S+)\n(.*)$", re.M)
# What a script has around a command of a page.
AROUND = re.compile(r"^(\$rt|script -qec) | (\| grep .*|\|\| true|--check-wait 0|said <.*)$")
points = []


def point(problem, name):
    points.append(not problem)
    if problem:
        print("# " + problem.strip()[-6000:].replace("\n", "\n# "))
    print(f"{'not ok' if problem else 'ok'} {len(points)} - {name}", flush=True)


def plain(text):
    return re.sub(r"\s+", " ", text)


def not_on_page(script):
    """Commands that their page does not have; what is behind a pipe is the test's."""
    for page, command in PAGE.findall(script.read_text("utf-8")):
        command = AROUND.sub("", command)
        text = plain((root / page).read_text("utf-8"))
        if plain(command) not in text:
            yield f"{script.name}: {page} has no \"{command}\""


def release():
    text = pathlib.Path("/etc/os-release").read_text("utf-8")
    found = re.search(r"^VERSION_CODENAME=\"?(\w+)", text, re.M)
    return found[1] if found else "stable"


def copied(folder):
    """The tree as somebody gets it: without what was built."""
    tree = folder / "hapode"
    shutil.copytree(root, tree, symlinks=True, ignore=lambda parent, names: [
        name for name in names if name == ".git" or
        os.path.exists(os.path.join(parent, name, "meson-private"))])
    return tree


def children_s():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def visit(script, tree, folder):
    log = folder / "log"
    steps = folder / "visit.sh"
    steps.write_text("export LC_ALL=C DEBIAN_FRONTEND=noninteractive\n"
                     "echo 'APT::Sandbox::User \"root\"; APT::Install-Recommends \"0\";' "
                     "> /etc/apt/apt.conf.d/99visit\n"
                     "cd /srv/hapode\nset -eux\n" + script.read_text("utf-8"), "utf-8")
    begin, used = time.monotonic(), children_s()
    with open(log, "w", encoding="utf-8") as said:
        done = subprocess.run(
            ["mmdebstrap", "--variant=minbase", "--format=null",
             f"--customize-hook=copy-in {tree} {steps} /srv",
             "--customize-hook=chroot $1 sh /srv/visit.sh && touch $1/srv/good",
             f"--customize-hook=copy-out /srv/good {folder}", release(), "/dev/null"],
            stdout=said, stderr=said, check=False, timeout=3000)
    seconds = time.monotonic() - begin
    good = done.returncode == 0 and (folder / "good").exists()
    print(f"# {script.stem}: {seconds / 60:.1f} minutes, {(children_s() - used) / 60:.1f} of a "
          "processor, with the minimal root")
    text = log.read_text("utf-8", "replace")
    print("".join(f"# {line}\n" for line in re.findall("^told: (.*)", text, re.M)), end="")
    return "" if good else text


def main():
    point("\n".join(problem for script in scripts for problem in not_on_page(script)),
          "commands are on the pages that they are said to be from")
    missing = [tool for tool in ("mmdebstrap",) if not shutil.which(tool)]
    missing += [] if os.geteuid() == 0 else ["root"]
    for script in chosen:
        if missing:
            points.append(True)
            print(f"ok {len(points)} - {script.stem} # SKIP needs " + ", ".join(missing))
            continue
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            point(visit(script, copied(folder), folder), f"{script.stem}: all commands succeed")
    print(f"1..{len(points)}")
    return 0 if all(points) else 1


sys.exit(main())
