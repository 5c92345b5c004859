#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""with_emulator.py [--todo POINT] EMULATOR [ARGUMENTS] -- HAPODE_RUN --check-device...: checks a
device while an emulator runs; {port} in the words becomes the port that it prints. Exit status:
that of the check. POINT is one that is known to be off, and must be.

Both live in real time. Where SCHED_FIFO is not allowed and the machine is busy, a tick that is
missed looks like a device whose poses and twists do not fit: then the check is one without force,
at rest."""
import os
import subprocess
import sys


def is_realtime():
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
        return True
    except OSError:
        return False


def check(words, todo):
    """Runs the check and passes its lines on."""
    run = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    off = 0
    for line in run.stdout:
        known = todo is not None and line.rstrip().endswith("- " + todo)
        off += line.startswith("not ok") and not known
        print(line.rstrip() + (" # TODO" if known else ""), flush=True)
    status = run.wait()
    return status if todo is None or off > 0 else 0


def main(words):
    todo = None
    if words[0] == "--todo":
        todo, words = words[1], words[2:]
    realtime = is_realtime()  # inherited by both
    if not realtime:
        print("# no SCHED_FIFO: without force", flush=True)
        words = words + ["--check-force", "0"]
    split = words.index("--")
    emulator = subprocess.Popen(words[:split], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                text=True)
    try:
        line = emulator.stdout.readline()
        if not line.startswith("port: "):
            print("1..0 # SKIP the emulator has no pseudo-terminal")
            return 0
        port = line.split(": ", 1)[1].strip()
        return check([word.replace("{port}", port) for word in words[split + 1:]], todo)
    finally:
        emulator.stdin.close()
        emulator.terminate()
        emulator.wait()


sys.exit(main(sys.argv[1:]))
