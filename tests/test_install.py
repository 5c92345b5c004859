# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""What an installation gives: staged by DESTDIR, then moved elsewhere, the README's program builds
against it with nothing but pkg-config, by gcc and by clang, and with nothing but CMake, shared and
static, and runs. Uninstalled, nothing is left. Arguments: source root, build folder, meson's
b_sanitize, prefix, libdir."""
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
    return problem or run_program(program, "" if static else library)


def run_program(program, library):
    out, problem = run([program], env=dict(os.environ, LD_LIBRARY_PATH=library))
    return problem or ("" if "hand feels" in out else "it printed:\n" + out)


def configured(stage, folder, *wanted):
    """CMake's set-up of the consumer, with what find_package gets after the name."""
    return run(["cmake", "-S", os.path.join(root, "tests", "consumer"), "-B", folder,
                "-DCMAKE_PREFIX_PATH=" + stage + prefix, "-DWANTED=" + ";".join(wanted),
                "-DPROGRAM=" + os.path.join(root, "examples", "touch_a_cube.c")])[1]


def build_by_cmake(stage, static, *wanted):
    folder = tempfile.mkdtemp(dir=stage)
    problem = configured(stage, folder, *wanted) or run(["cmake", "--build", folder])[1]
    program = os.path.join(folder, "consumer")
    needs, problem = ("", problem) if problem else run(["readelf", "-d", program])
    if not problem and ("libhapode.so.1]" in needs) == static:
        problem = "the wrong library is linked\n" + needs
    return problem or run_program(program, "")


def check_cmake(stage, kinds):
    if not shutil.which("cmake"):
        skip("CMake", "needs cmake")
        return
    version = "0.0.0"
    for line in pathlib.Path(root, "meson.build").read_text().splitlines():
        if line.strip().startswith("version: '"):
            version = line.split("'")[1]
            break
    major, minor, patch = version.split(".")
    point(build_by_cmake(stage, kinds == ["static"]), "the README's program by CMake")
    for kind in ("shared", "static"):
        if kind in kinds:
            point(build_by_cmake(stage, kind == "static", "COMPONENTS", kind),
                  f"the README's program by CMake, {kind}")
        else:
            refused(stage, f"CMake: {kind} is not installed", "libhapode", "COMPONENTS", kind)
    good = tempfile.mkdtemp(dir=stage)
    point(configured(stage, good, f"{major}.{minor}"), "CMake: this minor version is found")
    for other in (f"{major}.{int(minor) + 1}", f"{int(major) + 1}.0",
                  f"{major}.{minor}.{int(patch) + 1}"):
        refused(stage, f"CMake: {other} is not found", version, other)
    refused(stage, "CMake: a component that does not exist", "shared or static", "COMPONENTS",
            "other")


def refused(stage, name, reason, *wanted):
    said = configured(stage, tempfile.mkdtemp(dir=stage), *wanted)
    point("" if reason in said else "it said: " + (said or "nothing, it was found"), name)


def check_uninstall(stage, log):
    """As somebody does who changed their mind; meson's own log of what it installed is the list."""
    point("" if log.exists() else "no log of the installation", "the installation is logged")
    point(run(["ninja", "-C", build, "uninstall"])[1], "uninstalls")
    point("\n".join(str(path) for path in pathlib.Path(stage).rglob("*")), "nothing is left")


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
              *source.glob("examples/**/*.[ch]")]
    names = [path.relative_to(source) for path in wanted]
    return "\n".join(str(name) for name in names if not (home / name).is_file())


def python_folder(stage):
    """Where the package of Python is, if that is a place in which Python looks."""
    places = [str(p.parent.parent)[len(stage):]
              for p in pathlib.Path(stage).rglob("hapode/__init__.py")]
    out, problem = run(["/usr/bin/python3", "-c", "import site; print(*site.getsitepackages())"])
    if problem or not places or prefix not in ("/usr", "/usr/local"):
        return None
    return "" if places[0] in out.split() else f"{places[0]} is none of {out}"


def check_python_folders():
    """By Debian's Python, whatever prefix this build has; as meson names them, with a slash."""
    python = "/usr/bin/python3"
    out, problem = run([python, "-c", "import site; print(*site.getsitepackages())"])
    if problem or "/usr/lib/python3/dist-packages" not in out:
        skip("the folder of Python's packages below a prefix", "not Debian's Python")
        return
    local = next((place for place in out.split() if place.startswith("/usr/local/")), "")
    for prefix, wanted in {"/usr": "/usr/lib/python3/dist-packages", "/usr/local": local,
                           "/opt/x": "/opt/x/lib/python3/dist-packages"}.items():
        out, problem = run([python, "-B", os.path.join(root, "python", "install_dir.py"),
                            f"{prefix}/lib/python3/dist-packages/", prefix])
        point(problem or ("" if out.strip() == wanted else out),
              f"the folder of Python's packages below {prefix}")


def main(stage, moved):
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
    placed = python_folder(stage)
    if placed is None:
        skip("Python finds the package", "no package, or another prefix than /usr and /usr/local")
    else:
        point(placed, "Python finds the package")
    check_python_folders()
    out, problem = run([stage + prefix + "/bin/hapode-run", "--version"],
                       env=dict(os.environ, LD_LIBRARY_PATH=str(library)))
    point(problem or ("" if out.startswith("hapode") else out), "hapode-run says its version")
    kinds = [k for k, name in (("shared", "libhapode.so"), ("static", "libhapode.a"))
             if (library / name).exists()]
    point("" if kinds else "no library", "a library")
    check_kinds(stage, kinds)
    # Another place, and nothing at the first one: the package files must not remember it.
    shutil.copytree(stage, moved, symlinks=True)
    away = pathlib.Path(stage + prefix)
    away.rename(str(away) + ".away")
    point(build_and_run(moved, "cc", "shared" not in kinds), "moved: the README's program by cc")
    check_cmake(moved, kinds)
    pathlib.Path(str(away) + ".away").rename(away)


if sanitize != "none":
    print("1..0 # SKIP a sanitizer's library does not link into an ordinary program")
    sys.exit(0)
for tool in ("meson", "pkg-config", "ldd"):
    if not shutil.which(tool):
        print(f"1..0 # SKIP needs {tool}")
        sys.exit(0)
log_path = pathlib.Path(build, "meson-logs", "install-log.txt")
log_before = log_path.read_bytes() if log_path.exists() else None
try:
    with tempfile.TemporaryDirectory() as folder:
        first, second = os.path.join(folder, "first"), os.path.join(folder, "second")
        os.mkdir(first)
        main(first, second)
    with tempfile.TemporaryDirectory() as folder:
        log_path.unlink(missing_ok=True)
        run(["meson", "install", "-C", build, "--no-rebuild", "--quiet", "--destdir", folder])
        check_uninstall(folder, log_path)
finally:
    # the log of the developer's own installation, which they may want to undo
    if log_before is not None:
        log_path.write_bytes(log_before)
    else:
        log_path.unlink(missing_ok=True)
print(f"1..{count}")
sys.exit(1 if failed else 0)
