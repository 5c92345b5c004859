# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""python3 -m hapode.cost: what a step function of Python costs, and a pulled row of a trace."""
import statistics
import time

import hapode

STEPS, ROWS, TIMES = 2000, 100000, 5


def seconds_of(is_called: bool) -> float:
    """An empty world of 2000 steps; with a function of Python before each of them, or without."""
    with hapode.Scene() as scene:
        if is_called:
            scene.on_step(before=lambda step_s: None)
        with scene.session(drive="lockstep", physics_hz=500, haptic_hz=1000) as session:
            session.start()
            session.advance(100)
            begin = time.perf_counter()
            session.advance(2 * STEPS)
            return time.perf_counter() - begin


def callback_us() -> float:
    """us a call: the difference to a world without, the middle one of some runs."""
    return statistics.median(1e6 * (seconds_of(True) - seconds_of(False)) / STEPS
                             for _ in range(TIMES))


def row_us() -> float:
    """us a row of a trace that comes as one array."""
    with hapode.Scene() as scene, scene.session(drive="lockstep", trace_rows=ROWS) as session:
        session.start()
        session.advance(ROWS)
        begin = time.perf_counter()
        rows = session.trace()
        return 1e6 * (time.perf_counter() - begin) / len(rows)


def main() -> None:
    print(f"a step function: {callback_us():.1f} us a call")
    print(f"{ROWS} rows of a trace: {row_us():.2f} us a row, no object of Python for each")


if __name__ == "__main__":
    main()
