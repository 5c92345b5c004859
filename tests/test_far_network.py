#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_far_network.py FAR_END TUN_WAY: world and hand in two processes, in two network namespaces
with delay, jitter and loss between them. The force is as near to that of model single as in one
process, within half a point. Needs rights of root."""
import math
import os
import shutil
import subprocess
import sys
import time

FAR_END, TUN_WAY = sys.argv[1:3]
SPACES = [f"hapode{os.getpid()}{end}" for end in "ab"]
ADDRESSES = ["10.77.67.1", "10.77.67.2"]
POINTS = 0.005
# How long, with the two seconds of waiting.
SCENES = {"slide": 4.0, "stack": 3.5, "row10": 4.0, "door": 4.0, "hit": 4.0}
NEAR, LOSSY, FAR = (0, 0, 0.0, 0.1), (50, 20, 0.05, 0.25), (200, 0, 0.0, 0.5)
# ms, ms, share; s of looking ahead
WAYS = {"slide": (NEAR, LOSSY, FAR)} | dict.fromkeys(("stack", "row10", "door", "hit"), (LOSSY,))
QUICK = {"slide": (FAR,), "row10": (LOSSY,), "hit": (LOSSY,)}
POINT = 0


def report(good, name, *notes):
    global POINT
    POINT += 1
    for note in notes:
        print(f"# {note}")
    print(f"{'ok' if good else 'not ok'} {POINT} - {name}", flush=True)


def ip(*words, **options):
    return subprocess.run(["ip", *words], check=True, capture_output=True, **options)


class Network:
    """Two namespaces and the way between them."""

    def __init__(self, delay, jitter, loss):
        for space in SPACES:
            ip("netns", "add", space)
        self.way = subprocess.Popen([TUN_WAY, *SPACES, str(delay), str(jitter), str(loss)],
                                    stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.way.stdout.readline().strip() == "ready"
        for space, own, other in zip(SPACES, ADDRESSES, reversed(ADDRESSES)):
            ip("-n", space, "addr", "add", own, "peer", other, "dev", "way0")
            ip("-n", space, "link", "set", "way0", "up", "mtu", "1500")
            ip("-n", space, "link", "set", "lo", "up")

    def end(self):
        self.way.stdin.close()
        self.way.wait()
        Network.clear()

    @staticmethod
    def clear():
        for space in SPACES:
            subprocess.run(["ip", "netns", "del", space], capture_output=True)


def forces_of(text):
    rows = [line.split() for line in text.splitlines() if line[:1].isdigit()]
    return {int(row[0]): [float(x) for x in row[1:]] for row in rows}


def error_of(felt, reference):
    square = sum(x * x for force in reference.values() for x in force)
    difference = sum((x - y) ** 2 for tick, force in reference.items()
                     for x, y in zip(force, felt.get(tick, (0.0, 0.0, 0.0))))
    return math.sqrt(difference / square)


def alone(role, scene):
    run = subprocess.run([FAR_END, role, scene, str(SCENES[scene]), "0"], check=True,
                         capture_output=True, text=True)
    return forces_of(run.stdout)


def start(end, role, scene, look_ahead):
    seconds = SCENES[scene] + (20.0 if role == "serve" else 0.0)
    words = ["ip", "netns", "exec", SPACES[end], FAR_END, role, scene, str(seconds),
             str(look_ahead), f"network-{os.getpid()}", ADDRESSES[end], ADDRESSES[1 - end]]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def way_check(scene, way, reference, beside):
    delay, jitter, loss, look_ahead = way
    network = Network(delay, jitter, loss)
    try:
        server = start(0, "serve", scene, look_ahead)
        time.sleep(1.0)
        hand = start(1, "connect", scene, look_ahead)
        text, wrong = hand.communicate(timeout=120)
        server_text, server_wrong = server.communicate(timeout=120)
    finally:
        network.end()
    said = (text.splitlines() or [wrong])[-1]
    server_said = (server_text.splitlines() or [server_wrong])[-1]
    error = error_of(forces_of(text), reference)
    name = f"{scene}, {delay} ms, jitter {jitter} ms, loss {100 * loss:g} %"
    report(error <= beside + POINTS, f"{name}: the force is as in one process",
           f"{100 * error:.3f} % off, {100 * beside:.3f} % in one process", said, server_said)
    report("joins 1 refused 0" in said and "bounded 0" in server_said,
           f"{name}: nothing is refused, and nothing bounded")


def main():
    if not os.environ.get("HAPODE_LINK_DDS"):
        return "built without Cyclone DDS (Debian: cyclonedds-dev cyclonedds-tools)"
    if os.geteuid() != 0 or not os.access("/dev/net/tun", os.W_OK) or not shutil.which("ip"):
        return "network namespaces and tun devices need rights of root, /dev/net/tun and ip"
    try:
        Network(0, 0, 0.0).end()
    except (subprocess.CalledProcessError, AssertionError, OSError) as problem:
        Network.clear()
        return f"no network namespaces here: {problem}"
    for scene, ways in (WAYS if "long" in sys.argv[3:] else QUICK).items():
        reference = alone("reference", scene)
        beside = error_of(alone("beside", scene), reference)
        for way in ways:
            way_check(scene, way, reference, beside)
    return None


reason = main()
print(f"1..0 # SKIP {reason}" if reason else f"1..{POINT}")
