# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
# Somebody who types the first command of the README and nothing else, on a terminal. "#:" names the
# page of the next command.
before=$(dpkg-query -f '.\n' -W | wc -l)
#: README.md
script -qec tools/run-demo said < /dev/null
echo "packages installed: $(($(dpkg-query -f '.\n' -W | wc -l) - before))"
grep 'A simulated hand pushed scene row10' said
grep 'The force was off by' said
test "$(grep -c 'hapode-run: ' said)" = 0 # nothing went wrong
head -c 4 build/demo.png | grep -a PNG
grep -q '<html' build/demo.html
grep -q '<svg' build/demo.svg
