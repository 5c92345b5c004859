#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""sizes.py ROOT: functions and files stay small (style.md rule 3), measured by universal-ctags."""
import json
import shutil
import statistics
import subprocess
import sys

import lint

FUNCTION_MAX = 60
FUNCTION_USUAL = 45  # 95 % are below; tests may be longer
PARAMETERS_MAX = 6
FILE_MAX = 900
HARNESS_MAX = 120  # tests/tap.h


def is_universal():
    if not shutil.which("ctags"):
        return False
    version = subprocess.run(["ctags", "--version"], capture_output=True, text=True).stdout
    features = subprocess.run(["ctags", "--list-features"], capture_output=True, text=True).stdout
    return "Universal Ctags" in version and "json" in features


def functions(root, files):
    command = ["ctags", "--options=NONE", "--languages=C", "--langmap=C:.c.h", "--kinds-C=f",
               "-D", "HAP_BEGIN_DECLS=", "-D", "HAP_END_DECLS=", "-I", "HAP_API,HAP_NODISCARD",
               "--fields=+neS", "--output-format=json", "--sort=no", "-f", "-", "-L", "-"]
    run = subprocess.run(command, cwd=root, input="\n".join(files) + "\n", capture_output=True,
                         text=True, check=True)
    return [json.loads(line) for line in run.stdout.splitlines()]


def parameter_count(signature):
    inner = signature.strip()[1:-1].strip()
    if inner in ("", "void"):
        return 0
    depth = 0
    commas = 0
    for c in inner:
        depth += (c in "([{") - (c in ")]}")
        commas += c == "," and depth == 0
    return commas + 1


def main(root):
    if not is_universal():
        lint.skip_all("needs universal-ctags with json")
    tap = lint.Tap()
    files = lint.code_files(root)
    found = functions(root, files)
    rows = []  # lines, where, path
    crowded = []
    unmeasured = []
    for tag in found:
        where = f"{tag['path']}:{tag['line']}: {tag['name']}"
        if "end" not in tag:
            unmeasured.append(f"{where}: ctags does not see its end")
            continue
        rows.append((tag["end"] - tag["line"] + 1, where, tag["path"]))
        parameters = parameter_count(tag.get("signature", "()"))
        if parameters > PARAMETERS_MAX:
            crowded.append(f"{where}: {parameters} parameters")
    tap.point("functions are found and measured",
              unmeasured if rows else ["ctags finds no function"])

    tap.point(f"no function is over {FUNCTION_MAX} lines",
              [f"{where}: {lines} lines" for lines, where, _ in rows if lines > FUNCTION_MAX])

    ours = [row for row in rows if not row[2].startswith("tests/")]
    long = sorted((row for row in ours if row[0] >= FUNCTION_USUAL), reverse=True)
    if ours:
        print(f"# median {statistics.median(row[0] for row in ours):g} lines, "
              f"{len(ours)} functions without tests, {len(long)} of {FUNCTION_USUAL} or more")
    tap.point(f"95 % of the functions are below {FUNCTION_USUAL} lines",
              [f"{where}: {lines} lines" for lines, where, _ in long]
              if len(long) > 0.05 * len(ours) else [])

    tap.point(f"no function has over {PARAMETERS_MAX} parameters", crowded)

    lengths = {name: len(lint.read(root, name).splitlines()) for name in files}
    tap.point(f"no file is over {FILE_MAX} lines",
              [f"{name}: {n} lines" for name, n in lengths.items() if n > FILE_MAX])
    harness = lengths.get("tests/tap.h", 0)
    tap.point(f"tests/tap.h is at most {HARNESS_MAX} lines",
              [f"tests/tap.h: {harness} lines"] if harness > HARNESS_MAX else [])
    tap.done()


main(sys.argv[1])
