#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""test_doctor.py PROGRAM COMPILER...: hapode-run --doctor in a made-up /proc, /sys, /etc and /dev,
where each check is good once and bad once. Times are not judged, only what is said of them."""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

KEYS = ["kernel", "rtprio", "memlock", "memory_lock", "latency", "ode", "devices",
        "vendor_libraries", "udev_rules", "groups", "ports", "locale", "governor"]
RULES = "60-hapode-spidar.rules"
SOURCE = pathlib.Path(__file__).resolve().parent.parent
ALL_RULES = {path.name: path.parent.name for path in SOURCE.glob("plugins/*/*.rules")}
GOVERNOR = "/sys/devices/system/cpu/cpu%d/cpufreq/scaling_governor"
tests = 0
failed = 0


def check(good, text):
    global tests, failed
    tests += 1
    failed += not good
    print(f"{'ok' if good else 'not ok'} {tests} - {text}", flush=True)


def write(root, path, text):
    whole = root + path
    os.makedirs(os.path.dirname(whole), exist_ok=True)
    with open(whole, "w", encoding="utf-8") as file:
        file.write(text)


def limits(priority, locked):
    return (f"Limit                     Soft Limit           Hard Limit           Units\n"
            f"Max locked memory         {locked:<20} {locked:<20} bytes\n"
            f"Max realtime priority     {priority:<20} {priority:<20} \n")


def good_root(root):
    write(root, "/proc/version", "Linux version 6.1 SMP PREEMPT_RT\n")
    write(root, "/proc/self/limits", limits(95, "unlimited"))
    write(root, "/proc/self/status", "Name:\tx\nUid:\t7\t7\t7\t7\nGroups:\t4 20 46 \n")
    write(root, "/etc/group", "root:x:0:\ndialout:x:20:u\nplugdev:x:46:u\n")
    for name in ALL_RULES:
        write(root, "/etc/udev/rules.d/" + name, "")
    write(root, GOVERNOR % 0, "performance\n")
    os.makedirs(root + "/sys/class/tty/ttyUSB0")
    write(root, "/dev/ttyUSB0", "")


def bad_root(root):
    write(root, "/proc/version",
          'Linux "version" 6.1\\ \x1b[31m Größe \u2713 SMP PREEMPT_DYNAMIC\n')
    write(root, "/proc/self/limits", limits(0, 8192))
    write(root, "/proc/self/status", "Name:\tx\nUid:\t7\t7\t7\t7\nGroups:\t4 20 \n")
    write(root, "/etc/group", "root:x:0:\ndialout:x:20:u\nplugdev:x:46:u\n")
    write(root, "/usr/local/lib/udev/rules.d/" + RULES, "")
    write(root, GOVERNOR % 0, "performance\n")
    write(root, GOVERNOR % 1, "powersave\n")
    os.makedirs(root + "/sys/class/tty/ttyACM3")
    write(root, "/dev/ttyACM3", "")
    os.makedirs(root + "/proc/4711/fd")
    os.symlink("/dev/ttyACM3", root + "/proc/4711/fd/5")


def run(program, root, *options, **environment):
    env = dict(os.environ, HAPODE_DOCTOR_ROOT=root, LC_ALL="C")
    env.pop("HAPODE_SPIDAR_PORT", None)
    env.update(environment)
    env = {name: value for name, value in env.items() if value is not None}
    return subprocess.run([program, "--doctor", *options], capture_output=True, text=True, env=env,
                          check=False, timeout=60)


def findings(program, root, **environment):
    done = run(program, root, "--json", **environment)
    whole = json.loads(done.stdout)
    states = [c["state"] for c in whole["checks"]]
    order = ["ok", "warning", "problem"]
    check(whole["state"] == order[max(map(order.index, states))], "the state is that of the worst")
    check(done.returncode == (whole["state"] == "problem"), "exit 1 only for a problem")
    return {c["key"]: c for c in whole["checks"]}


def check_latency(found):
    late = found["latency"]
    p50, p999 = late["p50_us"], late["p999_us"]
    state = "ok" if p999 < 200 else "warning"  # a busy machine is no fault of it
    check(0 <= p50 <= p999, "half of the sleeps are less late than nearly all")
    check(abs(p999 - 200) < 0.1 or late["state"] == state,
          "the state of the latency is that of its figure")


def check_rules(program, folder):
    """Each file of rules that a plugin has is looked for by itself."""
    for name, device in ALL_RULES.items():
        root = f"{folder}/without_{device}"
        good_root(root)
        os.remove(root + "/etc/udev/rules.d/" + name)
        for other in set(ALL_RULES) - {name}:  # where udev does not look, beside the right ones
            write(root, "/usr/local/lib/udev/rules.d/" + other, "")
        write(root, "/usr/local/lib/libHD.so.3", "")
        found = findings(program, root, LD_LIBRARY_PATH=None)
        rules, libraries = found["udev_rules"], found["vendor_libraries"]
        check(rules["state"] == "warning" and f"{name} is not installed" in rules["text"] and
              rules["type"] == f"sudo cp plugins/{device}/{name} /etc/udev/rules.d/ && "
              "sudo udevadm control --reload", f"rules of {device} that are missing")
        check(all(f"/etc/udev/rules.d/{other}" in rules["text"] and other not in rules["type"]
                  for other in set(ALL_RULES) - {name}), "the others are there")
        check("LD_LIBRARY_PATH (not set)" in libraries["text"], "a path that is not set")
        check(libraries["state"] == "warning" and libraries["type"] == "sudo ldconfig" and
              "/usr/local/lib/libHD.so.3" in libraries["text"],
              "a library that ldconfig has not seen")


def check_absent_libraries(program, folder):
    """What the devices' own errors say is what the doctor says: names, and where they were."""
    root, libs = folder + "/empty", folder + "/usr/lib"
    good_root(root)
    os.makedirs(libs)
    found = findings(program, root, LD_LIBRARY_PATH=libs)["vendor_libraries"]
    check(f"LD_LIBRARY_PATH ({libs})" in found["text"] and found["text"].count(libs) == 1 and
          "/etc/ld.so.cache" in found["text"] and
          re.search(r", /(usr/)?lib(64|/)", found["text"]), "where libraries were looked for")
    for device in ("forcedimension", "openhaptics"):
        done = subprocess.run([program, "--scene", "row10", "--device", device], check=False,
                              capture_output=True, text=True, env=dict(os.environ, LC_ALL="C"),
                              timeout=60)
        names = re.search(device + r": no (.*?) in LD_LIBRARY_PATH", done.stderr)
        check(names and f"{device}: no {names[1]};" in found["text"],
              f"the names that {device} tries")


def check_library(program, folder, root, compiler, source, name, environment):
    """What a library in the way does to the findings; None without a compiler."""
    path = os.path.join(folder, name)
    write(folder, "/x.c", source)
    done = subprocess.run([*compiler, "-shared", "-fPIC", "-o", path, folder + "/x.c"], check=False)
    return findings(program, root, **environment) if done.returncode == 0 else None


def main(program, *compiler):
    with tempfile.TemporaryDirectory() as folder:
        good, bad = folder + "/good", folder + "/bad"
        good_root(good)
        bad_root(bad)
        found = findings(program, good)
        check(list(found) == KEYS, "the keys are those of docs/doctor.md, in their order")
        for key in KEYS:
            if key not in ("latency", "memory_lock"):  # of this machine
                check(found[key]["state"] == "ok" and not found[key]["type"], f"{key} is good")
        check_latency(found)
        libs = folder + "/libs"
        write(libs, "/libHD.so", "no library")
        found = findings(program, bad, LD_LIBRARY_PATH=libs, LC_ALL="xx_XX.UTF-8")
        for key, state in (("kernel", "warning"), ("rtprio", "problem"), ("memlock", "warning"),
                           ("vendor_libraries", "warning"), ("udev_rules", "warning"),
                           ("groups", "warning"), ("ports", "problem"), ("locale", "warning"),
                           ("governor", "warning")):
            check(found[key]["state"] == state and found[key]["type"], f"{key} is not good")
        check("/usr/local/lib/udev/rules.d/" + RULES in found["udev_rules"]["type"],
              "rules where udev does not look are copied from there")
        kernel = found["kernel"]["text"]
        check("\x1b[31m" in kernel and '"version" 6.1\\' in kernel,
              "quotes, backslashes and control bytes come through JSON")
        check("ttyACM3" in found["ports"]["text"] and "4711" in found["ports"]["text"],
              "the process that holds a port is named")
        check("Größe \u2713" in found["kernel"]["text"], "UTF-8 comes through JSON")
        text = run(program, bad).stdout
        check("\x1b" not in text and [x.split()[0] for x in text.splitlines() if x[0] != " "] ==
              KEYS, "as text: a line each, no control bytes")
        found = findings(program, good, HAPODE_SPIDAR_PORT="/dev/absent")
        check(found["ports"]["state"] == "problem", "a named port that is not there is a problem")
        found = check_library(program, folder, good, compiler,
                              "int dCheckConfiguration(const char *s) { (void)s; return 0; }",
                              "single.so", {"LD_PRELOAD": folder + "/single.so"})
        check(found is not None and found["ode"]["state"] == "problem",
              "ODE of single precision is a problem")
        os.remove(libs + "/libHD.so")
        found = check_library(program, folder, good, compiler, "int dhd_nothing;", "libs/libdhd.so",
                              {"LD_LIBRARY_PATH": libs})
        check(found is not None and "libdhd.so" in found["vendor_libraries"]["text"],
              "a vendor's library is found")
        check_rules(program, folder)
        check_absent_libraries(program, folder)
        comma = folder + "/locales"
        os.makedirs(comma)
        if shutil.which("localedef") and subprocess.run(
                ["localedef", "-i", "de_DE", "-f", "UTF-8", comma + "/de_DE.UTF-8"],
                capture_output=True, check=False).returncode == 0:
            found = findings(program, good, LOCPATH=comma, LC_ALL="de_DE.UTF-8")
            check(found["locale"]["state"] == "warning" and '","' in found["locale"]["text"],
                  "a decimal comma is a warning, and JSON has points")
        else:
            check(True, "a decimal comma # SKIP no localedef with de_DE")
        with open(bad + "/proc/version", "wb") as file:
            file.write(b"Linux \xff\xc3( \xed\xa0\x80 \xc0\xaf end\n")
        found = findings(program, bad)
        check("Linux ??( ??? ?? end" in found["kernel"]["text"], "bytes that are no text become ?")
        both = subprocess.run([program, "--doctor", "--scene", "row10"], capture_output=True,
                              check=False)
        check(both.returncode == 2, "--doctor beside another option is wrong usage")
        alone = subprocess.run([program, "--json"], capture_output=True, check=False)
        check(alone.returncode == 2, "--json alone is wrong usage")
    print(f"1..{tests}")
    return failed > 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
