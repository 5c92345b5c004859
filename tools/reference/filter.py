# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""filter.py FILE: doxygen's view of a header or a page, on stdout.

A header's plain comments become doxygen's: a comment above a declaration documents it, one behind
it on the same line as well; the first one of a file is the file's. Others stay plain: those of
sections ("---- ... ----"), of forward declarations, and those that an empty line follows.

A page's headings get the anchors that code hosts give them, and its links lead to pages and
headings of the reference."""
import os
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
HEADING = re.compile(r"^(#+) (.*?)[ \t]*$", re.M)
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
FENCE = re.compile(r"^```.*?^```$", re.S | re.M)
COMMENT = re.compile(r"/\*(.*?)\*/", re.S)


def escaped(text):
    """Doxygen reads nothing but words: no commands, no tags, no automatic links to files."""
    return re.sub(r"([\\@<>#%&])", r"\\\1", text)


def kind_of(source, match, is_first):
    before = source[source.rfind("\n", 0, match.start()) + 1:match.start()]
    after = source[match.end():]
    line_end = after.split("\n", 1)[0]
    next_line = after.split("\n", 2)[1] if "\n" in after else ""
    if "SPDX" in match[1] or "----" in match[1] or line_end.strip():
        return "plain"
    if is_first and not next_line.strip():
        return "file"
    if before.strip():
        return "plain" if re.match(r"(struct|union) \w+;", before.strip()) else "behind"
    return "above" if next_line.strip() else "plain"


def header(source):
    parts, end, is_first = [], 0, True
    for match in COMMENT.finditer(source):
        kind = kind_of(source, match, is_first)
        if kind == "plain":
            continue
        if is_first and kind != "file":
            parts.append("/** @file */\n")  # else doxygen leaves out what is in the file
        is_first = False
        begin = {"file": "/** @file\n *", "above": "/**", "behind": "/**<"}[kind]
        parts += [source[end:match.start()], begin, escaped(match[1]), "*/"]
        end = match.end()
    text = "".join(parts) + source[end:]
    # What all structs have in common needs no words in each of them.
    return re.sub(r"^(  uint32_t reserved;)$", r"\1 /**< 0; room for what comes. */", text,
                  flags=re.M)


def slug(heading):
    """The anchor of a heading, as code hosts make it."""
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
    return re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")


def page_id(path):
    name = str(path.relative_to(ROOT).with_suffix(""))
    return "page_" + re.sub(r"\W", "_", name)


def anchor_id(path, anchor):
    return page_id(path) + "_" + re.sub(r"\W", "_", anchor)


def link(path, match):
    bang, text, target = match.groups()
    if bang:
        return f"![{text}]({os.path.basename(target)})"
    if re.match(r"[a-z]+:", target):
        return match[0]
    name, _, anchor = target.partition("#")
    page = (path.parent / name).resolve() if name else path
    if page.suffix != ".md":
        return text
    return f"[{text}](@ref {anchor_id(page, anchor) if anchor else page_id(page)})"


def prose(path, text, seen):
    def heading(match):
        label = anchor_id(path, slug(match[2])) if seen else page_id(path)
        seen.append(label)
        if seen.count(label) > 1:
            label += f"_{seen.count(label) - 1}"
        return f"{match[1]} {re.sub(LINK, lambda m: m[2], match[2])} {{#{label}}}"

    text = HEADING.sub(heading, text)
    text = re.sub(r"\*\*(\[[^\]]*\]\([^)]*\))\*\*", r"\1", text)  # doxygen takes no bold links
    # Words in backquotes are left as they are.
    pieces = re.split(r"(`[^`\n]+`)", text)
    for i in range(0, len(pieces), 2):
        pieces[i] = re.sub(r"@(?!ref )", r"\@", pieces[i])
    return LINK.sub(lambda m: link(path, m), "".join(pieces))


def page(path, source):
    parts, end, seen = [], 0, []
    for match in FENCE.finditer(source):
        parts += [prose(path, source[end:match.start()], seen), match[0]]
        end = match.end()
    return "".join(parts) + prose(path, source[end:], seen)


def main(path):
    source = path.read_text(encoding="utf-8")
    sys.stdout.write(page(path, source) if path.suffix == ".md" else header(source))


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]).resolve())
