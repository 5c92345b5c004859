# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""install_dir.py OWN PREFIX: where below PREFIX this Python looks for packages. OWN is the folder
that meson names, and is taken where it is looked in; else the first one. Below /usr/local Debian
has another one than meson thinks. Folders that do not exist yet count, too."""
import os
import site
import sys

own, prefix = map(os.path.normpath, sys.argv[1:])
looked_in = [os.path.normpath(path) for path in site.getsitepackages()]
below = [path for path in looked_in if path.startswith(prefix + "/")]
print(own if own in looked_in or not below else below[0])
