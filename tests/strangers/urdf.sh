# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
# Somebody with a URDF and a mouse. "#:" names the page of the next command.
apt-get install -y -q gcc libc6-dev meson ninja-build pkg-config libode-dev libccd-dev zlib1g-dev
apt-get install -y -q libexpat1-dev libqhull-dev libglfw3-dev libepoxy-dev libegl-dev libpng-dev
apt-get install -y -q libgl1-mesa-dri libegl1 xvfb xauth xdotool
#: README.md
meson setup build -Dtests=disabled -Dlibdir=lib && meson install -C build && ldconfig
cat > robot.urdf <<'URDF'
<robot name="lever">
  <link name="base">
    <collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision>
  </link>
  <link name="arm">
    <inertial><mass value="0.5"/><origin xyz="0 0 0.15"/>
      <inertia ixx="0.004" iyy="0.004" izz="0.0005" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.15"/><geometry><box size="0.04 0.04 0.3"/></geometry></collision>
  </link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/><origin xyz="0 0 0.06"/><axis xyz="0 1 0"/>
    <limit lower="-0.5" upper="0.5" effort="1" velocity="1"/>
  </joint>
</robot>
URDF
hapode-run --scene robot.urdf --lockstep --seconds 2 --shot robot.png | grep peak_force
head -c 4 robot.png | grep -a PNG
# The mouse pulls the hand; Escape ends the run.
cat > pull.sh <<'PULL'
hapode-run --scene robot.urdf --view --shot-size 400x320 --no-realtime --trace pulled.csv &
timeout 60 xdotool search --sync --name '^hapode$'
xdotool mousemove 200 160 sleep 1 mousedown 1 mousemove 240 130 sleep 1 mouseup 1 sleep 1 key Escape
wait %1
PULL
xvfb-run -a sh pull.sh | grep trace_hash
test "$(wc -l < pulled.csv)" -gt 500
