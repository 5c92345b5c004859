# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
# A researcher with a question about methods, in Python. "#:" names the page of the next command.
apt-get install -y -q gcc libc6-dev meson ninja-build pkg-config libode-dev libccd-dev zlib1g-dev
apt-get install -y -q python3-cffi python3-numpy python3-matplotlib
#: README.md
meson setup build -Dtests=disabled -Dlibdir=lib && meson install -C build && ldconfig
meson devenv -C build python3 -m hapode.demo "$PWD/push.png" | grep 'strongest force'
head -c 4 push.png | grep -a PNG
# The first program of the page, without a display.
sed -n '/^```python$/,/^```$/p' docs/python.md | sed '1d;/^```$/,$d' > first.py
sed -i 's/plt.show()/plt.savefig("first.png")/' first.py
MPLBACKEND=agg python3 first.py
head -c 4 first.png | grep -a PNG
#: README.md
hapode-run --scene slide --model accelerance --physics-hz 20 | grep peak_force
hapode-run --scene row10 --trace trace.csv --lockstep && head -3 trace.csv
