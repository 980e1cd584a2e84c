#!/usr/bin/env python3
"""Looks for the words of glossary.tsv in comments, strings, documents and identifiers of C++.

check_words.py ROOT                    exit 1 if a folder has more of them than its allowance
check_words.py ROOT --list [FOLDER]    every word that is found, with the word to write instead
check_words.py ROOT --lower            lowers allowances to what is found; never raises one

glossary_allowance.tsv has a line "FOLDER<TAB>COUNT" for each folder that still has such words; a file
counts for the folder that it is in. A folder without a line may have none. Allowances shrink only:
whoever removes words lowers them in the same commit. In identifiers "mask_cell" and "MaskCell" are
the words "mask cell".
"""
import collections
import os
import re
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import source_text  # noqa: E402

FOLDER = "tests/layering"
GLOSSARY = FOLDER + "/glossary.tsv"
ALLOWANCE = FOLDER + "/glossary_allowance.tsv"
# The list and what tests it have the words on purpose; a lock file has only names of packages.
EXEMPT = (GLOSSARY, ALLOWANCE, FOLDER + "/check_words_test.py")

Word = collections.namedtuple("Word", "pattern instead example")
Finding = collections.namedtuple("Finding", "file line found instead")


def read_glossary(path):
    """Returns the words, or exits where an expression does not match its own example."""
    words = []
    with open(path, encoding="utf-8") as lines:
        for number, line in enumerate(lines, 1):
            if line.startswith("#") or not line.strip():
                continue
            cells = line.rstrip("\n").split("\t")
            if len(cells) != 3:
                sys.exit(f"{path}:{number}: {len(cells)} cells, not 3")
            word = Word(re.compile(rf"\b(?:{cells[0]})\b", re.IGNORECASE), cells[1], cells[2])
            if not word.pattern.search(word.example):
                sys.exit(f"{path}:{number}: does not match its example, {word.example!r}")
            words.append(word)
    return words


def texts(root, file):
    """Returns (line, text) of a document, or of the comments, strings and identifiers of a source."""
    if file.endswith(".md"):
        return [(1, source_text.read(root, file))]
    pieces = source_text.pieces_of(root, file)
    strings = [piece for piece in pieces if piece.kind == "string"]
    prose = [(p.line, p.text) for p in source_text.join_comments(pieces) + strings]
    return prose + source_text.names_of(root, file)


def find_words(root, words):
    findings = []
    for file in source_text.all_files(root):
        if file in EXEMPT or not source_text.is_prose(file):
            continue
        for first_line, text in texts(root, file):
            flat = text.replace("\n", " ")
            for word in words:
                for match in word.pattern.finditer(flat):
                    line = first_line + text.count("\n", 0, match.start())
                    findings.append(Finding(file, line, match.group(0), word.instead))
    return sorted(set(findings))


def read_allowance(path):
    allowance = {}
    if os.path.exists(path):
        with open(path, encoding="utf-8") as lines:
            for line in lines:
                if line.strip() and not line.startswith("#"):
                    folder, count = line.rstrip("\n").split("\t")
                    allowance[folder] = int(count)
    return allowance


def write_allowance(path, allowance):
    with open(path, "w", encoding="utf-8") as file:
        file.write("# How many words of glossary.tsv each folder still has. Numbers shrink only: see\n"
                   "# check_words.py.\n")
        file.writelines(f"{folder}\t{count}\n" for folder, count in sorted(allowance.items()))


def describe(finding):
    return f"{finding.file}:{finding.line}: \"{finding.found}\": write {finding.instead}"


def compare(findings, allowance):
    """Prints what is above or below the allowance. Returns whether anything is above it."""
    by_folder = collections.defaultdict(list)
    for finding in findings:
        by_folder[os.path.dirname(finding.file) or "."].append(finding)
    above = False
    for folder in sorted(set(by_folder) | set(allowance)):
        found, allowed = by_folder[folder], allowance.get(folder, 0)
        if len(found) > allowed:
            above = True
            print("\n".join(map(describe, found)))
            print(f"{folder}: {len(found)} words of the glossary, its allowance is {allowed}\n")
        elif len(found) < allowed:
            print(f"{folder}: {len(found)} words of the glossary; lower its allowance of {allowed} "
                  f"({FOLDER}/check_words.py . --lower)")
    return above


def main(arguments):
    if not arguments:
        sys.exit(__doc__)
    root, options = arguments[0], arguments[1:]
    findings = find_words(root, read_glossary(os.path.join(root, GLOSSARY)))
    path = os.path.join(root, ALLOWANCE)
    if options[:1] == ["--list"]:
        below = "".join(options[1:])
        print("\n".join(describe(f) for f in findings if f.file.startswith(below)))
        return 0
    if options == ["--lower"]:
        counts = collections.Counter(os.path.dirname(f.file) or "." for f in findings)
        lowered = {folder: min(counts[folder], allowed)
                   for folder, allowed in read_allowance(path).items()}
        write_allowance(path, {folder: count for folder, count in lowered.items() if count})
        return 0
    return 1 if compare(findings, read_allowance(path)) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
