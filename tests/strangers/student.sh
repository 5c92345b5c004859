# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
# A student who writes VR in C. "#:" names the page of the next command.
apt-get install -y -q gcc libc6-dev meson ninja-build pkg-config libode-dev libccd-dev zlib1g-dev
apt-get install -y -q libopenxr-dev
#: README.md
meson setup build -Dtests=disabled -Dlibdir=lib && meson install -C build && ldconfig
cp examples/touch_a_cube.c .
#: README.md
cc touch_a_cube.c $(pkg-config --cflags --libs hapode) -o touch_a_cube
./touch_a_cube | grep -c 'hand feels' | grep -x 90
build/examples/frame_loop | grep 'gap'
XR_LOADER_DEBUG=none build/examples/vr_hand | grep 'no VR here'
