# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
# A laboratory with a device: a SPIDAR, here its emulator, and a board of their own, here the
# skeleton's toy. "#:" names the page of the next command.
apt-get install -y -q gcc libc6-dev meson ninja-build pkg-config libode-dev libccd-dev zlib1g-dev
apt-get install -y -q libserialport-dev procps
#: README.md
meson setup build -Dtests=disabled -Dlibdir=lib && meson install -C build && ldconfig
#: docs/doctor.md
hapode-run --doctor || true
#: docs/spidar.md
hapode-run --list | grep spidar
#: docs/spidar.md
spidar-emulator --link /tmp/spidar &
emulator=$!
sleep 2
#: docs/spidar.md
hapode-run --scene row10 --seconds 6 --device spidar:/tmp/spidar | grep peak_force
kill "$emulator"
mkdir mine && cp /usr/local/share/hapode/skeleton/* mine && cd mine
#: docs/writing-a-device.md
cc -Wall -shared -fPIC $(pkg-config --cflags hapode) skeleton.c toy_hardware.c -lm -o libskeleton.so
#: docs/writing-a-device.md
hapode-run --check-device module:$PWD/libskeleton.so --check-wait 0
#: docs/writing-a-device.md
hapode-run --scene slide --seconds 5 --device module:$PWD/libskeleton.so,limit=2 | grep peak_force
rt='chrt -f 60' && $rt true || rt= # for a busy machine, as the page says
#: docs/writing-a-device.md
$rt hapode-run --identify mydevice.txt --device module:$PWD/libskeleton.so
#: docs/writing-a-device.md
hapode-run --scene slide --device module:$PWD/libskeleton.so --identity mydevice.txt
