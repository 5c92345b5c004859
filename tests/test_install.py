# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""What an installation gives: staged by DESTDIR, the README's program builds against it with
nothing but pkg-config, by gcc and by clang, shared and static, and runs. Arguments: source root,
build folder, meson's b_sanitize, prefix, libdir."""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

root, build, sanitize, prefix, libdir = sys.argv[1:6]
count = failed = 0


def point(problem, name):
    global count, failed
    count += 1
    failed += bool(problem)
    if problem:
        print("# " + problem.strip().replace("\n", "\n# "))
    print(f"{'not ok' if problem else 'ok'} {count} - {name}", flush=True)


def skip(name, reason):
    global count
    count += 1
    print(f"ok {count} - {name} # SKIP {reason}", flush=True)


def run(command, **more):
    """Nothing when it succeeds, else what it said."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, **more)
    said = done.stderr + done.stdout
    return done.stdout, "" if done.returncode == 0 else said or f"exit status {done.returncode}"


def flags(stage, *options):
    home = stage + prefix
    environment = dict(os.environ, PKG_CONFIG_PATH=f"{home}/{libdir}/pkgconfig")
    out, problem = run(["pkg-config", f"--define-variable=prefix={home}", *options, "hapode"],
                       env=environment)
    return out.split(), problem


def build_and_run(stage, compiler, static):
    wanted = ["--static"] if static else []
    words, problem = flags(stage, *wanted, "--cflags", "--libs")
    program = os.path.join(stage, "program")
    # the order of the words matters to a static linker: the program comes first
    problem = problem or run([compiler, "-std=c11", "-Wall", "-Wextra", "-Werror", "-o", program,
                              os.path.join(root, "examples", "touch_a_cube.c"), *words])[1]
    library = os.path.join(stage + prefix, libdir)
    if not problem and static:
        needs, problem = run(["ldd", program])
        if not problem and "libhapode" in needs:
            problem = "it needs the shared library\n" + needs
    out, failure = ("", problem) if problem else run(
        [program], env=dict(os.environ, LD_LIBRARY_PATH="" if static else library))
    return failure or ("" if "hand feels" in out else "it printed:\n" + out)


def only(stage, library, keep):
    """Takes the other kind of library away, so that the linker has no choice."""
    for path in pathlib.Path(stage + prefix, libdir).glob("libhapode*"):
        if (".so" in path.name) != (keep == "shared"):
            path.rename(os.path.join(library, path.name))


def check_kinds(stage, kinds):
    for kind in kinds:
        away = tempfile.mkdtemp(dir=stage)
        only(stage, away, kind)
        for compiler in ("gcc", "clang"):
            compiler = next((c for c in (compiler, compiler + "-14") if shutil.which(c)), compiler)
            name = f"the README's program, {compiler}, {kind}"
            if not shutil.which(compiler):
                skip(name, f"needs {compiler}")
            else:
                point(build_and_run(stage, compiler, kind == "static"), name)
        for path in pathlib.Path(away).iterdir():
            path.rename(os.path.join(stage + prefix, libdir, path.name))


def missing_docs(stage):
    """What a reader would miss, by the same paths as in the tree: links between pages hold."""
    home = pathlib.Path(stage + prefix, "share", "doc", "hapode")
    source = pathlib.Path(root)
    wanted = [*source.glob("*.md"), *source.glob("docs/**/*.md"), *source.glob("docs/**/*.svg"),
              *source.glob("examples/*.c")]
    names = [path.relative_to(source) for path in wanted]
    return "\n".join(str(name) for name in names if not (home / name).is_file())


def main(stage):
    point(run(["meson", "install", "-C", build, "--no-rebuild", "--quiet", "--destdir", stage])[1],
          "installs to DESTDIR")
    library = pathlib.Path(stage + prefix, libdir)
    outside = [str(p) for p in pathlib.Path(stage).rglob("*")
               if p.is_file() and not str(p).startswith(stage + prefix) and
               not str(p).startswith((stage + "/etc/", stage + "/lib/udev"))]
    point("\n".join(outside), "everything is below the prefix")
    headers = {p.name for p in pathlib.Path(root, "include/hapode").glob("*.h")}
    there = {p.name for p in pathlib.Path(stage + prefix, "include/hapode").glob("*.h")}
    point("\n".join(sorted(headers - there)), "all public headers")
    point(missing_docs(stage), "README, pages and examples")
    out, problem = run([stage + prefix + "/bin/hapode-run", "--version"],
                       env=dict(os.environ, LD_LIBRARY_PATH=str(library)))
    point(problem or ("" if out.startswith("hapode") else out), "hapode-run says its version")
    kinds = [k for k, name in (("shared", "libhapode.so"), ("static", "libhapode.a"))
             if (library / name).exists()]
    point("" if kinds else "no library", "a library")
    check_kinds(stage, kinds)


if sanitize != "none":
    print("1..0 # SKIP a sanitizer's library does not link into an ordinary program")
    sys.exit(0)
for tool in ("meson", "pkg-config", "ldd"):
    if not shutil.which(tool):
        print(f"1..0 # SKIP needs {tool}")
        sys.exit(0)
with tempfile.TemporaryDirectory() as folder:
    main(folder)
print(f"1..{count}")
sys.exit(1 if failed else 0)
