# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""Manual pages say what --help says, both ways; bash completes what the programs take. Arguments:
source root, hapode-run, hapode-bench, spidar-emulator."""
import pathlib
import re
import shutil
import subprocess
import sys

root = pathlib.Path(sys.argv[1])
programs = {pathlib.Path(word).name: pathlib.Path(word).resolve() for word in sys.argv[2:]}
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
count = failed = 0


def point(problem, name):
    global count, failed
    count += 1
    failed += bool(problem)
    if problem:
        print("# " + str(problem).strip().replace("\n", "\n# "))
    print(f"{'not ok' if problem else 'ok'} {count} - {name}", flush=True)


def skip(name, reason):
    global count
    count += 1
    print(f"ok {count} - {name} # SKIP {reason}", flush=True)


def said(program, option):
    return subprocess.run([programs[program], option], capture_output=True, text=True,
                          timeout=60).stdout


def page(program):
    return (root / "tools" / "man" / (program + ".1")).read_text()


def entries(program, section):
    """First words of the entries of one section of the page."""
    body = re.search(rf"^\.SH {section}\n(.*?)(?=^\.SH|\Z)", page(program), re.S | re.M)
    plain = body[1].replace("\\-", "-") if body else ""
    return set(re.findall(r"^\.TP\n\.B (\S+)", plain, re.M))


def compare(program, helped, written, what):
    """Both ways, and at least something: two empty sets agree too."""
    problem = [f"{word}: not on the page" for word in sorted(helped - written)]
    problem += [f"{word}: not in --help" for word in sorted(written - helped)]
    point("\n".join(problem) if helped else "--help has none", f"{program}.1: {what}")


def check_pages():
    for program in programs:
        compare(program, set(OPTION.findall(said(program, "--help"))) - {"--help"},
                entries(program, "OPTIONS") - {"--help"}, "options")
    bench = set(re.findall(r"^  ([a-z][a-z0-9]*) {2,}", said("hapode-bench", "--help"), re.M))
    compare("hapode-bench", bench, entries("hapode-bench", "MEASUREMENTS"), "measurements")
    commands = said("spidar-emulator", "--help").split("\ncommands:\n")[-1]
    compare("spidar-emulator", set(re.findall(r"^([a-z|]+)", commands, re.M)),
            entries("spidar-emulator", "COMMANDS"), "commands")
    for program in programs:
        if not shutil.which("groff"):
            skip(f"{program}.1 is good roff", "needs groff")
            continue
        done = subprocess.run(["groff", "-man", "-ww", "-z"], input=page(program), text=True,
                              capture_output=True, timeout=60)
        point(done.stderr, f"{program}.1 is good roff")


def complete(program, before, word):
    """What the function offers after the word before, called as bash calls it."""
    script = (f'source "{root}/tools/completion/hapode.bash"; _hapode "$1" "$2" "$3"; '
              'printf "%s\\n" "${COMPREPLY[@]}"')
    done = subprocess.run(["bash", "--norc", "-c", script, "bash", str(programs[program]), word,
                           before or str(programs[program])],
                          capture_output=True, text=True, timeout=60)
    return set(done.stdout.split()), done.stderr


def offered(program, before, word, wanted, name):
    there, complaint = complete(program, before, word)
    point(complaint or ("" if there == wanted and wanted else
                        f"offered {sorted(there)}, wanted {sorted(wanted)}"), "bash: " + name)


def check_completion():
    if not shutil.which("bash"):
        skip("bash", "needs bash")
        return
    for program in programs:
        options = set(OPTION.findall(said(program, "--help")))
        offered(program, "x", "--", options, f"options of {program}")
    listed = said("hapode-run", "--list")
    # the lists as a person reads them: names at two spaces, until the next heading
    for option, heading, one in (("--scene", "scenes", "row10"), ("--model", "models", "contact"),
                                 ("--device", "devices", "virtual")):
        body = listed.split(heading + ":\n")[1].split("\n\n")[0]
        names = {line[2:].split()[0].split("[")[0] for line in body.splitlines()
                 if line[2:3].strip()}
        offered("hapode-run", option, "", names, heading)
        offered("hapode-run", option, one, {one}, f"{heading}: the one that begins so")
    offered("hapode-bench", "", "fig", {"fig5", "fig6", "fig7"}, "measurements")


check_pages()
check_completion()
print(f"1..{count}")
sys.exit(1 if failed else 0)
