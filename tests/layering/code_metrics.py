#!/usr/bin/env python3
"""Prints what a reader meets in this repository, as a Markdown table.

code_metrics.py ROOT

Sources are the .h, .cc, .cu and .cuh files of kernels/, core/, server/ and clients/; tests are those
of tests/. How each line is measured:

units          files with the same path but for the suffix count as one.
functions      definitions with a body, by their braces (no compiler): methods and constructors, too,
               lambdas and macros not. Length: from the first line of the signature to the closing
               brace. Parameters: of the signature.
comments       lines with nothing but a comment, of all lines that are not empty.
"""
import collections
import os
import re
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import check_folders  # noqa: E402

SOURCES = ("clients", "core", "kernels", "server")
SMALL = 40  # lines
KEYWORDS = {"if", "for", "while", "switch", "return", "sizeof", "catch", "decltype", "alignof",
            "defined", "static_assert", "noexcept", "new", "delete", "throw", "alignas", "requires"}
STRING = re.compile(r'R"(\w*)\((?s:.*?)\)\1"|"(?:\\.|[^"\\\n])*"|(?<![0-9a-fA-F])\'(?:\\.|[^\'\\\n])*\'')
COMMENT = re.compile(r"//[^\n]*|/\*(?s:.*?)\*/")

# A definition: its name, and how large it is.
Function = collections.namedtuple("Function", "name lines parameters")


def code_files(root, tops):
    for top in tops:
        for folder, subfolders, names in os.walk(os.path.join(root, top)):
            subfolders[:] = sorted(s for s in subfolders if s not in ("node_modules", "gen", "dist"))
            for name in sorted(names):
                if name.endswith(check_folders.SUFFIXES):
                    yield os.path.relpath(os.path.join(folder, name), root)


def read(root, file):
    with open(os.path.join(root, file), encoding="utf-8") as text:
        return text.read()


def blank(match):
    """Returns blanks of a match's length, with its ends of lines."""
    return re.sub(r"[^\n]", " ", match.group(0))


def without_comments(text):
    """Returns the text with blanks for comments, strings and preprocessor lines."""
    text = re.sub(STRING.pattern + "|" + COMMENT.pattern, blank, text)
    return re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", blank, text, flags=re.M)


def count_comments(text):
    """Returns the number of lines with a comment alone, and of lines that are not empty."""
    code = COMMENT.sub(blank, re.sub(STRING, lambda m: re.sub(r"[^\n]", "x", m.group(0)), text))
    comments = total = 0
    for line, stripped in zip(text.split("\n"), code.split("\n")):
        if line.strip():
            total += 1
            comments += not stripped.strip()
    return comments, total


def matching(text, first):
    """Returns the index of the bracket that closes the one at `first`."""
    close = {"{": "}", "(": ")", "<": ">"}[text[first]]
    depth = 0
    for i in range(first, len(text)):
        depth += (text[i] == text[first]) - (text[i] == close)
        if depth == 0:
            return i
    return len(text) - 1


def split_commas(text):
    parts, depth, current = [], 0, ""
    for c in text:
        depth += (c in "([{<") - (c in ")]}>")
        if c == "," and depth <= 0:
            parts.append(current)
            current = ""
        else:
            current += c
    return [p for p in parts + [current] if p.strip() and p.strip() != "void"]


SIGNATURE = re.compile(r"(~?\w+|operator\s*(?:\(\)|[^\s\w(]+|[\w:]+))\s*\(")


def read_signature(head):
    """Returns (name, number of parameters) of the function with the signature `head`."""
    for match in SIGNATURE.finditer(head):
        name = match.group(1)
        if name in KEYWORDS or name.isupper() or name.startswith("__"):
            continue
        last = matching(head, match.end() - 1)
        return name, len(split_commas(head[match.end():last]))
    return None


def find_functions(text):
    """Returns the functions that a file defines."""
    code = without_comments(text)
    functions = []
    start = i = 0               # of the statement that is being read
    while i < len(code):
        c = code[i]
        if c in ";}":
            start = i + 1
        elif c == "(":
            i = matching(code, i)
        elif c == "{":
            head = code[start:i]
            scope = re.search(r"\b(?:namespace|class|struct|union|enum|extern)\b(?:[^()]*?)(\w*)\s*"
                              r"(?:final\s*)?(?::[^()]*)?$", head)
            signature = read_signature(head) if not scope and "=" not in operators_out(head) else None
            if scope:
                start = i + 1
            elif signature is None or is_member_initialiser(head):
                i = matching(code, i)   # an initialiser: the statement goes on
            else:
                end = matching(code, i)
                first = start + len(head) - len(head.lstrip())
                name, parameters = signature
                functions.append(Function(name, code.count("\n", first, end) + 1, parameters))
                i = end
                start = i + 1
        i += 1
    return functions


def operators_out(head):
    """Returns a signature without operators, template parameters and parameters."""
    head = re.sub(r"operator\s*[^\s\w(]+", "", head)
    head = re.sub(r"template\s*<[^{}]*?>\s*(?=[\w\[])", "", head)
    while re.search(r"\([^()]*\)", head):
        head = re.sub(r"\([^()]*\)", "", head)
    return head


def is_member_initialiser(head):
    """Returns whether the brace after `head` initialises a member: "Name(...) : a_(1), b_"."""
    flat = operators_out(head)
    colon = re.search(r"(?<!:):(?!:)", flat)
    return bool(colon) and bool(re.search(r"[:,]\s*\w+(?:<[^<>]*>)?\s*$", flat)) \
        and not head.rstrip().endswith(")")


def unit_of(file):
    return os.path.splitext(file)[0]


def quantile(values, share):
    """Returns the smallest value that at least `share` percent of the values do not exceed."""
    ordered = sorted(values)
    return ordered[max(0, -(-len(ordered) * share // 100) - 1)] if ordered else 0


def measure(root, tops):
    """Returns (files, {file: lines}, functions, {suffix: [comment lines, lines]})."""
    files = list(code_files(root, tops))
    lines, functions, comments = {}, [], collections.defaultdict(lambda: [0, 0])
    for file in files:
        text = read(root, file)
        lines[file] = text.count("\n")
        functions += find_functions(text)
        found = count_comments(text)
        kind = os.path.splitext(file)[1].replace(".cuh", ".cu")
        comments[kind][0] += found[0]
        comments[kind][1] += found[1]
    return files, lines, functions, comments


def pair(values):
    return f"{quantile(values, 50)}, {quantile(values, 90)}"


def rows_of(measured):
    """Returns [(name, text)] of what is measured alike in sources and tests."""
    files, lines, functions, comments = measured
    units = collections.Counter()
    for file in files:
        units[unit_of(file)] += lines[file]
    small = sum(count <= SMALL for count in lines.values())
    rows = [("units", str(len(units))), ("files", str(len(files))),
            ("lines", str(sum(lines.values()))),
            ("lines of a unit: median, p90", pair(units.values())),
            ("lines of a file: median, p90", pair(lines.values())),
            (f"files of {SMALL} lines or fewer", f"{100 * small / max(1, len(files)):.0f} %"),
            ("functions", str(len(functions))),
            ("lines of a function: median, p90", pair([f.lines for f in functions])),
            (f"functions of more than {SMALL} lines", str(sum(f.lines > SMALL for f in functions))),
            ("parameters: median, p90", pair([f.parameters for f in functions]))]
    for kind in (".h", ".cc", ".cu"):
        count, total = comments[kind]
        rows.append((f"comments in {kind}", f"{100 * count / max(1, total):.1f} %"))
    return rows


def main(arguments):
    if not arguments:
        sys.exit(__doc__)
    sources, tests = measure(arguments[0], SOURCES), measure(arguments[0], ("tests",))
    print("| | sources | tests |\n|---|---|---|")
    for (name, value), (_, in_tests) in zip(rows_of(sources), rows_of(tests)):
        print(f"| {name} | {value} | {in_tests} |")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
