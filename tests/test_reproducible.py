#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_reproducible.py ROOT: two builds in different folders give the same library, byte by byte.

Names of folders are only in what is for debuggers. Distributions map them by -ffile-prefix-map, and
so does this test."""
import filecmp
import os
import shutil
import subprocess
import sys
import tempfile


def copy(root, tree):
    def others(folder, names):  # folders of builds lie in the root; build_*.c are sources
        return [name for name in names if os.path.samefile(folder, root) and
                (name == ".git" or
                 os.path.exists(os.path.join(root, name, "meson-private")))]
    shutil.copytree(root, tree, symlinks=True, ignore=others)
    return tree


def build(tree):
    """The shared library."""
    folder = os.path.join(tree, "build")
    subprocess.run(["meson", "setup", "--buildtype=release", "-Dtests=disabled", "-Dlint=disabled",
                    "-Dplots=disabled", "-Ddefault_library=shared",
                    f"-Dc_args=-ffile-prefix-map={tree}=.", folder, tree],
                   check=True, stdout=subprocess.DEVNULL,
                   env=dict(os.environ, CCACHE_DISABLE="1"))
    targets = subprocess.run(["ninja", "-C", folder, "-t", "targets", "all"], capture_output=True,
                             text=True, check=True).stdout
    library = next(line.split(":")[0] for line in targets.splitlines()
                   if line.startswith("lib/libhapode.so.") and "LINKER" in line)
    subprocess.run(["ninja", "-C", folder, library], check=True, stdout=subprocess.DEVNULL,
                   env=dict(os.environ, CCACHE_DISABLE="1"))
    return os.path.join(folder, library)


def main(root):
    with tempfile.TemporaryDirectory() as folder:
        names = ["a", os.path.join("another", "and", "longer", "one")]
        trees = [copy(root, os.path.join(folder, name)) for name in names]  # of the same moment
        same = filecmp.cmp(*[build(tree) for tree in trees], shallow=False)
        print(f"{'ok' if same else 'not ok'} 1 - the same bytes in two folders")
        print("1..1")


main(os.path.abspath(sys.argv[1]))
