#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""count_points.py LOGS CODE: sums up the test points of a "meson test" run that ended with CODE.

The points of a program come from meson's JUnit log. That log does not show a program that timed
out, was killed after its last point or broke its plan (meson 1.0.1), so how each program ended
comes from the JSON log."""
import glob
import json
import os
import re
import sys
import xml.etree.ElementTree as et

OUTPUT_LINES_MAX = 100
SLOWEST = 10


def read_points(folder):
    """{program: [(point, "pass" | "fail" | "skip", reason)]}"""
    points = {}
    for path in glob.glob(os.path.join(folder, "testlog*.junit.xml")):
        for suite in et.parse(path).getroot().iter("testsuite"):
            program = suite.get("name").partition(".")[2]  # "project.program" when it has points
            if not program:
                continue
            rows = points.setdefault(program, [])
            for case in suite.iter("testcase"):
                if case.find("failure") is not None or case.find("error") is not None:
                    fate = "fail"
                else:
                    fate = "pass" if case.find("skipped") is None else "skip"
                rows.append((case.get("name"), fate, case.findtext("system-out", "")))
    return points


def read_programs(folder):
    for path in glob.glob(os.path.join(folder, "testlog*.json")):
        with open(path, encoding="utf-8") as f:
            for line in f:
                yield json.loads(line)


def judge(program, rows):
    """The program's points, with one more failed point where its end calls for it."""
    result, code = program["result"], program["returncode"]
    stdout = program.get("stdout") or ""
    plan = re.search(r"^1\.\.0\b(?:\s*#\s*skip\S*)?\s*(.*)", stdout, re.M | re.I)
    failed = any(fate == "fail" for _, fate, _ in rows)
    if result in ("TIMEOUT", "INTERRUPT"):
        return rows + [(f"the program ended: {result.lower()}", "fail", "")]
    if result in ("OK", "EXPECTEDFAIL"):
        return rows or [("", "pass", "")]
    if result == "SKIP":
        if rows:
            return rows
        if code == 77 or plan:
            return [("", "skip", plan.group(1) if plan else stdout.strip())]
        return [("the program printed no test point", "fail", "")]
    if code < 0 or code >= 128:
        return rows + [(f"the program was killed (exit status {code})", "fail", "")]
    if not failed:
        return rows + [(f"the program failed: {result.lower()}, exit status {code}", "fail", "")]
    return rows


def output_of(program):
    """What a failed program printed, without its passed points."""
    text = (program.get("stdout") or "") + (program.get("stderr") or "")
    lines = [line for line in text.splitlines() if line and not re.match(r"ok\b", line)]
    if len(lines) > OUTPUT_LINES_MAX:
        lines = lines[:OUTPUT_LINES_MAX] + [f"... {len(lines) - OUTPUT_LINES_MAX} more lines"]
    return lines


def main(folder, code):
    points = read_points(folder)
    count = {"pass": 0, "fail": 0, "skip": 0}
    skipped = []
    failed = []
    programs = list(read_programs(folder))
    for program in programs:
        rows = judge(program, points.get(program["name"], []))
        bad = []
        for name, fate, reason in rows:
            count[fate] += 1
            title = program["name"] + (": " + name if name else "")
            if fate == "skip":
                skipped.append(f"skipped: {title}: {reason or 'no reason given'}")
            elif fate == "fail":
                bad.append(f"failed: {title}")
        if bad:
            failed += ["", *bad, *("  " + line for line in output_of(program))]
    if code != 0 and count["fail"] == 0:
        failed += ["", f"failed: meson test ended with {code}"]
        count["fail"] += 1
    slowest = sorted(programs, key=lambda p: -p["duration"])[:SLOWEST]
    slow = [f"slowest: {p['duration']:6.1f} s  {p['name']}" for p in slowest]
    print("\n".join(["", *skipped, *failed, "", *slow, ""]))
    print(f"{count['pass']} passed, {count['fail']} failed")
    return 0 if count["pass"] > 0 and count["fail"] == 0 else 1


sys.exit(main(sys.argv[1], int(sys.argv[2])))
