#!/usr/bin/env python3
"""Checks that what documents and comments cite exists. Prints a line for each citation that does not.

check_citations.py ROOT

In all .md files and in the comments of all sources:

links         [text](path#heading): the file, relative to the document, and the heading (.md only).
paths         core/query/segmenter.h, tests/bench/results/*.md: relative to the root, or to the
              citing file's folder or one above it. `*` and {a,b} as in a shell; a part in capitals
              (TARGET) stands for any name; a path without a suffix may name a unit.
files         segmenter.h, query/segmenter.cc, METHOD.md: some file has this name.
sections      METHOD.md section 3: the file has the heading "## 3. ...".
make          `make demo`, and indented or fenced lines that begin with make: the Makefile has the target.
programs      build/bin/pepesegd: a CMakeLists.txt names it.

In the strings of sources other than tests, which are messages to users: documents (README.md) and
paths below deploy/.

What is cited but made by a build or by a user is in GENERATED; files of others are in FOREIGN.
"""
import fnmatch
import os
import re
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import source_text  # noqa: E402

TOPS = ("proto", "server", "core", "kernels", "clients", "deploy", "tests")
GENERATED = ("clients/web/dist", "clients/web/gen", "deploy/secrets",
             "clients/python/pepeseg/build")
# Names of files that are not ours: of other projects, of systems, and of examples.
FOREIGN = ("cuda_runtime.h", "onnx.proto", "slurm.sh", "soci-config.h")

LINK = re.compile(r"\]\(([^)\s]+)\)")
PATH = re.compile(r"(?<![\w./$}~-])((?:\.\./)*(?:" + "|".join(TOPS) + r")/[\w./*{},-]*[\w*}])")
FILE = re.compile(r"(?<![\w./*$}<-])((?:[\w-]+/)*[\w-]+\.(?:h|cc|cu|cuh|md|py|sh|proto))(?![\w/*]|\.\w)")
SECTION = re.compile(r"([\w/]+\.md),?\s+sections?\s+(\d+)(?:\s*(?:,|and|to)\s*(\d+))*")
MAKE_SPAN = re.compile(r"`(?:sudo )?make ([^`]*)`")
MESSAGE = re.compile(r"(?<![\w./{$])(?:deploy/[\w./-]*\w|(?:[\w-]+/)*[A-Z]+\.md)(?![\w/*])")
PROGRAM = re.compile(r"\bbuild/bin/([\w-]+)")


def slug(heading):
    """Returns the anchor that GitHub gives to a heading."""
    text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")


def expand_braces(path):
    match = re.search(r"\{([^{}]*)\}", path)
    if not match:
        return [path]
    return [result for word in match.group(1).split(",")
            for result in expand_braces(path[:match.start()] + word + path[match.end():])]


class Tree:
    """The repository's files, folders, headings, make targets and programs."""

    def __init__(self, root):
        self.root = root
        self.files = source_text.all_files(root)
        self.known = set(self.files)
        for file in self.files:
            while "/" in file:
                file = os.path.dirname(file)
                self.known.add(file)
        self.names = {os.path.basename(file) for file in self.files}
        self.units = {os.path.splitext(file)[0] for file in self.files}
        makefile = source_text.read(root, "Makefile") if "Makefile" in self.known else ""
        self.targets = set(re.findall(r"(?m)^([a-z][\w-]*):", makefile))
        cmake = "".join(source_text.read(root, file) for file in self.files
                        if os.path.basename(file) == "CMakeLists.txt")
        self.programs = set(re.findall(r"[\w-]+", cmake))
        self.headings = {file: re.findall(r"(?m)^#+ +(.*?) *$", self.without_code(file))
                         for file in self.files if file.endswith(".md")}

    def without_code(self, file):
        return re.sub(r"(?ms)^```.*?^```", "", source_text.read(self.root, file))

    def has_path(self, path):
        if path in self.known or path in self.units or path.startswith(GENERATED):
            return True
        pattern = "/".join("*" if re.fullmatch("[A-Z_]{3,}", part)
                           else re.sub("[A-Z]{3,}_", "*_", part) for part in path.split("/"))
        return "*" in pattern and bool(fnmatch.filter(self.known, pattern))

    def has_path_from(self, file, path):
        """Returns whether `path` exists from the root, the file's folder or a folder above it."""
        folder = os.path.dirname(file)
        while True:
            if self.has_path(os.path.normpath(os.path.join(folder, path))):
                return True
            if not folder:
                return False
            folder = os.path.dirname(folder)

    def has_file(self, name):
        if os.path.basename(name) in FOREIGN or name in self.known:
            return True
        if re.match(r"[A-Z_]{3,}/", name):
            return True  # below a folder of the user's
        if re.search("[A-Z]{3,}_", name):
            return bool(fnmatch.filter(self.names, re.sub("[A-Z]{3,}", "*", name)))
        if "/" not in name:
            return name in self.names
        return any(file.endswith("/" + name) for file in self.files)

    def has_section(self, document, number):
        found = [file for file in self.headings if ("/" + file).endswith("/" + document)]
        return any(heading.startswith(number + ".") for file in found
                   for heading in self.headings[file])


def check_links(tree, file, text):
    for match in LINK.finditer(text):
        target, _, anchor = match.group(1).partition("#")
        if re.match(r"[a-z]+:", target):
            continue
        path = os.path.normpath(os.path.join(os.path.dirname(file), target)) if target else file
        if path not in tree.known:
            yield match.start(), f"links {target}, which does not exist"
        elif anchor and anchor not in map(slug, tree.headings.get(path, [])):
            yield match.start(), f"links {path}#{anchor}; {path} has no such heading"


def check_paths(tree, file, text):
    for match in PATH.finditer(text):
        path = match.group(1)
        if match.end() < len(text) and text[match.end()] in "$<(" and not path.endswith("/"):
            continue  # a part follows that is not known here
        for one in expand_braces(path):
            if not tree.has_path_from(file, one):
                yield match.start(), f"cites {one}, which does not exist"
    for match in FILE.finditer(text):
        name = match.group(1)
        if name.split("/")[0] not in TOPS and not tree.has_file(name):
            yield match.start(), f"cites {name}; no file has this name"


def check_sections(tree, text):
    for match in SECTION.finditer(text):
        for number in re.findall(r"\d+", match.group(0)[len(match.group(1)):]):
            if not tree.has_section(match.group(1), number):
                yield match.start(), f"cites {match.group(1)} section {number}, which does not exist"


def make_words(text, whole_lines):
    for match in MAKE_SPAN.finditer(text):
        yield match.start(), match.group(1)
    if whole_lines:
        for match in re.finditer(r"(?m)^(?: {4,}|```\w*\n)(?:sudo )?make ([^#\n]*)", text):
            yield match.start(), match.group(1)


def check_commands(tree, text, whole_lines):
    for start, words in make_words(text, whole_lines):
        for word in re.split(r"&&|\|", words)[0].split():
            if re.fullmatch(r"[a-z][a-z0-9-]*", word) and word not in tree.targets:
                yield start, f"cites `make {word}`; the Makefile has no such target"
    for match in PROGRAM.finditer(text):
        if match.group(1) not in tree.programs:
            yield match.start(), f"cites build/bin/{match.group(1)}; no CMakeLists.txt names it"


def check_text(tree, file, first_line, text, is_document):
    cited = LINK.sub(lambda link: "]" + " " * (len(link.group(0)) - 1), text)
    found = list(check_paths(tree, file, cited)) + list(check_sections(tree, text))
    found += check_commands(tree, text, is_document)
    if is_document:
        found += check_links(tree, file, text)
    for start, message in sorted(set(found)):
        yield f"{file}:{first_line + text.count(chr(10), 0, start)}: {message}"


def check_message(tree, file, piece):
    for match in MESSAGE.finditer(piece.text):
        name = match.group(0)
        if not (tree.has_path_from(file, name) if "/" in name else tree.has_file(name)):
            yield f"{file}:{piece.line}: a message cites {name}, which does not exist"


def check(root):
    tree = Tree(root)
    findings = []
    for file in tree.files:
        if not source_text.is_prose(file):
            continue
        if file.endswith(".md"):
            findings += check_text(tree, file, 1, source_text.read(root, file), True)
            continue
        pieces = source_text.pieces_of(root, file)
        for piece in source_text.join_comments(pieces):
            findings += check_text(tree, file, piece.line, piece.text, False)
        if not file.startswith("tests/"):
            for piece in pieces:
                if piece.kind == "string":
                    findings += check_message(tree, file, piece)
    return findings


def main(arguments):
    if len(arguments) != 1:
        sys.exit(__doc__)
    findings = check(arguments[0])
    print("\n".join(findings), end="\n" if findings else "")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
