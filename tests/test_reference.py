# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""The reference of headers and pages: doxygen has no warning, everything public has a sentence, the
examples are there, links of the HTML lead somewhere, and its search needs no network. Argument:
source root."""
import html
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import urllib.parse
import xml.etree.ElementTree as tree

root = pathlib.Path(sys.argv[1]).resolve()
points = []


def point(problems, name):
    points.append(not problems)
    for problem in problems[:200]:
        print("# " + str(problem).replace("\n", "\n# "))
    print(f"{'not ok' if problems else 'ok'} {len(points)} - {name}", flush=True)


def text_of(element, *tags):
    return "".join("".join(part.itertext()) for tag in tags
                   for part in element.findall(tag)).strip()


def is_public(element):
    location = element.find("location")
    return location is not None and "include/hapode" in "/" + location.get("file", "") or \
        location is not None and location.get("file", "").startswith("hapode/")


def public_things(xml):
    """Name and text of structs, functions, members, types, macros, enumerations and constants."""
    for path in sorted(xml.glob("*.xml")):
        if path.name in ("index.xml", "combine.xslt"):
            continue
        for compound in tree.parse(path).getroot().findall("compounddef"):
            if compound.get("kind") == "struct" and is_public(compound):
                yield compound.findtext("compoundname"), text_of(
                    compound, "briefdescription", "detaileddescription")
            if compound.get("kind") not in ("struct", "file"):
                continue
            for member in compound.iter("memberdef"):
                if not is_public(member):
                    continue
                name = member.findtext("name")
                if compound.get("kind") == "struct":
                    name = compound.findtext("compoundname") + "." + name
                yield name, text_of(member, "briefdescription", "detaileddescription")
                for value in member.findall("enumvalue"):
                    yield value.findtext("name"), text_of(value, "briefdescription",
                                                          "detaileddescription")


def names_in_headers():
    """What the headers declare, found without doxygen: by their text."""
    for path in sorted((root / "include/hapode").glob("*.h")):
        text = re.sub(r"/\*.*?\*/", "", path.read_text("utf-8"), flags=re.S)
        yield from re.findall(r"^(?:HAP_NODISCARD )?HAP_API [^(;]*?\b(hap\w+)\(", text, re.M)
        yield from re.findall(r"^ +(HAP_\w+) *(?:=|,|$)", text, re.M)
        yield from re.findall(r"^#define (HAP_\w+)", text, re.M)
        for struct, body in re.findall(r"^typedef struct (\w+) \{(.*?)^\}", text, re.S | re.M):
            yield struct
            for field in re.findall(r"(?:\(\*)?(\w+)\)?(?:\[\w+\])*(?:\([^;]*\))?;", body):
                yield f"{struct}.{field}"


def check_text(xml):
    told = dict(public_things(xml))
    known = set(names_in_headers()) - {"HAP_API", "HAP_NODISCARD", "HAP_LIKE"}
    known = {name for name in known if not re.match(r"HAPODE_\w+_H$", name)}
    point([] if len(known) > 400 else [f"{len(known)} found"], "the headers' names are found")
    missing = sorted(known - told.keys())
    point(missing, "the reference has all of them")
    point(sorted(name for name, text in told.items() if len(text.split()) < 1),
          f"each of {len(told)} functions, members and constants has a sentence")


def check_examples(folder):
    pages = (folder / "examples.dox").read_text("utf-8")
    names = sorted(path.name for path in (root / "examples").rglob("*.c"))
    point([name for name in names if name not in pages], "all examples are in it")
    session = " ".join(p.read_text("utf-8") for p in (folder / "html").glob("session_8h.html"))
    point([] if "touch_a_cube.c" in session else ["hap_session_start has no example"],
          "functions name the examples that call them")


def anchors_of(page, known):
    if page not in known:
        text = page.read_text("utf-8", "replace")
        known[page] = set(re.findall(r"\b(?:id|name)=\"([^\"]+)\"", text))
    return known[page]


def bad_links(folder):
    known = {}
    for page in sorted(folder.glob("*.html")):
        for target in set(re.findall(r"href=\"([^\"]+)\"", page.read_text("utf-8", "replace"))):
            target = html.unescape(target)
            if re.match(r"[a-z]+:", target):
                continue
            name, _, anchor = target.partition("#")
            path = folder / urllib.parse.unquote(name) if name else page
            if not path.is_file():
                yield f"{page.name}: {target} is not there"
            elif anchor and path.suffix == ".html" and anchor not in anchors_of(path, known):
                yield f"{page.name}: {target} has no such anchor"


def check_html(folder):
    pages = sorted(folder.glob("*.html"))
    point(list(bad_links(folder)), f"links of {len(pages)} pages lead somewhere")
    outside = [f"{page.name}: {source}" for page in pages
               for source in re.findall(
                   r"<(?:script|link|img)[^>]*(?:src|href)=\"(https?:[^\"]+)\"",
                   page.read_text("utf-8", "replace"))]
    point(outside, "no page needs the network")


def check_search(folder):
    words = "".join(path.read_text("utf-8", "replace") for path in (folder / "search").glob("*.js"))
    functions = [name for name in names_in_headers()
                 if name.startswith("hap_") and "." not in name]
    point([name for name in functions if f"'{name}'" not in words],
          f"the search knows {len(functions)} functions and structs")
    point([] if "Choosing stiffness" in words else ["Choosing stiffness"], "and the pages")


def main():
    doxygen = shutil.which("doxygen")
    if doxygen is None:
        print("1..0 # SKIP needs doxygen")
        return 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        done = subprocess.run([sys.executable, "-B", str(root / "tools/reference/build.py"),
                               str(folder / "out"), doxygen], capture_output=True, text=True,
                              timeout=600, check=False)
        folder = folder / "out"
        problems = (folder / "warnings").read_text("utf-8").splitlines()
        point(problems or ([] if done.returncode == 0 else [done.stderr]), "no warning")
        check_text(folder / "xml")
        check_examples(folder)
        check_html(folder / "html")
        check_search(folder / "html")
    print(f"1..{len(points)}")
    return 0 if all(points) else 1


sys.exit(main())
