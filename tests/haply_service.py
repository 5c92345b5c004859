#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""haply_service.py [--arms ID,ID] [--grips ID,ID] [--swing M]: pretends to be
Haply's service for Inverse3 arms and VerseGrips, by its published messages, with the standard
library alone. It prints "port: N", takes commands as lines and answers each with a line.

A client gets the whole state when it connects, and the next one for each command. A force stays
until the next one, whatever becomes of the client: the worst that a service can do."""
import argparse
import asyncio
import base64
import hashlib
import json
import math
import os
import struct
import sys
import time

GUID = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
TEXT, BINARY, CLOSE, PING, PONG = 1, 2, 8, 9, 10


def frame(opcode, payload, last=True):
    """Of a server: not masked."""
    head = bytes([opcode | (0x80 if last else 0)])
    size = len(payload)
    if size < 126:
        head += bytes([size])
    elif size < 65536:
        head += struct.pack("!BH", 126, size)
    else:
        head += struct.pack("!BQ", 127, size)
    return head + payload


class Arm:
    def __init__(self, name):
        self.name = name
        self.force = [0.0, 0.0, 0.0]
        self.centre = [0.0, 0.0, 0.0]
        self.forces = 0
        self.pushes = 0


class Service:
    def __init__(self, options):
        self.arms = {name: Arm(name) for name in options.arms.split(",") if name}
        self.grips = [name for name in options.grips.split(",") if name]
        self.swing = options.swing
        self.turn = [1.0, 0.0, 0.0, 0.0]
        self.buttons = 0
        self.fault = ""
        self.late = 0.0
        self.pongs = 0
        self.bad = 0  # commands that are not the protocol's, frames without a mask
        self.clients = set()
        self.tasks = set()
        self.server = None
        self.port = 0

    # ---- what is sent ----

    def position(self, arm):
        phase = 2 * math.pi * time.monotonic()
        place = list(arm.centre)
        speed = [0.0, 0.0, 0.0]
        place[1] += self.swing * math.sin(phase)
        speed[1] = 2 * math.pi * self.swing * math.cos(phase)
        return place, speed

    def state(self, first):
        arms = []
        for arm in self.arms.values():
            place, speed = self.position(arm)
            entry = {"device_id": arm.name, "state": {
                "cursor_position": dict(zip("xyz", place)),
                "cursor_velocity": dict(zip("xyz", speed)),
                "mode": "force", "transform": {"scale": [1, 1, 1]}}}
            if first:
                entry["config"] = {"handedness": "right", "type": "inverse3"}
            arms.append(entry)
        w, x, y, z = self.turn
        grips = [{"device_id": name, "state": {
            "orientation": {"x": x, "y": y, "z": z, "w": w},
            "buttons": {key: bool(self.buttons >> i & 1) for i, key in enumerate("abc")},
            "battery_level": 0.5}} for name in self.grips]
        return {"inverse3": arms, "wireless_verse_grip": grips}

    def text(self, first):
        state = self.state(first)
        arms = state["inverse3"]
        if self.fault == "unplugged":
            state["inverse3"] = []
        if self.fault == "nan" and arms:
            arms[0]["state"]["cursor_position"]["x"] = float("nan")
        if self.fault == "huge_number" and arms:
            return json.dumps(state).replace('"cursor_position": {"x": ',
                                             '"cursor_position": {"x": 1e999, "w": ', 1)
        if self.fault == "null" and arms:
            arms[0]["state"]["cursor_position"]["x"] = None
        if self.fault == "no_grip":
            state["wireless_verse_grip"] = []
        if self.fault == "grip_not_unit" and self.grips:
            state["wireless_verse_grip"][0]["state"]["orientation"]["w"] = 3.0
        if self.fault == "old":
            return json.dumps({"devices": arms})
        if self.fault == "garbage":
            return '{"inverse3": [{"device_id": "' + "x" * 10
        text = json.dumps(state)
        if self.fault == "comma":  # a locale with a decimal comma
            text = text.replace(".", ",")
        if self.fault == "deep":
            text = '{"a":' + "[" * 1000 + "]" * 1000 + "," + text[1:]
        if self.fault == "huge":
            text = '{"pad": "' + "y" * 1000000 + '",' + text[1:]
        return text

    async def send_state(self, writer, first=False):
        if self.fault == "silent":
            return
        payload = self.text(first).encode()
        if self.fault == "bytes":
            writer.write(os.urandom(64))
        elif self.fault == "split":
            await self.send_split(writer, payload)
        elif self.fault == "binary":
            writer.write(frame(BINARY, payload))
        elif self.fault == "not_utf8":
            writer.write(frame(TEXT, b'{"a": "\xff\xfe"}'))
        else:
            writer.write(frame(TEXT, payload))
        await writer.drain()

    async def send_late(self, writer):
        await asyncio.sleep(self.late)
        try:
            await self.send_state(writer)
        except ConnectionError:
            pass

    async def send_split(self, writer, payload):
        """Three fragments, a ping between them, byte by byte at their begins."""
        third = len(payload) // 3
        whole = (frame(TEXT, payload[:third], False) + frame(0, payload[third:2 * third], False) +
                 frame(PING, b"between") + frame(0, payload[2 * third:]))
        for byte in whole[:3]:
            writer.write(bytes([byte]))
            await writer.drain()
            await asyncio.sleep(0)
        writer.write(whole[3:])

    # ---- what comes ----

    async def handshake(self, reader, writer):
        request = await reader.readuntil(b"\r\n\r\n")
        key = ""
        for line in request.decode().split("\r\n"):
            if line.lower().startswith("sec-websocket-key:"):
                key = line.split(":", 1)[1].strip()
        if self.fault == "http":
            writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")
            return False
        if self.fault == "mute":
            await asyncio.sleep(5)
            return False
        if self.fault == "wrong_key":
            key = "another"
        accept = base64.b64encode(hashlib.sha1((key + GUID).encode()).digest()).decode()
        writer.write(("HTTP/1.1 101 Switching Protocols\r\nupgrade: WebSocket\r\n"
                      f"Connection: Upgrade\r\nSec-WebSocket-Accept: {accept}\r\n\r\n").encode())
        return self.fault != "wrong_key"

    async def receive(self, reader):
        head = await reader.readexactly(2)
        size = head[1] & 0x7f
        if size == 126:
            size = struct.unpack("!H", await reader.readexactly(2))[0]
        elif size == 127:
            size = struct.unpack("!Q", await reader.readexactly(8))[0]
        if head[1] & 0x80 == 0:
            self.bad += 1
            return CLOSE, b""
        mask = await reader.readexactly(4)
        payload = bytes(b ^ mask[i % 4] for i, b in enumerate(await reader.readexactly(size)))
        return head[0] & 15, payload

    def command(self, payload):
        try:
            for entry in json.loads(payload)["inverse3"]:
                values = entry["commands"]["set_cursor_force"]["values"]
                arm = self.arms[entry["device_id"]]
                arm.force = [float(values[axis]) for axis in "xyz"]
                arm.forces += 1
                arm.pushes += any(arm.force)
        except (ValueError, KeyError, TypeError):
            self.bad += 1

    async def client(self, reader, writer):
        self.clients.add(writer)
        try:
            if not await self.handshake(reader, writer):
                return
            await self.send_state(writer, first=True)
            while True:
                opcode, payload = await self.receive(reader)
                if opcode == CLOSE:
                    return
                if opcode == PONG:
                    self.pongs += 1
                if opcode == TEXT:
                    self.command(payload)
                    if self.late > 0.0:  # forces are taken meanwhile
                        later = asyncio.create_task(self.send_late(writer))
                        self.tasks.add(later)
                        later.add_done_callback(self.tasks.discard)
                        continue
                    await asyncio.sleep(0.0005)
                    await self.send_state(writer)
        except (ConnectionError, asyncio.IncompleteReadError, asyncio.CancelledError):
            pass
        finally:
            self.clients.discard(writer)
            writer.close()

    # ---- life ----

    async def listen(self):
        self.server = await asyncio.start_server(self.client, "127.0.0.1", self.port)
        self.port = self.server.sockets[0].getsockname()[1]

    async def leave(self):
        self.server.close()
        for writer in list(self.clients):
            writer.transport.abort()
        await self.server.wait_closed()

    async def obey(self, words):
        """One line; its answer."""
        name, values = words[0], words[1:]
        if name == "state":
            arm = self.arms[values[0]] if values else next(iter(self.arms.values()))
            x, y, z = arm.force
            return (f"state force={x}/{y}/{z} forces={arm.forces} pushes={arm.pushes} "
                    f"clients={len(self.clients)} pongs={self.pongs} bad={self.bad}")
        if name == "fault":
            self.fault = values[0] if values else ""
        elif name == "late":
            self.late = float(values[0])
        elif name == "at":
            next(iter(self.arms.values())).centre = [float(value) for value in values]
        elif name == "turn":
            self.turn = [float(value) for value in values]
        elif name == "buttons":
            self.buttons = int(values[0])
        elif name == "stall":  # nobody runs meanwhile
            time.sleep(float(values[0]))
        elif name == "ping":
            for writer in self.clients:
                writer.write(frame(PING, b"are you there"))
        elif name == "close":
            for writer in self.clients:
                writer.write(frame(CLOSE, struct.pack("!H", 1001)))
        elif name == "gone":
            await self.leave()
        elif name == "back":
            await self.listen()
        else:
            return "unknown"
        return "done"


async def main(options):
    service = Service(options)
    await service.listen()
    print(f"port: {service.port}", flush=True)
    lines = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
    while True:
        line = (await lines.readline()).decode()
        if not line or line.strip() == "quit":
            return
        print(await service.obey(line.split()), flush=True)


parser = argparse.ArgumentParser()
parser.add_argument("--arms", default="04BA")
parser.add_argument("--grips", default="")
parser.add_argument("--swing", type=float, default=0.0)
asyncio.run(main(parser.parse_args()))
