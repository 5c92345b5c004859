# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""embed.py PAGE STYLE SCRIPT OUT: the page with style and script as a text of C. Marks such as
@TITLE@ stay; hapode-run fills them in."""
import sys

page, style, script = (open(name, encoding="utf-8").read() for name in sys.argv[1:4])
text = page.replace("@STYLE@", style).replace("@SCRIPT@", script)
quoted = []
for line in text.split("\n"):
    escaped = line.encode("utf-8").decode("latin-1").replace("\\", "\\\\").replace('"', '\\"')
    quoted.append('  "' + escaped.replace("??", "?\\?") + '\\n"')
body = "\n".join(quoted)
with open(sys.argv[4], "w", encoding="latin-1") as out:
    out.write('#include "tools/run_html_page.h"\n\nconst char run_html_page[] =\n' + body + ";\n")
