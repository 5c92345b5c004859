#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_wire_witness.py ROOT WIRE_STREAM: reads streams of lib/wire by docs/wire.md alone, whose
tables of kinds it takes its cells from, and compares what they say with what they were made of.
Also: whether every member of the structs of lib/sync is in the codec's tables."""
import math
import os
import re
import struct
import subprocess
import sys

POINT = 0


def report(good, name, *notes):
    global POINT
    POINT += 1
    for note in notes:
        print(f"# {note}")
    print(f"{'ok' if good else 'not ok'} {POINT} - {name}")


# ---- docs/wire.md ----

def kinds_read(page):
    """By number: whether it is known, and its cells as (name, type, bits)."""
    kinds = {}
    for number, known, body in re.findall(r"^### Kind (\d+): [\w ]+?(, known)?\n\n(.*?)\n(?=\n)",
                                          page, re.M | re.S):
        cells = []
        for item in re.split(r"^- ", body, flags=re.M)[1:]:
            kind, members = " ".join(item.split()).split(": ", 1)
            kind, _, bits = kind.partition(" ")
            for member in members.split(", "):
                name, times = re.fullmatch(r"[`*]([^`*]+)[`*](?: x(\d+))?", member).groups()
                cells += [(name, kind, bits)] * int(times or 1)
        kinds[int(number)] = (known is not None, cells)
    return kinds


# ---- bytes ----

class Bytes:
    def __init__(self, data):
        self.data = data
        self.at = 0

    def byte(self):
        self.at += 1
        return self.data[self.at - 1]

    def number(self):
        value = shift = 0
        while True:
            byte = self.byte()
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    def folded(self):
        value = self.number()
        return -(value + 1) // 2 if value & 1 else value // 2

    def take(self, count):
        self.at += count
        return self.data[self.at - count:self.at]

    def left(self):
        return len(self.data) - self.at


def change_take(data, cells, before):
    now = list(before)
    at = 0
    while True:
        step = data.byte()
        if step == 0:
            return now
        at += step // 16
        for _ in range(step % 16):
            if cells[at][1] in ("exact", "open", "like", "single"):
                now[at] ^= data.number()
            else:
                now[at] = (now[at] + data.folded()) % 2**64
            at += 1


class Frame:
    """lists: by kind, labels in order. cells: by kind and label."""
    def __init__(self):
        self.lists = {}
        self.cells = {}


class Reader:
    def __init__(self, kinds, channel):
        self.kinds = kinds
        self.numbers = [k for k in sorted(kinds) if (k < 17) == (channel == 2)]
        self.known = {}
        self.frames = {0: Frame()}
        for kind in self.numbers:
            self.frames[0].lists[kind] = []
        self.parts = {}
        self.bases = set()

    def learn(self, data):
        assert data.byte() == 1 and data.byte() == 1
        data.number()
        while data.left() > 0:
            kind = data.number()
            label = data.number()
            cells = self.kinds[kind][1]
            assert self.kinds[kind][0]
            self.known[kind, label] = change_take(data, cells, [0] * len(cells))

    def directory(self, data, base):
        lists = {}
        changed = data.number()
        for place, kind in enumerate(self.numbers):
            lists[kind] = base.lists[kind]
            if changed >> place & 1:
                count = data.number()
                labels = []
                while len(labels) < count:
                    code = data.number()
                    if code & 1:
                        begin = data.number()
                        labels += base.lists[kind][begin:begin + code // 2]
                    else:
                        folded = code // 2
                        step = -(folded + 1) // 2 if folded & 1 else folded // 2
                        labels.append(step + (labels[-1] + 1 if labels else 0))
                lists[kind] = labels
        assert data.left() == 0
        return lists

    def datagram(self, data):
        """The frame, when it was the last part."""
        assert data.byte() == 1
        data.byte()
        flags, part, number, back = data.byte(), data.byte(), data.number(), data.number()
        data.number()
        data.number()
        whole, piece, first, count = (data.number() for _ in range(4))
        parts = self.parts.setdefault(number, [])
        assert part == len(parts)
        parts.append((data.take(piece), first, count, data))
        if not flags & 2:
            return None
        self.bases.add(number - back if back else 0)
        base = self.frames[number - back if back else 0]
        frame = Frame()
        directory = b"".join(piece for piece, _, _, _ in parts)
        assert len(directory) == whole
        frame.lists = self.directory(Bytes(directory), base)
        records = [(kind, label) for kind in self.numbers for label in frame.lists[kind]]
        for record in records:
            zeros = [0] * len(self.kinds[record[0]][1])
            frame.cells[record] = base.cells.get(record) or self.known.get(record) or zeros
        for _, at, count, rest in parts:
            for _ in range(count):
                at += rest.number()
                kind = records[at][0]
                frame.cells[records[at]] = change_take(rest, self.kinds[kind][1],
                                                       frame.cells[records[at]])
                at += 1
            assert rest.left() == 0
        self.frames[number] = frame
        return frame


# ---- values ----

def signed(cell):
    return cell - 2**64 if cell >= 2**63 else cell


def double(cell):
    return struct.unpack("<d", struct.pack("<Q", cell))[0]


class Values:
    """Of a record: by name, a list of numbers."""
    def __init__(self, reader, frame, kind, label):
        members = {}
        cells = reader.kinds[kind][1]
        raw = frame.cells[kind, label]
        names = [cell[0] for cell in cells]
        for at, (name, what, bits) in enumerate(cells):
            value = raw[at]
            if what in ("exact", "open"):
                value = double(value)
            elif what == "like":
                value = double(value ^ raw[at - names.count(name)])
            elif what == "single":
                value = struct.unpack("<f", struct.pack("<I", value))[0]
            elif what in ("fixed", "quat", "free"):
                value = signed(value) / 2.0**int(bits)
            elif what == "label":
                of = next(k for k in reader.kinds if KIND_NAMES[k] == bits.split(" ", 2)[-1])
                value = frame.lists[of].index(value - 1) if value else None
            members.setdefault(name, []).append(value)
        for name, values in members.items():
            if name.endswith("quat_wxyz"):
                length = math.sqrt(sum(v * v for v in values))
                members[name] = [v / length for v in values] if length else values
        self.members = members

    def __getitem__(self, name):
        return self.members[name]

    def one(self, name):
        return self.members[name][0]


KIND_NAMES = {}


def records(reader, frame, kind):
    return [Values(reader, frame, kind, label) for label in frame.lists[kind]]


def world_lines(reader, frame):
    m = records(reader, frame, 0)[0]
    yield ["model", m.one("number"), signed(m.one("state_ns")), m.one("time_scale")]
    for b in records(reader, frame, 3):
        yield (["body", b.one("slot"), b.one("generation"), b.one("flags"), b.one("birth")] +
               b["pose.position"] + b["pose.quat_wxyz"] + b["twist.linear"] + b["gain_taken"] +
               b["mass"] + b["max_angular_speed"])
    for c in records(reader, frame, 6):
        first = c.one("told.first") if c.one("told.count") else 0
        yield ["contact", c.one("slot"), c.one("body"), first] + c["normal_body"] + c["a"]
    for j in records(reader, frame, 7):
        yield (["joint", j.one("slot"), j.one("body_a"), j.one("limits[2].flags")] +
               j["place.turn"])
    for p in records(reader, frame, 13):
        yield (["pair", p.one("key"), p.one("geom_a"), p.one("geom_b")] + p["surface.mu"] +
               p["surface.slip"])
    for g in records(reader, frame, 12):
        hull = g.one("hull_first") if g.one("shape.kind") == 5 else 0
        yield (["geom", g.one("body"), hull, g.one("shape.hull_count")] + g["shape.half"] +
               g["pose.quat_wxyz"])
    yield ["end"]


def state_lines(reader, frame):
    s = records(reader, frame, 17)[0]
    yield (["state", s.one("tick"), signed(s.one("now_ns"))] + s["hand_impulse"] +
           s["owned_impulse"] + s["work.spent_ns"])
    for b in records(reader, frame, 20):
        if b.one("gained all"):
            b.members["gain"][:3] = s["hand_impulse"]
        yield (["moved", b.one("slot"), b.one("generation"), signed(b.one("owned_until_ns"))] +
               b["pose.position"] + b["pose.quat_wxyz"] + b["gain"] + b["owned_pose.quat_wxyz"])
    for c in records(reader, frame, 21):
        yield ["touch", c.one("slot"), c.one("touches")] + c["depth"] + c["force"]
    yield ["end"]


# Totals and what does not change have all bits.
EXACT = {"model": (3, 4), "body": (18, 26), "joint": (4, 8), "state": (3, 9), "moved": (11, 17),
         "pair": (4, 7)}


def differs(said, expected):
    if said[0] != expected[0] or len(said) != len(expected):
        return True
    low, high = EXACT.get(said[0], (0, 0))
    for at, (a, b) in enumerate(zip(said[1:], expected[1:]), 1):
        tolerance = 1.3e-4 if said[0] == "touch" and at > 3 else 6e-6
        if a is None or a != float(b) and (isinstance(a, int) or low <= at < high or
                                           not abs(a - float(b)) <= tolerance):
            return True
    return False


def stream_check(kinds, program, what, steps):
    channel = 2 if what == "world" else 3
    reader = Reader(kinds, channel)
    text = subprocess.run([program, what, str(steps), "30"], capture_output=True, text=True,
                          check=True)
    frame, expected, frames, lines, bad = None, [], 0, 0, []
    for line in text.stdout.splitlines():
        words = line.split()
        if words[0] == "M":
            data = Bytes(bytes.fromhex(words[2]))
            if words[1] == "1":
                reader.learn(data)
            else:
                frame = reader.datagram(data)
        elif words[1] != "end":
            expected.append(words[1:])
        else:
            said = list((world_lines if what == "world" else state_lines)(reader, frame))[:-1]
            if len(said) != len(expected):
                bad.append(f"{len(said)} records, not {len(expected)}")
            bad += [f"{b}: said {a}" for a, b in zip(said, expected) if differs(a, b)]
            frames += 1
            lines += len(expected)
            expected = []
    notes = [f"{frames} frames of {what}, {lines} records, {len(reader.bases)} bases"]
    good = not bad and frames == steps and len(reader.bases) > 3
    report(good, f"stream_{what}", *notes, *bad[:5])


# ---- the headers ----

def structs_read(root):
    """By name of the struct: members as (type, name, length of the array)."""
    structs = {}
    for folder in ("lib/sync", "lib/base", "lib/proximity", "include/hapode"):
        for name in sorted(os.listdir(os.path.join(root, folder))):
            if not name.endswith(".h"):
                continue
            with open(os.path.join(root, folder, name), encoding="utf-8") as f:
                text = re.sub(r"/\*.*?\*/", "", f.read(), flags=re.S)
            for body, of in re.findall(r"typedef struct \w+ {([^{}]*)} (\w+);", text):
                members = re.findall(r"([\w ]+?[ *]+)(\w+)((?:\[\w+\])*);", body)
                structs[of] = [(t.strip(), n, a) for t, n, a in members]
    return structs


def leaves(structs, of, prefix=""):
    for kind, name, array in structs[of]:
        kind = kind.replace("const ", "")
        if kind in structs:
            count = re.fullmatch(r"\[(\w+)\]", array)
            size = {"HAPI_JOINT_LIMITS": 3, "HAPI_MEASURED_ROWS": 6}
            places = [f"[{i}]" for i in range(size[count.group(1)])] if count else [""]
            for place in places:
                yield from leaves(structs, kind, f"{prefix}{name}{place}.")
        else:
            yield prefix + name


STRUCTS = {"hapi_model": [0], "hapi_near": [1], "hapi_triangle": [2], "hapi_model_body": [3, 4],
           "hapi_model_course": [5], "hapi_model_contact": [6], "hapi_model_joint": [7],
           "hapi_measured_joint": [8], "hapi_model_feel": [9], "hapi_near_body": [10],
           "hapi_near_geom": [12], "hapi_near_pair": [13], "hapi_near_tool": [14],
           "hapi_near_tool_pair": [15], "hapi_model_hand": [16], "hapi_state": [17],
           "hapi_state_pointer": [18], "hapi_tool_hull": [19], "hapi_state_body": [20],
           "hapi_state_contact": [21], "hapi_state_spring": [22], "hapi_state_joint": [23],
           "hapi_tool_side": [24]}


def members_check(root, members):
    structs = structs_read(root)
    missing, count = [], 0
    for of, kinds in STRUCTS.items():
        listed = {name for kind in kinds for name, _, _ in members[kind]}
        for leaf in leaves(structs, of):
            count += 1
            steps = leaf.split(".")
            if not any(".".join(steps[:i]) in listed for i in range(1, len(steps) + 1)):
                missing.append(f"{of}.{leaf} is not in the tables of lib/wire/kinds.c")
    report(not missing and count > 250, "no_member_is_forgotten", f"{count} members", *missing)


def page_check(kinds, members):
    """Whether the page has the cells that the codec has."""
    bad = []
    for kind, fields in members.items():
        said = [name for name, _, _ in kinds[kind][1]]
        cells = [name for name, count, _ in fields for _ in range(count)]
        if said[len(said) - len(cells):] != cells or len(said) - len(cells) > 2:
            bad.append(f"kind {kind}")
    report(not bad and len(kinds) == 25, "the_page_lists_all_cells", *bad)


def main():
    root, program = sys.argv[1:3]
    with open(os.path.join(root, "docs", "wire.md"), encoding="utf-8") as f:
        page = f.read()
    kinds = kinds_read(page)
    KIND_NAMES.update((int(n), name) for n, name in
                      re.findall(r"^### Kind (\d+): ([\w ]+?)(?:, known)?$", page, re.M))
    members = {}
    text = subprocess.run([program, "members"], capture_output=True, text=True, check=True).stdout
    for words in (line.split() for line in text.splitlines()):
        if words[0] == "F":
            members.setdefault(int(words[1]), []).append((words[2], int(words[3]), int(words[4])))
    page_check(kinds, members)
    members_check(root, members)
    stream_check(kinds, program, "world", 120)
    stream_check(kinds, program, "state", 120)
    print(f"1..{POINT}")


if __name__ == "__main__":
    main()
