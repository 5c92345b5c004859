#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_dds_processes.py DDS_END CERTIFICATES: links over DDS between processes. Who joins with
which certificates, what can be read on the way, and that a process that is killed is missed.
Packets of the loopback interface are read by a socket of this test, which needs rights of root."""
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

DDS_END, CERTIFICATES = sys.argv[1:3]
WORLD = f"processes-{os.getpid()}"
TEXT = "a-text-that-is-nowhere-else"
JOIN_S = 10.0
POINT = 0


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


class End:
    """A process with one end; lines of its output as they come."""

    def __init__(self, role, how, seconds):
        self.lines = []
        self.process = subprocess.Popen(
            [DDS_END, role, WORLD, how, str(seconds)], stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True, env={**os.environ, "TEXT": f"{TEXT}-{role}"})
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        for line in self.process.stdout:
            self.lines.append(line.strip())

    def says(self, what, seconds=JOIN_S):
        end = time.monotonic() + seconds
        while time.monotonic() < end and what not in self.lines:
            time.sleep(0.02)
        return what in self.lines

    def end(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.reader.join(5.0)


class Packets:
    """What passes the loopback interface."""

    def __init__(self):
        self.all = bytearray()
        self.stopped = False
        self.socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3))
        self.socket.bind(("lo", 0))
        self.socket.settimeout(0.1)
        self.thread = threading.Thread(target=self.read)
        self.thread.start()

    def read(self):
        while not self.stopped and len(self.all) < 50_000_000:
            try:
                self.all += self.socket.recv(65536)
            except socket.timeout:
                pass

    def stop(self):
        self.stopped = True
        self.thread.join()
        self.socket.close()
        return bytes(self.all)


def pair(server_how, client_how, seconds=6.0):
    return End("serve", server_how, seconds), End("connect", client_how, seconds)


def talk_check(name, how, readable):
    """Two ends that join, talk both ways, and what a listener can read of it."""
    try:
        packets = Packets()
    except (AttributeError, PermissionError):
        packets = None
    ends = pair(how[0], how[1])
    joined = all(e.says("joined") for e in ends)
    heard = [ends[i].says(f"{kind} {TEXT}-{('connect', 'serve')[i]}", 3.0)
             for i in range(2) for kind in ("newest", "reliable")]
    report(joined and all(heard), f"{name}: both ends join, and hear each other",
           *([] if joined and all(heard) else [f"{e.lines[:3]}" for e in ends]))
    for e in ends:
        e.end()
    point = f"{name}: the text {'can' if readable else 'cannot'} be read on the way"
    if packets is None:
        skip(point, "packets can be read by root alone")
        return
    seen = packets.stop()
    report((TEXT.encode() in seen) == readable and len(seen) > 1000, point, f"{len(seen)} bytes")


def stranger_check(name, how):
    ends = pair(how[0], how[1], 4.0)
    for e in ends:
        e.process.wait()
        e.reader.join()
    said = ends[0].lines + ends[1].lines
    report("joined" not in said and not any(line.startswith("failed") for line in said), name,
           *said[:4])
    for e in ends:
        e.end()


def death_check():
    ends = pair("-", "-", 30.0)
    joined = all(e.says("joined") for e in ends)
    ends[1].process.send_signal(signal.SIGKILL)
    killed = time.monotonic()
    missed = ends[0].says("left", 10.0)
    report(joined and missed, "a client that is killed is missed",
           f"after {time.monotonic() - killed:.1f} s")
    again = End("connect", "-", 30.0)
    report(again.says("joined"), "another one joins after it")
    ends[0].process.send_signal(signal.SIGKILL)
    report(again.says("left", 10.0), "a server that is killed is missed")
    for e in (*ends, again):
        e.end()


def main():
    talk_check("without certificates", ("-", "-"), True)
    death_check()
    if not shutil.which("openssl"):
        skip("certificates", "no openssl to make them")
        print(f"1..{POINT}")
        return
    with tempfile.TemporaryDirectory() as folder:
        ours, others = os.path.join(folder, "ours"), os.path.join(folder, "others")
        subprocess.run([CERTIFICATES, ours, "server", "hand"], check=True, capture_output=True)
        subprocess.run([CERTIFICATES, others, "hand"], check=True, capture_output=True)
        server = os.path.join(ours, "server")
        talk_check("with certificates", (server, os.path.join(ours, "hand")), False)
        stranger_check("a hand with certificates of another authority does not join",
                       (server, os.path.join(others, "hand")))
        stranger_check("a hand without certificates does not join", (server, "insecure"))
        stranger_check("a hand with certificates does not join a world without",
                       ("insecure", server))
    print(f"1..{POINT}")


if not os.environ.get("HAPODE_LINK_DDS"):
    print("1..0 # SKIP built without Cyclone DDS (Debian: cyclonedds-dev cyclonedds-tools)")
else:
    main()
