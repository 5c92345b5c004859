# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""Shared by the checks of this folder: the project's files, and TAP output."""
import os
import re
import subprocess
import sys

CODE_DIRS = ("include", "lib", "plugins", "scenes", "view", "import", "tools", "bench",
             "examples", "tests")
SHOWN_MAX = 40  # problems printed per test point


class Tap:
    def __init__(self):
        self.count = 0
        self.failed = 0

    def point(self, name, problems=()):
        """A test point; it passes when there are no problems."""
        problems = list(problems)
        for problem in problems[:SHOWN_MAX]:
            for line in str(problem).splitlines():
                print("# " + line)
        if len(problems) > SHOWN_MAX:
            print(f"# and {len(problems) - SHOWN_MAX} more")
        self.count += 1
        self.failed += bool(problems)
        print(f"{'not ok' if problems else 'ok'} {self.count} - {name}", flush=True)

    def skip(self, name, reason):
        self.count += 1
        print(f"ok {self.count} - {name} # SKIP {reason}", flush=True)

    def done(self):
        print(f"1..{self.count}")
        sys.exit(1 if self.failed or not self.count else 0)


def skip_all(reason):
    print(f"1..0 # SKIP {reason}")
    sys.exit(0)


def _from_git(root):
    """Tracked files and those that could be; None outside a git work tree of our own."""
    def git(*args):
        return subprocess.run(["git", "-C", root, *args], capture_output=True, check=True).stdout
    try:
        top = os.fsdecode(git("rev-parse", "--show-toplevel").rstrip(b"\n"))
        if os.path.realpath(top) != os.path.realpath(root):
            return None
        names = git("ls-files", "-z", "--cached", "--others", "--exclude-standard").split(b"\0")
    except (OSError, subprocess.CalledProcessError):
        return None
    return [os.fsdecode(name) for name in names if name]


def _from_disk(root):
    for folder, dirs, names in os.walk(root):
        dirs[:] = [d for d in dirs if d not in (".git", "__pycache__") and
                   not os.path.isdir(os.path.join(folder, d, "meson-private"))]
        for name in names:
            yield os.path.relpath(os.path.join(folder, name), root)


def project_files(root):
    """Paths relative to root, with '/', sorted. Never those of a build folder."""
    names = _from_git(root) or _from_disk(root)
    return sorted({n for n in names if os.path.isfile(os.path.join(root, n))})


def code_files(root):
    return [n for n in project_files(root)
            if n.endswith((".c", ".h")) and n.split("/")[0] in CODE_DIRS]


def _git(root, *args):
    """What git says; None when it cannot."""
    try:
        run = subprocess.run(["git", "-C", root, *args], capture_output=True, check=True, text=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return run.stdout.strip()


def _base(root):
    """Where this branch left the main one; on the main branch itself the last commit but one."""
    head = _git(root, "rev-parse", "HEAD")
    for main in ("origin/HEAD", "origin/main", "main"):
        base = _git(root, "merge-base", "HEAD", main)
        if base and base != head:
            return base
    return _git(root, "rev-parse", "HEAD^")


def changed_files(root):
    """Files that differ from the base, and new ones; None: any may have changed."""
    base = _base(root)
    changed = base and _git(root, "diff", "--name-only", base)
    new = _git(root, "ls-files", "--others", "--exclude-standard")
    return None if not base or changed is None or new is None else \
        set(changed.splitlines()) | set(new.splitlines())


_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*[<"]([^>"\n]+)[>"]', re.M)


def _resolve(root, name, target):
    for start in (os.path.dirname(name), "lib", "", "include"):
        path = os.path.normpath(os.path.join(start, target))
        if not path.startswith("..") and os.path.isfile(os.path.join(root, path)):
            return path
    return None


def changed_units(root, names, settings):
    """Files that changed or include what changed; all when a file of settings changed."""
    changed = changed_files(root)
    if changed is None or changed & set(settings):
        return list(names)
    known = {}  # file: it or what it includes changed

    def is_changed(name):
        if name not in known:
            known[name] = name in changed
            found = {_resolve(root, name, target) for target in _INCLUDE.findall(read(root, name))}
            known[name] = known[name] or any(is_changed(other) for other in found if other)
        return known[name]

    return [name for name in names if is_changed(name)]


def read(root, name):
    with open(os.path.join(root, name), encoding="utf-8", errors="replace") as f:
        return f.read()


_TOKEN = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.S)


def without_comments(text):
    """C text with comments and the insides of literals blanked; lines keep their numbers."""
    def blank(match):
        token = match.group()
        if token[0] == "/":
            return re.sub(r"[^\n]", " ", token)
        return token[0] + " " * (len(token) - 2) + token[-1]
    return _TOKEN.sub(blank, text)
