# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""build.py OUT [DOXYGEN]: the reference of headers and pages as HTML in OUT/html, and as XML for
checks in OUT/xml. Exit status 1: doxygen warns; the warnings are in OUT/warnings."""
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
SETTINGS = """
PROJECT_NAME = hapode
PROJECT_NUMBER = {version}
PROJECT_BRIEF = "a hand feels a rigid-body world"
OUTPUT_DIRECTORY = "{out}"
STRIP_FROM_PATH = "{root}" "{root}/include" "{out}"
STRIP_FROM_INC_PATH = "{root}/include"
INPUT = "{root}/include/hapode" {pages} "{out}/examples.dox"
FILE_PATTERNS = *.h *.md *.dox
RECURSIVE = YES
USE_MDFILE_AS_MAINPAGE = "{root}/docs/README.md"
EXAMPLE_PATH = "{root}/examples"
EXAMPLE_RECURSIVE = YES
IMAGE_PATH = {images}
FILTER_PATTERNS = "*.h=python3 -B {root}/tools/reference/filter.py" \\
                  "*.md=python3 -B {root}/tools/reference/filter.py"
OPTIMIZE_OUTPUT_FOR_C = YES
TYPEDEF_HIDES_STRUCT = YES
JAVADOC_AUTOBRIEF = YES
AUTOLINK_SUPPORT = YES
SORT_MEMBER_DOCS = NO
EXTRACT_ALL = NO
QUIET = YES
WARN_IF_UNDOCUMENTED = YES
WARN_LOGFILE = "{out}/warnings"
WARN_FORMAT = "$file:$line: $text"
ENABLE_PREPROCESSING = YES
MACRO_EXPANSION = YES
EXPAND_ONLY_PREDEF = YES
SKIP_FUNCTION_MACROS = NO
PREDEFINED = HAP_API= HAP_NODISCARD= HAP_BEGIN_DECLS= HAP_END_DECLS= __GNUC__
INCLUDE_PATH = "{root}/include"
HAVE_DOT = NO
CLASS_GRAPH = NO
GENERATE_LATEX = NO
GENERATE_XML = YES
XML_PROGRAMLISTING = NO
GENERATE_HTML = YES
HTML_TIMESTAMP = NO
HTML_DYNAMIC_SECTIONS = NO
SEARCHENGINE = YES
SERVER_BASED_SEARCH = NO
GENERATE_TREEVIEW = YES
DISABLE_INDEX = NO
VERBATIM_HEADERS = NO
"""


def version():
    return re.search(r"version: '([^']+)'", (ROOT / "meson.build").read_text("utf-8"))[1]


def example_pages(out):
    """A page for each program, which doxygen names at each function that the program calls."""
    lines = []
    for path in sorted((ROOT / "examples").rglob("*.c")):
        comment = re.search(r"\n\n/\* (.*?)\*/", path.read_text("utf-8"), re.S)
        text = re.sub(r"\s*\n \* ?", " ", comment[1]) if comment else "A program of the pages."
        lines.append(f"/** @example {path.relative_to(ROOT / 'examples')}\n * {text}\n */")
    (out / "examples.dox").write_text("\n".join(lines) + "\n", encoding="utf-8")


def pages():
    return sorted(p for p in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])


def build(out, doxygen):
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    example_pages(out)
    folders = sorted({p.parent for p in (ROOT / "docs").rglob("*.svg")} |
                     {p.parent for p in (ROOT / "docs").rglob("*.png")})
    settings = SETTINGS.format(root=ROOT, out=out, version=version(),
                               pages=" ".join(f'"{p}"' for p in pages()),
                               images=" ".join(f'"{p}"' for p in folders))
    (out / "Doxyfile").write_text(settings, encoding="utf-8")
    done = subprocess.run([doxygen, str(out / "Doxyfile")], check=False)
    warnings = (out / "warnings").read_text("utf-8", "replace").splitlines()
    for line in warnings[:40]:
        print(line, file=sys.stderr)
    if not warnings and done.returncode == 0:
        print(f"{out}/html/index.html")
    return 1 if warnings or done.returncode else 0


if __name__ == "__main__":
    sys.exit(build(pathlib.Path(sys.argv[1]).resolve(), (sys.argv[2:] or ["doxygen"])[0]))
