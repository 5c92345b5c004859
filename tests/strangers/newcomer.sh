# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
# Somebody who types the first command of the README and nothing else, on a terminal. "#:" names the
# page of the next command.
before=$(dpkg-query -f '.\n' -W | wc -l)
#: README.md
script -qec tools/run-demo said < /dev/null
times > times # of the shell, then of what it ran; with what apt-get did
echo "told: $(($(dpkg-query -f '.\n' -W | wc -l) - before)) packages more," \
  "processor time, user and system: $(tail -n 1 times)"
grep 'A simulated hand pushed scene row10' said
grep 'The force was off by' said
test "$(grep -c 'hapode-run: ' said)" = 0 # nothing went wrong
head -c 4 build/demo.png | grep -a PNG
grep -q '<html' build/demo.html
grep -q '<svg' build/demo.svg
