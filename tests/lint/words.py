#!/usr/bin/env python3
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
"""words.py ROOT: width of lines, length of sentences, length of the README (docs/style.md).
words.py ROOT FILE...: what it measures of single files, with the longest sentences."""
import math
import os
import re
import sys

import lint

WIDTH_MAX = 100
SENTENCE_MAX = 22  # words: the 90th percentile of a set of files
PRONOUNS_MAX = 4.0  # per cent of the words of README and docs
README_MAX = 900   # words before the figures, code apart
FIGURES = "## How exact, how fast"
SENTENCES_MIN = 100  # of a set: fewer are a sign that the reader of comments is broken

# Sets whose sentences hold the limit. The others are measured and told.
HELD = {"README and docs", "public headers", "comments of lib"}

PRONOUNS = frozenset("it its itself they them their theirs themselves this that these those what "
                     "which who whom whose one ones he him his she her".split())
ABBREVIATIONS = re.compile(r"\b(e\.g|i\.e|etc|vs|cf|eq|No|Fig|Dr)\.")
END = re.compile(r"(?<=[.!?])[)\"']*\s+(?=[\"'(]*(?:[A-Z0-9`*_+-]|hapode|libccd|x86))")
WORD = re.compile(r"[A-Za-z0-9_][\w'/.^*%+-]*")


def is_page(name):
    return name.endswith(".md") and ("/" not in name or name.startswith("docs/"))


def is_header(name):
    return name.startswith("include/") and name.endswith(".h")


def is_library(name):
    return name.startswith("lib/") and name.endswith((".c", ".h"))


def paragraphs_of_page(text):
    """Prose alone: no code, no table, no heading, no picture. A list item is a paragraph."""
    text = re.sub(r"^(```|~~~).*?^\1[^\n]*$", "\n", text, flags=re.S | re.M)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
    found = []
    current = []
    before_code = True  # an indented line after a blank one is code
    for line in text.split("\n") + [""]:
        plain = line.strip()
        is_item = re.match(r"\s*([-*+]|\d+\.)\s", line)
        skipped = (not plain or plain.startswith(("|", "#", "![", "<")) or
                   before_code and line.startswith("    ") and not is_item)
        if (skipped or is_item) and current:
            found.append(" ".join(current))
            current = []
        if not skipped:
            current.append(re.sub(r"^([-*+]|\d+\.)\s+(\[[ x]\]\s+)?", "", plain))
        before_code = (not plain or before_code and skipped) and not plain.startswith("|")
    return found


COMMENT = re.compile(r"/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'", re.S)


def paragraphs_of_code(text):
    """The comments. Lines that are indented are formulas or tables."""
    found = []
    for match in COMMENT.finditer(text):
        if not match.group().startswith("/*") or "SPDX-" in match.group():
            continue
        lines = [re.sub(r"^\s*\*? ?", "", line) if number else line.lstrip()
                 for number, line in enumerate(match.group()[2:-2].split("\n"))]
        line_begin = text.rfind("\n", 0, match.start()) + 1
        is_trailing = text[line_begin:match.start()].strip() != ""
        current = []
        for line in lines + [""]:
            is_item = re.match(r"[-*]\s", line)
            skipped = not line.strip() or line.startswith("  ") and not is_trailing
            if (skipped or is_item) and current:
                found.append(" ".join(current))
                current = []
            if not skipped:
                current.append(re.sub(r"^[-*]\s+", "", line.strip()))
    return found


def sentences(paragraph):
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", paragraph)
    text = re.sub(r"`[^`]*`", "Code", text)
    text = text.replace("**", "")
    text = ABBREVIATIONS.sub(lambda match: match.group(1), text)
    return [sentence for sentence in END.split(text) if WORD.search(sentence)]


def words(sentence):
    return WORD.findall(sentence)


def percentile(values, share):
    """The least value that so many are not above."""
    values = sorted(values)
    return values[max(0, math.ceil(share * len(values)) - 1)] if values else 0


class Set:
    def __init__(self, root, names, reader):
        self.longest = []
        self.total = self.pronouns = 0
        for name in names:
            for paragraph in reader(lint.read(root, name)):
                for sentence in sentences(paragraph):
                    found = words(sentence)
                    self.longest.append((len(found), name, sentence))
                    self.total += len(found)
                    self.pronouns += sum(word.lower() in PRONOUNS for word in found)
        self.longest.sort(reverse=True)
        self.high = percentile([row[0] for row in self.longest], 0.9)

    def pronoun_share(self):
        return 100.0 * self.pronouns / self.total if self.total else 0.0

    def told(self):
        return (f"{len(self.longest)} sentences, {self.total} words, 90th percentile {self.high} "
                f"words, pronouns {self.pronoun_share():.1f} %")


def wide_lines(root, name):
    """Over the width, but for tables and for lines that a link makes long."""
    for number, line in enumerate(lint.read(root, name).split("\n"), 1):
        is_table = line.lstrip().startswith("|")
        has_link = "](" in line or re.search(r"https?://", line)
        if len(line) > WIDTH_MAX and not is_table and not has_link:
            yield f"{name}:{number}: {len(line)} columns"


def readme_words(text):
    """Words before the figures, code and pictures apart; None where there is no such heading."""
    head, mark, _ = text.partition("\n" + FIGURES + "\n")
    head = re.sub(r"^```.*?^```[^\n]*$", "", head, flags=re.S | re.M)
    head = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", head)
    return len(WORD.findall(head)) if mark else None


def tell(root, names):
    for name in names:
        reader = paragraphs_of_page if name.endswith(".md") else paragraphs_of_code
        measured = Set(root, [name], reader)
        print(f"{name}: {measured.told()}")
        for length, _, sentence in measured.longest[:8]:
            if length > SENTENCE_MAX:
                print(f"  {length}: {sentence}")


def check_selves(tap):
    page = ("# Head\n\nOne two. Three\nfour, e.g. five.\n\n| a | b |\n\n```c\nx\n```\n"
            "- six\n- seven\n")
    found = [s for p in paragraphs_of_page(page) for s in sentences(p)]
    tap.point("prose of a page is found", [] if len(found) == 4 else [str(found)])
    code = ('int x; /* One. Two\n * three. */\nchar *s = "/* no */";\n/* SPDX-x */\n'
            "/* Four\n *   f = m a\n */")
    found = [s for p in paragraphs_of_code(code) for s in sentences(p)]
    tap.point("comments of code are found", [] if len(found) == 3 else [str(found)])


def main(root, single):
    if single:
        return tell(root, single)
    tap = lint.Tap()
    check_selves(tap)
    names = lint.project_files(root)
    pages = [name for name in names if is_page(name)]
    tap.point("there are pages", [] if len(pages) > 10 else [f"{len(pages)} found"])
    tap.point(f"no line of a page is over {WIDTH_MAX} columns",
              [problem for name in pages
               for problem in wide_lines(root, name)])
    count = readme_words(lint.read(root, "README.md"))
    print(f"# README: {count} words before the figures")
    tap.point(f"the README has at most {README_MAX} words before the figures",
              [f"no heading {FIGURES}"] if count is None else
              [f"{count} words"] if count > README_MAX else [])
    prose = [name for name in pages if name != "CHANGELOG.md"]
    sets = {
        "README and docs": (prose, paragraphs_of_page),
        "public headers": ([n for n in names if is_header(n)], paragraphs_of_code),
        "comments of lib": ([n for n in names if is_library(n)], paragraphs_of_code),
    }
    for title, (files, reader) in sets.items():
        measured = Set(root, files, reader)
        print(f"# {title}: {measured.told()}")
        name = f"{title}: nine sentences of ten have at most {SENTENCE_MAX} words"
        problems = []
        if len(measured.longest) < SENTENCES_MIN:
            problems = [f"{len(measured.longest)} sentences found"]
        elif measured.high > SENTENCE_MAX:
            problems = [f"the 90th percentile is {measured.high} words"] + [
                f"{where}: {length}: {sentence[:60]} ..."
                for length, where, sentence in measured.longest[:20]]
        if title in HELD or not problems:
            tap.point(name, problems)
        else:
            tap.skip(name, problems[0])
        if title == "README and docs":
            share = measured.pronoun_share()
            tap.point(f"{title}: at most {PRONOUNS_MAX:g} % of the words are pronouns",
                      [f"{share:.1f} %"] if share > PRONOUNS_MAX else [])
    tap.done()


main(sys.argv[1], sys.argv[2:])
