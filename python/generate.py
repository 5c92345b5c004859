# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""Makes the generated modules of the Python package from the public headers.

usage: generate.py INCLUDE_FOLDER OUT_FOLDER LIBRARY_PATH COMPILER...

_ffi.py has the declarations for cffi, _headers.py the texts of the comments, _constants.py
the enumerations and macros, _structs.py a class for each struct that the library fills in."""
import ast
import pathlib
import re
import subprocess
import sys

import cffi

LEFT_OUT = ("ode.h", "hapode.h")  # ODE's types; the header that includes the others
BOOKKEEPING = ("size", "cookie", "reserved")
COMMENT = re.compile(r"/\*(.*?)\*/", re.S)


def headers_of(include):
    return sorted(p for p in (include / "hapode").glob("*.h") if p.name not in LEFT_OUT)


def preprocess(compiler, include, text):
    command = [*compiler, "-E", "-x", "c", "-std=c11", "-DHAP_API=", f"-I{include}", "-"]
    return subprocess.run(command, input=text, capture_output=True, text=True, check=True).stdout


def declarations(compiler, include):
    """What the headers declare, without what they include of the system."""
    source = "".join(f"#include <hapode/{p.name}>\n" for p in headers_of(include))
    lines, ours = [], False
    for line in preprocess(compiler, include, source).split("\n"):
        marker = re.match(r'# \d+ "(.*?)"', line)
        if marker:
            ours = "/hapode/" in marker[1] and marker[1].startswith(str(include))
        elif ours:
            lines.append(line)
    return re.sub(r"__attribute__\s*\(\((?:[^()]|\([^()]*\))*\)\)", "", "\n".join(lines))


def macros(compiler, include):
    """Names and values of the macros that are numbers."""
    names = []
    for path in headers_of(include):
        names += re.findall(r"^#define (HAP_\w+) +[^\s(]|^#define (HAP_\w+) +\([-\d]",
                            path.read_text(encoding="utf-8"), re.M)
    names = [a or b for a, b in names]
    source = "".join(f"#include <hapode/{p.name}>\n" for p in headers_of(include))
    source += "".join(f'"VALUE" "{name}" {name}\n' for name in names)
    found = {}
    # A macro of the system begins a line of its own, behind a marker.
    expanded = re.sub(r"^#.*\n", "", preprocess(compiler, include, source), flags=re.M)
    for name, value in re.findall(r'^"VALUE" "(\w+)"((?:(?!^"VALUE").)*)', expanded, re.M | re.S):
        try:
            found[name] = ast.literal_eval(re.sub(r"(?<=\d)[uUlL]+\b", "", value).strip())
        except (ValueError, SyntaxError):
            continue  # an attribute or a text
    return {name: value for name, value in found.items() if isinstance(value, (int, float))}


def plain(comment):
    """Text of a comment without its stars; a blank line ends a paragraph."""
    lines = [re.sub(r"^\s*\*? ?", "", line).rstrip() for line in comment.split("\n")]
    return "\n".join(lines).strip()


def member_texts(body):
    """Text of each member of a struct or enum: what stands before it, or behind it."""
    texts, pending = {}, ""
    pattern = re.compile(r"/\*(?P<text>.*?)\*/|"
                         r"(?P<code>(?:\([^()]*\)|[^;,/{}()])+)(?:[;,]|(?=/\*)|\Z)|\n", re.S)
    position, last = 0, None
    for found in pattern.finditer(body):
        if found["text"] is not None:
            between = body[position:found.start()]
            if last and "\n" not in between:
                texts[last] = plain(found["text"])
                pending, last = "", None
            else:
                pending, last = plain(found["text"]), None
            position = found.end()
        elif found["code"] is not None and found["code"].strip():
            name = re.search(r"(?:\(\*(\w+)\)|(\w+))(?:\([^)]*\)|\[[^\]]*\])*\s*(?:=.*)?$",
                             found["code"].strip(), re.S)
            if name:
                last = name[1] or name[2]
                texts[last], pending = pending, ""
            position = found.end()
    return texts


def texts_of(path):
    """Comments of functions, types, macros and members, by name."""
    text = path.read_text(encoding="utf-8")
    out = {}
    for found in re.finditer(r"typedef (?:struct|enum) (\w+) \{(.*?)\n\} \1;", text, re.S):
        for member, words in member_texts(found[2]).items():
            out[f"{found[1]}.{member}"] = words
    for found in re.finditer(
            r"/\*((?:(?!\*/).)*)\*/\n(?:HAP_\w+ )*(?:typedef (?:struct|enum) (?P<type>\w+) \{|"
            r"typedef [^;{]*?\(\*(?P<call>\w+)\)|[\w ]+?[ *](?P<function>hap_\w+)\(|"
            r"#define (?P<macro>HAP_\w+))", text, re.S):
        name = found["type"] or found["call"] or found["function"] or found["macro"]
        out[name] = plain(found[1])
    for name, words in re.findall(r"^#define (HAP_\w+) +\S+ */\*(.*?)\*/", text, re.M | re.S):
        out[name] = plain(words)
    return out


def class_name(name):
    return "".join(part.capitalize() for part in name.removeprefix("hap_").split("_"))


def member_prefix(members):
    """What all names begin with, up to an underscore."""
    first, last = min(members), max(members)
    same = 0
    while same < min(len(first), len(last)) and first[same] == last[same]:
        same += 1
    return first[:first[:same].rfind("_") + 1]


def text_literal(words):
    return repr(words)


def write_constants(out, enums, values, texts):
    lines = ['"""Enumerations and numbers of the headers. Generated."""', "import enum", ""]
    for name, members in sorted(enums.items()):
        names = list(members)
        prefix = "HAP_" if name == "hap_status" else member_prefix(names)
        kind = "IntFlag" if "bits" in texts.get(name, "").lower() else "IntEnum"
        lines += ["", f"class {class_name(name)}(enum.{kind}):",
                  f"    {text_literal(texts.get(name, name))}"]
        for member, value in members.items():
            lines.append(f"    {member.removeprefix(prefix)} = {value}")
            if texts.get(f"{name}.{member}"):
                lines.append(f"    {text_literal(texts[f'{name}.{member}'])}")
        lines.append("")
    lines.append("")
    for name, value in sorted(values.items()):
        lines.append(f"{name.removeprefix('HAP_')} = {value!r}")
        if texts.get(name):
            lines.append(text_literal(texts[name]))
    (out / "_constants.py").write_text("\n".join(lines) + "\n", encoding="utf-8")


def annotation(ctype, structs):
    """Python type of a member: numbers, texts, arrays, structs of the library."""
    if ctype.kind == "primitive":
        return "float" if ctype.cname in ("double", "float") else "int"
    if ctype.kind == "enum":
        return "int"
    if ctype.kind == "struct" and ctype.cname.removeprefix("struct ") in structs:
        return f'"{class_name(ctype.cname.removeprefix("struct "))}"'
    if ctype.kind == "array" and ctype.item.cname == "char":
        return "str"
    if ctype.kind == "array" and ctype.item.kind in ("primitive", "array"):
        return "FloatArray"
    if ctype.kind == "array" and ctype.item.kind == "struct":
        return "tuple[" + annotation(ctype.item, structs) + ", ...]"
    return "int"  # an address, to be compared


def write_structs(out, ffi, texts):
    names = [n for n in ffi.list_types()[0] if ffi.typeof(n).kind == "struct"
             and ffi.typeof(n).fields]
    lines = ['"""Structs that the library fills in. Generated."""', "import dataclasses",
             "from typing import Any", "", "import numpy as np", "import numpy.typing as npt", "",
             "FloatArray = npt.NDArray[Any]", ""]
    for name in sorted(names):
        fields = [(n, f) for n, f in ffi.typeof(name).fields if n not in BOOKKEEPING]
        lines += ["", "@dataclasses.dataclass(frozen=True)", f"class {class_name(name)}:",
                  f"    {text_literal(texts.get(name, name))}"]
        for field, about in fields:
            lines.append(f"    {field}: {annotation(about.type, names)}")
            if texts.get(f"{name}.{field}"):
                lines.append(f"    {text_literal(texts[f'{name}.{field}'])}")
        lines.append("")
    lines += ["", "BY_NAME: dict[str, Any] = {"]
    lines += [f'    "{name}": {class_name(name)},' for name in sorted(names)] + ["}"]
    (out / "_structs.py").write_text("\n".join(lines) + "\n", encoding="utf-8")


def main():
    include, out, library = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]), \
        sys.argv[3]
    compiler = sys.argv[4:]
    out.mkdir(parents=True, exist_ok=True)
    text = declarations(compiler, include)
    ffi = cffi.FFI()
    ffi.cdef(text)
    ffi.set_source("hapode._ffi", None)
    ffi.emit_python_code(str(out / "_ffi.py"))
    texts = {}
    for path in headers_of(include):
        texts.update(texts_of(path))
    enums = {}
    for name in ffi.list_types()[0]:
        if ffi.typeof(name).kind == "enum":
            members = {member: ffi.typeof(name).relements[member]
                       for member in sorted(ffi.typeof(name).relements,
                                            key=ffi.typeof(name).relements.get)}
            enums[name] = members
    write_constants(out, enums, macros(compiler, include), texts)
    write_structs(out, ffi, texts)
    (out / "_headers.py").write_text(
        '"""Texts of the headers\' comments. Generated."""\n'
        f"LIBRARY = {library!r}\nTEXTS: dict[str, str] = {{\n"
        + "".join(f"    {name!r}: {words!r},\n" for name, words in sorted(texts.items()))
        + "}\n", encoding="utf-8")


main()
