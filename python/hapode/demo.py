# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""python3 -m hapode.demo [PICTURE]: a hand pushes a row of cubes; what it feels is plotted."""
import sys

import matplotlib

if len(sys.argv) > 1:
    matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402: after the choice of what draws

import hapode  # noqa: E402


def main() -> None:
    with hapode.Scene.load("row10") as scene:
        with scene.session(drive="lockstep", trace_rows=2000) as session:
            session.add_hand()
            session.start()
            session.advance(2000)
            rows = session.trace()
            hash_text = session.trace_hash
    hand = rows["pointers"][:, 0]
    figure, (upper, lower) = plt.subplots(2, sharex=True)
    upper.plot(rows["t"], 1e3 * hand["position"][:, 0])
    upper.set_ylabel("hand along x [mm]")
    lower.plot(rows["t"], hand["force"][:, 0])
    lower.set(xlabel="time [s]", ylabel="force on the hand [N]")
    figure.suptitle("row10: ten cubes are pushed along a floor")
    if len(sys.argv) > 1:
        figure.savefig(sys.argv[1])
    else:
        plt.show()
    print(f"{len(rows)} ticks, strongest force {abs(hand['force']).max():.2f} N, "
          f"trace_hash {hash_text}")


if __name__ == "__main__":
    main()
