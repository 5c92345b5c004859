# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""hapode-run --html: what is in the page against the run's own trace, by a decoder of its own; what
Chromium shows of it, where that is. Argument: hapode-run."""
import base64
import csv
import json
import math
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib

program = str(pathlib.Path(sys.argv[1]).resolve())
PAGE_BYTES = 300000  # beside the poses
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


def run(*words):
    return subprocess.run([program, *words], capture_output=True, text=True, timeout=200)


def part_of(page, name):
    return re.search(rf'id="{name}"[^>]*>(.*?)</script>', page, re.S)[1]


def columns_of(page):
    scene = json.loads(part_of(page, "scene"))
    steps = zlib.decompress(base64.b64decode(part_of(page, "motion")))
    columns, place = [], 0
    for least, step, rows in scene["columns"]:
        values, now = [], 0
        for _ in range(rows):
            if step != 0:
                now = (now + struct.unpack_from("<H", steps, place)[0]) & 0xFFFF
                place += 2
            values.append(least + step * now)
        columns.append(values)
    return scene, columns, len(steps) - place


def key(text, name):
    return re.search(rf"^{name}: (.*)$", text, re.M)[1]


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


def nearest(rows, t, names, values):
    """How far the values are off the trace around t: three ticks, as a moment is between two."""
    middle = min(max(round(1000 * t), 0), len(rows) - 1)
    near = rows[max(middle - 3, 0):middle + 4]
    return min(math.dist([row[n] for n in names], values) for row in near)


def check_run(folder):
    page_path, trace = folder / "page.html", folder / "trace.csv"
    words = ["--scene", "row10", "--lockstep", "--seconds", "1.5"]
    plain = run(*words)
    done = run(*words, "--html", page_path, "--trace", trace)
    same = all(key(plain.stdout, k) == key(done.stdout, k) for k in ("trace_hash", "locks"))
    point(done.returncode or not same and plain.stdout + done.stdout + done.stderr,
          "the run is the same with and without a page")
    page = page_path.read_text(encoding="utf-8")
    loaded = re.findall(r"https?://|\bsrc=|@import|url\(|\bfetch\(|XMLHttp|import\(", page)
    point(loaded, "nothing is loaded from elsewhere")
    size = len(page) - len(part_of(page, "motion"))
    point(size > PAGE_BYTES and f"{size} bytes", "the page is small")

    scene, columns, left = columns_of(page)
    rows = rows_of(trace)
    hand = 8 * scene["bodies"]
    times = columns[-2]
    wrong = left != 0 or scene["bodies"] != 10 or len(scene["pointers"]) != 1
    wrong = wrong or not 70 <= scene["frames"] <= 76 or times != sorted(times)
    point(wrong and f"{left} bytes left, {scene['bodies']} bodies, {scene['frames']} frames",
          "50 moments a second, and no byte left")
    worst = [0.0, 0.0, 0.0]
    for i, t in enumerate(times):
        moment = [column[i] for column in columns[:-1]]
        worst[0] = max(worst[0], nearest(rows, t, ("px", "py", "pz"), moment[hand:hand + 3]))
        worst[1] = max(worst[1], nearest(rows, t, ("fx", "fy", "fz"), moment[hand + 10:hand + 13]))
        for body in (0, 4, 9):
            names = [f"b{body}_{axis}" for axis in "xyz"]
            worst[2] = max(worst[2], nearest(rows, t, names, moment[8 * body:8 * body + 3]))
    point((worst[0] > 2e-5 or worst[1] > 0.02 or worst[2] > 1e-4) and worst,
          "hand, force and bodies are those of the trace")
    strongest = max(math.hypot(row["fx"], row["fy"], row["fz"]) for row in rows)
    point(abs(max(columns[-1]) - strongest) > 1e-3 and f"{max(columns[-1])}, {strongest}",
          "the plot has the strongest force")
    return page_path, rows


def check_recording(folder):
    record, page_path = folder / "push.rec", folder / "played.html"
    made = run("--scene", "row10", "--no-realtime", "--seconds", "1", "--record", record)
    done = run("--play", record, "--html", page_path)
    if made.returncode or done.returncode:
        point(made.stderr + done.stderr, "a recording becomes a page")
        return
    scene, columns, _ = columns_of(page_path.read_text(encoding="utf-8"))
    moved = max(columns[0]) - min(columns[0])
    point((scene["frames"] < 20 or moved < 1e-3) and f"{scene['frames']} frames, {moved} m",
          "a recording becomes a page")


def check_refusals(folder):
    kept = folder / "kept.html"
    kept.write_text("kept")
    lost = run("--scene", "row10", "--lockstep", "--html", folder / "none" / "a.html")
    failing = run("--scene", "row10", "--lockstep", "--html", kept, "--trace", folder / "none/t")
    both = run("--scene", "row10", "--html", kept, "--trace", kept)
    window = run("--scene", "row10", "--view", "--html", kept)
    wrong = [done for done, code, words in (
        (lost, 1, "cannot be written: No such file"), (failing, 1, "--trace"),
        (both, 2, "same file"), (window, 2, "not with --view"))
        if done.returncode != code or words not in done.stderr]
    wrong += [] if kept.read_text() == "kept" else ["the file was changed"]
    wrong += list(folder.glob("*.part"))
    point(wrong, "what cannot be written is said, and no file is harmed")


def check_names(folder):
    name = "a<b>&'c.xml"
    (folder / name).write_text('<mujoco><worldbody><geom type="plane" size="1 1 1"/><body '
                               'pos="0 0 1"><freejoint/><geom type="sphere" size=".1"/></body>'
                               "</worldbody></mujoco>")
    done = subprocess.run([program, "--scene", name, "--lockstep", "--seconds", "0.2", "--html",
                           "named.html"], capture_output=True, text=True, cwd=folder, timeout=60)
    if "this build" in done.stderr:
        skip("names are text", "this build reads no scene files")
        return
    page = (folder / "named.html").read_text(encoding="utf-8") if done.returncode == 0 else ""
    point(("a&#60;b&#62;&#38;&#39;c" not in page or "a<b>" in page) and done.stderr + page[:300],
          "names are text")


def pixels_of(png):
    """Rows of a PNG with 8 bits a channel."""
    data, place, packed = png.read_bytes(), 8, b""
    while place < len(data):
        length, kind = struct.unpack_from(">I4s", data, place)
        body = data[place + 8:place + 8 + length]
        if kind == b"IHDR":
            width, height, _, colour = struct.unpack(">IIBB", body[:10])
        packed += body if kind == b"IDAT" else b""
        place += 12 + length
    deep = {2: 3, 6: 4}[colour]
    raw, rows, before = zlib.decompress(packed), [], bytearray(width * deep)
    for y in range(height):
        kind, line = raw[y * (width * deep + 1)], bytearray(
            raw[y * (width * deep + 1) + 1:(y + 1) * (width * deep + 1)])
        for i in range(len(line)):
            a, b = line[i - deep] if i >= deep else 0, before[i]
            c = before[i - deep] if i >= deep else 0
            guess = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
            line[i] = (line[i] + (0, a, b, (a + b) // 2, guess)[kind]) & 255
        rows.append([tuple(line[deep * x:deep * x + 3]) for x in range(width)])
        before = line
    return rows


def check_browser(folder, page, rows):
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    name = "a browser shows the moment that is asked for"
    if browser is None:
        skip(name, "there is no Chromium")
        return
    words = [browser, "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
             "--enable-unsafe-swiftshader", f"--user-data-dir={folder / 'browser'}",
             "--window-size=640,360", "--virtual-time-budget=5000"]
    where = f"{page.as_uri()}#t=1.2"
    told = subprocess.run([*words, "--dump-dom", where], capture_output=True, text=True,
                          timeout=120).stdout
    problem = re.search(r'id="problem"[^>]*>([^<]*)<', told)
    if problem is None or "needs WebGL" in problem[1]:
        skip(name, "Chromium has no WebGL 2 here")
        return
    clock = re.search(r'id="clock"[^>]*>([\d.]+) / ([\d.]+) s<', told)
    now = re.search(r'id="now"[^>]*>([\d.]+) N<', told)
    row = rows[1200]
    force = math.hypot(row["fx"], row["fy"], row["fz"])
    wrong = clock is None or now is None or clock[1] != "1.20"
    wrong = wrong or abs(float(now[1]) - force) > 0.15 or 'id="problem" hidden' not in told
    point(wrong and f"{clock and clock[0]} {now and now[0]} {force} {told[-600:]}", name)
    picture = folder / "page.png"
    subprocess.run([*words, f"--screenshot={picture}", where], capture_output=True, timeout=120)
    seen = [pixel for line in pixels_of(picture) for pixel in line]
    red = sum(r > 100 and g < 0.5 * r and b < 0.4 * r and g > 0.15 * r for r, g, b in seen)
    cubes = sum(r > 170 and 0.4 * r < g < 0.72 * r and b < 0.45 * r for r, g, b in seen)
    floor = sum(min(pixel) > 215 for pixel in seen)
    point((red < 20 or cubes < 1500 or floor < 20000) and f"{red} {cubes} {floor}",
          "hand, cubes and floor are in the picture")


with tempfile.TemporaryDirectory() as scratch:
    where_to = pathlib.Path(scratch)
    made_page, traced = check_run(where_to)
    check_recording(where_to)
    check_refusals(where_to)
    check_names(where_to)
    check_browser(where_to, made_page, traced)
print(f"1..{count}")
sys.exit(failed != 0)
