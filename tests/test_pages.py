# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""Links, code and commands of README and docs. Arguments: source root, hapode-run, hapode-bench,
compiler."""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

root, program, bench = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
compiler = sys.argv[4:]
pages = sorted(root.glob("*.md")) + sorted((root / "docs").rglob("*.md"))
CODE = re.compile(r"^```(\w*)\n(.*?)^```$", re.S | re.M)
# Words of a page that are a file or a folder of the tree.
PATH = re.compile(r"`((?:docs|lib(?!/udev)|include|tests|tools|bench|scenes|plugins|examples)/"
                  r"[\w./*-]+)`")
# Words of a command that calls for hardware, for a driver, for a file of another one, or for a
# clock.
NEEDS_MORE = ("spidar", "haply", "forcedimension", "openhaptics", "module:", "replay:", "/",
              "--play", "--identity", "--record", "--tick-share", "--physics-share",
              "--reconnect", "--shot", "--frames", "--view", "--html", "--serve", "--connect")
FILE_ENDS = (".xml", ".urdf")
# What a piece of code may use; a whole program has a main of its own.
BEFORE = """#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <stdio.h>
hap_status piece(hap_session *session, hap_device *device, hap_pointer_id hand, hap_detail why);
hap_status piece(hap_session *session, hap_device *device, hap_pointer_id hand, hap_detail why)
{
  hap_session_def session_def;
  hap_expert_def expert;
  hap_ode_def ode_def;
  hap_pointer_def hand_def;
  hap_stats stats;
  hap_status status = HAP_OK;
  (void)session, (void)device, (void)hand, (void)why, (void)sizeof stats;
  hap_session_def_init(&session_def, sizeof session_def);
  hap_ode_def_init(&ode_def, sizeof ode_def);
  hap_pointer_def_init(&hand_def, sizeof hand_def);
"""
AFTER = "  return status;\n}\n"
points = []


def point(problems, name):
    points.append(not problems)
    for problem in problems[:40]:
        print("# " + str(problem).replace("\n", "\n# "))
    print(f"{'not ok' if problems else 'ok'} {len(points)} - {name}", flush=True)


def skip(name, reason):
    points.append(True)
    print(f"ok {len(points)} - {name} # SKIP {reason}")


def slug(heading):
    """The anchor of a heading, as code hosts make it."""
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
    return re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")


def anchors(path):
    text = CODE.sub("", path.read_text(encoding="utf-8"))
    return {slug(heading) for heading in re.findall(r"^#+ (.*)$", text, re.M)}


def links(path):
    text = CODE.sub("", path.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if not re.match(r"[a-z]+:", target):
            yield target


def bad_links():
    for page in pages:
        for target in links(page):
            name, _, anchor = target.partition("#")
            path = (page.parent / name).resolve() if name else page
            if not path.exists():
                yield f"{page.relative_to(root)}: {target} is not there"
            elif anchor and anchor not in anchors(path):
                yield f"{page.relative_to(root)}: {target} has no such heading"


def bad_paths():
    for page in pages:
        if page.name == "CHANGELOG.md":
            continue
        for name in PATH.findall(page.read_text(encoding="utf-8")):
            if not list(root.glob(name.rstrip("/."))):
                yield f"{page.relative_to(root)}: {name} is not there"


def bad_pages_in_code():
    """Pages, and their headings, that a comment or a text of the code names."""
    for folder in ("include", "lib", "plugins", "scenes", "tools", "bench", "examples", "tests"):
        for path in sorted((root / folder).rglob("*.[ch]")):
            text = path.read_text(encoding="utf-8", errors="replace")
            for name, heading in re.findall(r'(docs/[\w/-]+\.md)(?:,[\s*]+"([^"\\]+)")?', text):
                where = path.relative_to(root)
                if not (root / name).is_file():
                    yield f"{where}: {name} is not there"
                elif heading and slug(heading) not in anchors(root / name):
                    yield f"{where}: {name} has no heading {heading}"


def bad_names():
    """Words of a page in the library's own name space that no header has."""
    headers = "".join(path.read_text(encoding="utf-8")
                      for path in (root / "include").rglob("*.h"))
    known = set(re.findall(r"\b(?:hap|HAP)_\w+", headers))
    for page in pages:
        if page.name == "CHANGELOG.md" or page.parent.name in ("decisions", "bench"):
            continue  # they speak of what was, too
        for name in set(re.findall(r"\b(?:hap|HAP)_\w+", page.read_text(encoding="utf-8"))):
            if name not in known and not any(word.startswith(name) for word in known):
                yield f"{page.relative_to(root)}: no header has {name}"


def lost_pages(start):
    """Pages that nobody comes to from there."""
    reached = set()
    waiting = [root / start]
    while waiting:
        page = waiting.pop()
        if page in reached:
            continue
        reached.add(page)
        waiting += [path for target in links(page)
                    for path in [(page.parent / target.partition("#")[0]).resolve()]
                    if path.suffix == ".md" and path.is_file()]
    return [str(page.relative_to(root)) for page in pages
            if page.resolve() not in reached and page.name != "CHANGELOG.md"]


def pieces():
    for page in pages:
        for number, (language, text) in enumerate(CODE.findall(page.read_text(encoding="utf-8"))):
            if language == "c":
                yield f"{page.relative_to(root)}, block {number + 1}", text


def bad_code(flags):
    examples = [path.read_text(encoding="utf-8") for path in (root / "examples").rglob("*.c")]
    for where, text in pieces():
        if any(text in example for example in examples):
            continue  # meson compiles it
        whole = "int main(" in text
        source = text if whole else BEFORE + text + AFTER
        command = [*compiler, "-std=c11", "-fsyntax-only", "-Wall", "-Wextra", "-Werror",
                   "-Wno-unused-variable", "-Wno-unused-but-set-variable",
                   f"-I{root}/include", *flags, "-x", "c", "-"]
        done = subprocess.run(command, input=source, capture_output=True, text=True, timeout=60)
        if done.returncode != 0:
            yield f"{where}:\n{done.stderr[:600]}"


def commands(name):
    """Lines of shell blocks that call a program: page and words, without the comment."""
    for page in pages:
        for language, text in CODE.findall(page.read_text(encoding="utf-8")):
            if language != "sh":
                continue
            for line in text.replace("\\\n", " ").split("\n"):
                line = re.sub(r"\s#.*$", "", line).strip()
                match = re.match(rf"(?:chrt -f \d+ )?(?:build/)?{name}\s+(.*)$", line)
                if match:
                    yield str(page.relative_to(root)), match.group(1).split()


def bad_options(name, path):
    told = subprocess.run([str(path), "--help"], capture_output=True, text=True, timeout=30)
    text = told.stdout + told.stderr
    known = set(re.findall(r"--[a-z][a-z-]*", text)) | {"--help"}
    found = 0
    for page, words in commands(name):
        found += 1
        for word in words:
            option = word.partition("=")[0]
            if option.startswith("--") and option not in known:
                yield f"{page}: {name} has no {option}"
    if not found:
        yield f"no page has a command of {name}"


def bad_runs():
    """Commands that need neither hardware, nor a file, nor a person, for a moment."""
    for page, words in commands("hapode-run"):
        if "--scene" not in words or any(word.startswith(NEEDS_MORE) or word.endswith(FILE_ENDS)
                                         for word in words):
            continue
        words = [word for i, word in enumerate(words) if word != "--seconds" and
                 (i == 0 or words[i - 1] != "--seconds")]
        with tempfile.TemporaryDirectory() as folder:
            pathlib.Path(folder, "build").mkdir()
            done = subprocess.run([str(program), *words, "--lockstep", "--seconds", "0.05"],
                                  cwd=folder, capture_output=True, text=True, timeout=60)
        if done.returncode != 0:
            yield f"{page}: {' '.join(words)}: {done.stderr[:200]}"


def ode_flags():
    if not shutil.which("pkg-config"):
        return None
    done = subprocess.run(["pkg-config", "--cflags", "ode"], capture_output=True, text=True)
    return done.stdout.split() if done.returncode == 0 else None


point([] if len(pages) > 20 else [f"{len(pages)} found"], "there are pages")
point(list(bad_links()), "links lead somewhere")
point(list(bad_paths()), "files that are named are there")
point(list(bad_pages_in_code()), "pages that the code names are there")
point(list(bad_names()), "names of the API are there")
point(lost_pages("README.md"), "every page is reached from the README")
point(lost_pages("docs/README.md"), "every page is reached from the index")
ode = ode_flags()
if ode is None:
    skip("code compiles", "needs pkg-config and ode.pc")
else:
    point([] if len(list(pieces())) > 5 else ["no code found"], "there is code")
    point(list(bad_code(ode)), "code compiles")
point(list(bad_options("hapode-run", program)), "hapode-run has the options of the pages")
point(list(bad_options("hapode-bench", bench)), "hapode-bench has the options of the pages")
point(list(bad_runs()), "commands run")
print(f"1..{len(points)}")
sys.exit(0 if all(points) else 1)
