#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""run_fuzzer.py ROOT BUILD NAME [SECONDS] [--merge]: libFuzzer with the address and the undefined
behaviour sanitizer on the fuzzer NAME, from its corpus on, 60 s when SECONDS is not given.

Builds the fuzzers with clang in BUILD, which is made when it is not there. What fuzzing finds stays
in BUILD/found; with --merge the files of it that reach new code go to the corpus in ROOT. An input
that fails is left in BUILD as NAME-crash-HASH."""
import glob
import os
import re
import shutil
import subprocess
import sys
import tempfile

INPUT_MAX = 600  # bytes; small inputs reach as much and go faster
INPUT_MAX_OF = {
    "scene_file": 2000,  # a robot of two bodies has 900
    "recording": 1200,  # what it was made with takes 350 of them
    "spidar_model": 2500,  # a whole file of eight strings has 2000
    "wire": 4000,  # a whole world of a few bodies has 3000
}
SECONDS = 60


def skip(reason):
    print(f"1..0 # SKIP {reason}")
    sys.exit(0)


def can_fuzz(clang):
    with tempfile.TemporaryDirectory() as folder:
        source = os.path.join(folder, "empty.c")
        with open(source, "w", encoding="utf-8") as f:
            f.write("#include <stddef.h>\nint LLVMFuzzerTestOneInput(const unsigned char *d, "
                    "size_t n) { (void)d; (void)n; return 0; }\n")
        command = [clang, "-fsanitize=fuzzer,address,undefined", source, "-o",
                   os.path.join(folder, "empty")]
        return subprocess.run(command, capture_output=True).returncode == 0


def find_clang():
    for name in ["clang"] + [f"clang-{version}" for version in range(25, 10, -1)]:
        if shutil.which(name) and can_fuzz(name):
            return name
    return None


def build(root, folder, name):
    """What the compiler said when it failed, else None."""
    if not os.path.isfile(os.path.join(folder, "build.ninja")):
        clang = find_clang()
        if clang is None:
            skip("needs clang with libFuzzer and sanitizers (Debian: clang libclang-rt-14-dev)")
        setup = ["meson", "setup", folder, root, "--buildtype=debugoptimized", "-Dfuzz=true",
                 "-Db_sanitize=address,undefined", "-Db_lundef=false", "-Dlint=disabled",
                 "-Ddefault_library=static"]
        run = subprocess.run(setup, env={**os.environ, "CC": clang}, capture_output=True, text=True)
        if run.returncode != 0:
            return run.stdout + run.stderr
    run = subprocess.run(["ninja", "-C", folder, f"tests/fuzz/fuzz_{name}"], capture_output=True,
                         text=True)
    return run.stdout + run.stderr if run.returncode != 0 else None


def fuzz(command, corpora, seconds, here, folder, name):
    """What to say, and whether it went well."""
    length = INPUT_MAX_OF.get(name, INPUT_MAX)
    command = command + [f"-max_total_time={seconds}", f"-max_len={length}", "-timeout=20",
                         "-print_final_stats=1", "-verbosity=1",
                         f"-artifact_prefix={os.path.join(folder, name)}-"]
    dictionary = os.path.join(here, name + ".dict")
    if os.path.isfile(dictionary):
        command.append("-dict=" + dictionary)
    run = subprocess.run(command + corpora, capture_output=True, text=True, errors="replace")
    runs = re.search(r"number_of_executed_units: (\d+)", run.stderr)
    covered = re.findall(r"cov: (\d+)", run.stderr)
    said = (f"{runs.group(1) if runs else 'no'} inputs in {seconds} s, "
            f"{covered[-1] if covered else 'no'} edges")
    if run.returncode == 0 and runs and int(runs.group(1)) > 0:
        return said, True
    return said + "\n" + run.stderr[-6000:], False


def main(root, folder, name, seconds, merge):
    here = os.path.join(root, "tests", "fuzz")
    corpus = os.path.join(here, "corpus", name)
    found = os.path.join(folder, "found", name)
    output = build(root, folder, name)
    if output is None:
        os.makedirs(found, exist_ok=True)
        command = [os.path.join(folder, "tests", "fuzz", "fuzz_" + name)]
        said, good = fuzz(command, [found, corpus], seconds, here, folder, name)
        if good and merge:
            # by edges alone, not by how often each was taken, and with one file where it does for
            # several: a few files instead of hundreds
            subprocess.run(command + ["-set_cover_merge=1", "-use_counters=0", corpus, found],
                           check=True)
    else:
        said, good = output, False
    print("# " + said.replace("\n", "\n# "))
    for path in [] if good else glob.glob(os.path.join(folder, name + "-*")):
        print("# there is " + path)
    print(f"{'ok' if good else 'not ok'} 1 - {name}: no input does harm\n1..1")
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    words = [word for word in sys.argv[1:] if word != "--merge"]
    main(*words[:3], int(words[3]) if len(words) > 3 else SECONDS, "--merge" in sys.argv)
