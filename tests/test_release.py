# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""tools/release in a copy of the repository: what it refuses, and a release whose archive is built
and tested. Argument: source root; it must be a repository of git."""
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile

root = pathlib.Path(sys.argv[1]).resolve()
points = []


def point(good, name, note=""):
    points.append(bool(good))
    if note and not good:
        print("# " + note.strip()[-3000:].replace("\n", "\n# "))
    print(f"{'ok' if good else 'not ok'} {len(points)} - {name}", flush=True)


def run(*command, cwd):
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=3000,
                          check=False)
    return done.returncode, done.stdout + done.stderr


def refused(tree, name, reason, *words):
    status, said = run("tools/release", *words, cwd=tree)
    point(status != 0 and reason in said, f"refused: {name}", said)


def check_refusals(tree):
    refused(tree, "no version", "three numbers", "1.0")
    refused(tree, "older than it is", "is older", "0.0.1")
    refused(tree, "not in the changelog", "has no section", "9.8.8")
    refused(tree, "no folder", "no such folder", "9.8.7", "--out", "/nowhere/at/all")
    refused(tree, "no date", "YYYY-MM-DD", "9.8.7", "--date", "today")
    (tree / "README.md").write_text("changed\n")
    refused(tree, "changes", "not committed", "9.8.7")
    run("git", "checkout", "README.md", cwd=tree)
    run("git", "tag", "v9.8.7", cwd=tree)
    refused(tree, "a tag", "tag v9.8.7 already", "9.8.7")
    run("git", "tag", "-d", "v9.8.7", cwd=tree)


def content(path, name):
    with tarfile.open(path) as tar:
        return tar.extractfile(name).read().decode("utf-8")


def check_release(tree, out):
    before = run("git", "rev-parse", "HEAD", cwd=tree)[1]
    words = ["tools/release", "9.8.7", "--out", str(out), "--date", "2030-02-01", "--tests",
             "base", "scene", "key_file", "touches"]
    status, said = run(*words, "--dry-run", cwd=tree)
    path = out / "hapode-9.8.7.tar.gz"
    point(status == 0 and path.exists(), "dry: an archive that builds and passes tests", said)
    if not path.exists():
        return
    point(run("git", "rev-parse", "HEAD", cwd=tree)[1] == before and
          not run("git", "tag", "--list", "v9*", cwd=tree)[1].strip() and
          not run("git", "status", "--porcelain", cwd=tree)[1], "dry: the repository is as before")
    top = "hapode-9.8.7/"
    point("version: '9.8.7'" in content(path, top + "meson.build") and
          "HAP_VERSION_MINOR 8" in content(path, top + "include/hapode/version.h") and
          "find_package(hapode 9.8 REQUIRED)" in content(path, top + "README.md") and
          "date-released: 2030-02-01" in content(path, top + "CITATION.cff") and
          "## [9.8.7] - 2030-02-01" in content(path, top + "CHANGELOG.md") and
          content(path, top + "debian/changelog").startswith("hapode (9.8.7-1)"),
          "every file has the version")
    first = path.read_bytes()
    status, said = run(*words[:-4], "base", cwd=tree)
    point(status == 0 and run("git", "describe", cwd=tree)[1].strip() == "v9.8.7",
          "committed and tagged", said)
    point(run("git", "log", "-1", "--format=%s", cwd=tree)[1].strip() == "hapode 9.8.7",
          "with its name as the message")
    with tarfile.open(path) as tar:
        names = tar.getnames()
    kept = [line for line in run("git", "ls-files", cwd=tree)[1].split("\n") if line]
    point(set(top + name for name in kept) <= set(names), "all files are in it")
    point(len(first) > 0 and re.search(r"^[0-9a-f]{64}  /", said, re.M), "its sum is told", said)


def main():
    for tool in ("git", "meson", "ninja", "tar"):
        if not shutil.which(tool):
            print(f"1..0 # SKIP needs {tool}")
            return 0
    if not (root / ".git").exists():
        print("1..0 # SKIP not a repository of git")
        return 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        tree, out = folder / "tree", folder / "out"
        out.mkdir()
        run("git", "clone", "--quiet", "--no-local", str(root), str(tree), cwd=folder)
        run("git", "config", "user.name", "somebody", cwd=tree)
        run("git", "config", "user.email", "somebody@example.org", cwd=tree)
        text = (tree / "CHANGELOG.md").read_text("utf-8")
        (tree / "CHANGELOG.md").write_text(
            text.replace("\n## [", "\n## [9.8.7] - unreleased\n\n- A thing.\n\n## [", 1), "utf-8")
        run("git", "commit", "-qam", "Changelog", cwd=tree)
        check_refusals(tree)
        check_release(tree, out)
    print(f"1..{len(points)}")
    return 0 if all(points) else 1


sys.exit(main())
