# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""A terminal for programs that look whether they have one."""
import os
import pty
import re


def run(command, environment):
    """All that the program writes to its terminal, and its exit code."""
    child, terminal = pty.fork()
    if child == 0:
        os.execvpe(command[0], command, environment)
    said = b""
    while True:
        try:
            part = os.read(terminal, 4096)
        except OSError:  # nobody holds the other side any more
            part = b""
        if not part:
            break
        said += part
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    return said.decode(errors="replace").replace("\r\n", "\n"), os.waitstatus_to_exitcode(status)


def left(said):
    """What stands on the terminal in the end: a line that is written over is gone."""
    lines = []
    for line in said.split("\n"):
        shown = ""
        for part in line.split("\r"):
            text, *cleared = re.split("\033\\[K", part)
            shown = text + ("" if cleared else shown[len(text):])
            shown += "".join(cleared)
        lines.append(shown)
    return "\n".join(lines)
