#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_run_far.py HAPODE_RUN CERTIFICATES: hapode-run --serve and --connect as two processes of
this machine. The force on a resting hand is held against model single at 1 kHz in lockstep."""
import csv
import math
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time

RUN, CERTIFICATES = sys.argv[1:3]
# Rests on the box, 3 mm deep, and then pushes it to the side. Ticks are missed in real time, which
# the force of a push depends on; that of a rest does not.
HAND = ("virtual:path=0:0.025/0/0.1;1:0.025/0/0.1;1.5:0.025/0/0.057;3:0.025/0/0.057;"
        "3.2:0.025/0/0.1;3.4:-0.06/0/0.1;3.6:-0.06/0/0.03;4.5:0.02/0/0.03,start=-1")
BESIDE = "virtual:path=0:0.025/Y/0.1;1:0.025/Y/0.1;1.5:0.025/Y/0.057,start=-1"
SECONDS = 6
REST_S = (3.0, 3.9)
ERROR_MOST = 0.02
POINT = 0
FOLDER = tempfile.mkdtemp()


def report(good, name, *notes):
    global POINT
    POINT += 1
    for note in notes:
        print(f"# {note}")
    print(f"{'ok' if good else 'not ok'} {POINT} - {name}", flush=True)


def skip(name, reason):
    global POINT
    POINT += 1
    print(f"ok {POINT} - {name} # SKIP {reason}", flush=True)


class Run:
    """A hapode-run on its way."""

    def __init__(self, *arguments):
        self.out = tempfile.TemporaryFile(mode="w+", dir=FOLDER)
        self.err = tempfile.TemporaryFile(mode="w+", dir=FOLDER)
        self.process = subprocess.Popen([RUN, "--scene", "slide", "--no-realtime", *arguments],
                                        stdout=self.out, stderr=self.err)

    def said(self):
        self.err.seek(0)
        return self.err.read()

    def says(self, text, seconds=20.0):
        end = time.monotonic() + seconds
        while time.monotonic() < end and text not in self.said() and self.process.poll() is None:
            time.sleep(0.02)
        return text in self.said()

    def finish(self, number=None):
        if number is not None and self.process.poll() is None:
            self.process.send_signal(number)
        code = self.process.wait(60)
        self.out.seek(0)
        lines = (line.partition(": ") for line in self.out.read().splitlines())
        return code, {key: value for key, _, value in lines}


def world(case):
    return f"run-{os.getpid()}-{case}"


def forces(path):
    """N, the largest of the push, and the mean of the rest."""
    with open(path, newline="") as file:
        rows = [[float(row[k]) for k in ("t", "fx", "fy", "fz")] for row in csv.DictReader(file)]
    push = max(math.hypot(*row[1:]) for row in rows if row[0] > 4.5)
    rest = [row[3] for row in rows if REST_S[0] <= row[0] <= REST_S[1]]
    return push, sum(rest) / len(rest)


def pair_check(name, case, how, reference):
    server = Run("--serve", world(case), *how[0])
    trace = os.path.join(FOLDER, f"{case}.csv")
    hand = Run("--connect", world(case), "--seconds", str(SECONDS), "--device", HAND, "--trace",
               trace, *how[1])
    code, said = hand.finish()
    report(code == 0 and said.get("remote") == "connected" and said.get("remote_joins") == "1",
           f"{name}: the hand joins", *hand.said().splitlines()[-3:])
    report(said.get("faults") == "0" and said.get("remote_refused") == "0" and
           said.get("remote_turned_away") == "0", f"{name}: nothing is refused")
    push, rest = forces(trace)
    wanted = forces(reference)[1]
    point = f"{name}: the force is that of one process"
    if said.get("derated_ticks") != "0":
        skip(point, "the machine is busy: ticks came late, and the force was lowered")
    else:
        report(push > 1.0 and abs(rest - wanted) <= ERROR_MOST * wanted and wanted > 1.0, point,
               f"{push:.2f} N to the side, {rest:.3f} N at rest, {wanted:.3f} N in one "
               f"process; model age {said.get('model_age_s_max')} s, "
               f"{said.get('missed_ticks')} ticks missed")
    left = server.says("the hand has left")
    code, said = server.finish(signal.SIGINT)
    report(left and code == 0 and said.get("remote") == "serves" and
           said.get("remote_bounded") == "0" and said.get("remote_joins") == "1",
           f"{name}: the server hears that it has left, and ends with its summary",
           f"bounded {said.get('remote_bounded')}, exit {code}")


def two_hands_check(reference):
    """Both rest on the box, side by side: what one feels is what it feels alone."""
    server = Run("--serve", world("two"))
    traces = [os.path.join(FOLDER, f"two-{y}.csv") for y in ("left", "right")]
    hands = [Run("--connect", world("two"), "--seconds", str(SECONDS), "--device",
                 BESIDE.replace("Y", y), "--trace", trace)
             for y, trace in zip(("-0.01", "0.01"), traces)]
    ends = [hand.finish() for hand in hands]
    for hand, (code, said), trace in zip(hands, ends, traces):
        report(code == 0 and said.get("remote_joins") == "1" and said.get("faults") == "0" and
               said.get("remote_refused") == "0" and said.get("remote_turned_away") == "0",
               "one of two hands joins the world", *hand.said().splitlines()[-3:])
        rest, wanted = forces(trace)[1], forces(reference)[1]
        point = "and feels the box that both press on"
        if said.get("derated_ticks") != "0":
            skip(point, "the machine is busy: ticks came late, and the force was lowered")
        else:
            report(abs(rest - wanted) <= 2 * ERROR_MOST * wanted, point,
                   f"{rest:.3f} N, {wanted:.3f} N of one hand in one process")
    code, said = server.finish(signal.SIGINT)
    report(code == 0 and said.get("remote_joins") == "2" and said.get("remote_bounded") == "0",
           "the server has had two hands", f"joins {said.get('remote_joins')}, exit {code}")


def killed_server_check():
    server = Run("--serve", world("killed"))
    first = Run("--connect", world("killed"), "--seconds", "60")
    joined = first.says("the world has joined")
    server.finish(signal.SIGKILL)
    report(joined and first.says("the world has left", 15.0), "a server that is killed is missed")
    code, said = first.finish(signal.SIGINT)
    report(code == 0 and said.get("faults") in ("0", "1"), "and the hand's program ends as ever")


def refused_check():
    cases = (("--serve a --connect b", 2, "not with --connect"),
             ("--serve a --lockstep", 2, "--lockstep"),
             ("--serve a --device virtual", 2, "--connect"),
             ("--connect a --model single", 2, "model contact"),
             ("--connect a --view", 2, "no pictures yet"),
             ("--serve a --html a.html", 2, "no pictures yet"),
             ("--insecure", 2, "only with --serve or --connect"),
             ("--serve a*b", 2, "name of the world"),
             ("--serve a --peers 10.0.0.1", 2, "certificates"),
             ("--serve a --insecure --interface none0 --dds-domain 71", 1, "interface"),
             ("--connect a --certificates /nowhere --dds-domain 72", 2, "identity_ca.pem"))
    for arguments, code, text in cases:
        run = Run(*arguments.split(), "--seconds", "0.1")
        got, _ = run.finish()
        report(got == code and text in run.said(), f"refused: {arguments}",
               *run.said().splitlines()[:1])


def main():
    reference = os.path.join(FOLDER, "reference.csv")
    subprocess.run([RUN, "--scene", "slide", "--lockstep", "--model", "single", "--iterations",
                    "1000", "--seconds", str(SECONDS), "--device", HAND, "--trace", reference],
                   check=True, capture_output=True)
    pair_check("on one machine", "plain", ((), ()), reference)
    two_hands_check(reference)
    killed_server_check()
    refused_check()
    alone = os.path.join(FOLDER, "alone", "hapode-run")
    os.mkdir(os.path.dirname(alone))
    shutil.copy(RUN, alone)
    run = subprocess.run([alone, "--serve", "a", "--seconds", "0.1"], capture_output=True,
                         text=True)
    if run.returncode == 0:
        skip("without the module", "it is installed on this machine")
    else:
        report(run.returncode == 2 and "hapode-link-dds" in run.stderr,
               "without the module a text says what to install", *run.stderr.splitlines()[:1])
    if not shutil.which("openssl"):
        skip("with certificates", "no openssl to make them")
        return
    keys = os.path.join(FOLDER, "keys")
    subprocess.run([CERTIFICATES, keys, "server", "hand"], check=True, capture_output=True)
    how = [("--certificates", os.path.join(keys, who), "--interface", "127.0.0.1", "--peers",
            "127.0.0.1") for who in ("server", "hand")]
    pair_check("with certificates", "keys", how, reference)


if not os.environ.get("HAPODE_LINK_DDS"):
    print("1..0 # SKIP built without Cyclone DDS (Debian: cyclonedds-dev cyclonedds-tools)")
else:
    try:
        main()
    finally:
        shutil.rmtree(FOLDER)
    print(f"1..{POINT}")
