# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""docs/writing-a-device.md at its word: the skeleton, copied and built as written there with the
flags of pkg-config, conforms; the points of the check are those of the page.
Arguments: source root, folder of hapode-uninstalled.pc, hapode-run, compiler."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

root, packages, program = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
page = (root / "docs/writing-a-device.md").read_text(encoding="utf-8")
points = []


def point(good, name, note=""):
    points.append(good)
    if note and not good:
        print("# " + note.replace("\n", "\n# "))
    print(f"{'ok' if good else 'not ok'} {len(points)} - {name}")


if not shutil.which("pkg-config"):
    print("1..0 # SKIP needs pkg-config")
    sys.exit(0)
commands = re.search(r"```sh\n(.*?)```", page, re.S).group(1).strip().split("\n")
point(len(commands) == 3 and commands[0].startswith("cc ") and "--check-device" in commands[1],
      "the page says how to build and check", "\n".join(commands))
with tempfile.TemporaryDirectory() as folder:
    for path in (root / "plugins/skeleton").glob("*.[ch]"):
        shutil.copy(path, folder)
    env = {**os.environ, "PKG_CONFIG_PATH": str(packages), "PATH":
           f"{program.parent}:{os.environ['PATH']}"}

    def run(command):
        return subprocess.run(command, shell=True, cwd=folder, env=env, capture_output=True,
                              text=True, timeout=100)
    cc = " ".join(sys.argv[4:])
    built = run(commands[0].replace("cc ", cc + " -Werror ", 1))
    point(built.returncode == 0, "it builds without a warning", built.stderr)
    symbols = run("nm -D --undefined-only libskeleton.so").stdout
    point("hap_" not in symbols and "hapi_" not in symbols, "it needs no symbol of the library",
          symbols)
    checked = run(commands[1] + " --check-wait 0 --check-limits")
    point(checked.returncode == 0, "it conforms", checked.stdout + checked.stderr)
    names = re.findall(r"^ok \d+ - (\w+)", checked.stdout, re.M)
    table = re.findall(r"^\| `(\w+)` \|", page[page.index("| point |"):], re.M)
    point(names == table, "the page lists the points of the check in their order",
          f"{names}\n{table}")
    felt = run(commands[2].replace("--seconds 5", "--seconds 0.5"))
    point(felt.returncode == 0 and "faults: 0" in felt.stdout, "a scene runs with it",
          felt.stdout + felt.stderr)
    refused = run(commands[2].replace("limit=2", "limit=200"))
    point(refused.returncode == 2 and "at most 3 newtons" in refused.stderr,
          "arguments that it does not understand are said", refused.stderr)
print(f"1..{len(points)}")
sys.exit(0 if all(points) else 1)
