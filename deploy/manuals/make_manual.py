#!/usr/bin/env python3
"""Writes a manual page: a text of this folder with what the program prints about its options.

    make_manual.py TEMPLATE PROGRAM PAGE VERSION

PROGRAM prints help as CLI11 does, with --help; or it is a file config.ts of the web app, which has
the text of its help. The template is a page in roff's man macros with these placeholders:
    @VERSION@      the version
    @OPTIONS@      the options of the program
    @COMMANDS@     a subsection for each of its verbs
    @EXIT_CODES@   the exit codes that the help lists
    @USAGE@        the lines of the help that say how the program is called
"""

import os
import pathlib
import re
import subprocess
import sys

# The help is printed for a home of this name, so that defaults are the same on all machines.
HOME = "/HOME"
# A line of an option, an argument or a verb, with its description or without.
ENTRY = re.compile(r" *(\S.*?)(?: {2,}(\S.*))?")
# Width of CLI11's column of names.
NAMES = 28


def help_of(program: str, verbs: list[str]) -> str:
    """Returns what `program VERBS --help` prints."""
    if program.endswith(".ts"):
        text = pathlib.Path(program).read_text(encoding="utf-8")
        return re.search(r"usage = `(.*?)`;", text, re.DOTALL).group(1)
    environment = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PEPESEG", "XDG_"))
    } | {"HOME": HOME}
    done = subprocess.run(
        [program, *verbs, "--help"],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if not done.stdout:
        sys.exit(f"{program} --help printed nothing")
    text = done.stdout.replace(HOME, "~")
    return text.replace(str(pathlib.Path(program).resolve().parent), "FOLDER_OF_PROGRAM")


def escape(text: str) -> str:
    """Returns the text for roff."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + text if text.startswith((".", "'")) else text


def option(names: str) -> str:
    """Returns the names and values of an option, such as "-h,--help" or "--grace INT=10"."""
    # How CLI11 prints the kinds of values that a name says already.
    names = re.sub(r":value in \{.*?\} OR \{.*?\}", "", names)
    names = re.sub(r"\b(INT|FLOAT):(?=\1 in)", "", names)
    names = re.sub(r"\bINT:SIZE \[.*?\]", "SIZE", names)
    names = re.sub(r"\bINT:NONNEGATIVE", "INT", names)
    names = re.sub(r"\bTEXT:(?=\{)", "", names)
    names = names.replace("{false}", "")
    first, _, rest = names.partition(" ")
    bold = ", ".join(f"\\fB{escape(name)}\\fR" for name in first.split(","))
    return f"{bold} {escape(rest)}".rstrip()


def sections(text: str) -> dict[str, list[str]]:
    """Returns the lines of the help below each heading, such as "Options"."""
    found: dict[str, list[str]] = {"": []}
    heading = ""
    for line in text.splitlines():
        match = re.fullmatch(r"\[?([A-Z][A-Za-z ]+)(?:: [^]]*\])?:?", line)
        if match and (line.endswith(":") or line.startswith("[")):
            heading = match.group(1)
            found.setdefault(heading, [])
        elif line:
            found[heading].append(line)
    return found


def entries(lines: list[str], wanted: str) -> list[tuple[str, str]]:
    """Returns names and descriptions of the entries whose names begin with `wanted`."""
    found: list[tuple[str, str]] = []
    taken = False
    for line, following in zip(lines, [*lines[1:], ""]):
        indent = len(line) - len(line.lstrip())
        if indent > 4:  # continues a description
            if taken:
                names, description = found[-1]
                found[-1] = (names, f"{description} {line.strip()}".strip())
            continue
        names, description = ENTRY.fullmatch(line).groups(default="")
        # Names that fill their column have one space before the description.
        column = indent + NAMES
        if not description and line[column - 1 : column] == " " and not following.startswith(" " * 6):
            names, description = line[:column].strip(), line[column:]
        taken = names.startswith(wanted)
        if taken:
            found.append((names, description))
    return found


def options(help_text: str, skip_help: bool = False) -> list[str]:
    """Returns the roff lines of all options, and of positional arguments before them."""
    by_heading = sections(help_text)
    found = entries(by_heading.get("Positionals", []), "")
    for heading, lines in by_heading.items():
        if heading in ("Options", "Option Group", ""):
            found += entries(lines, "-")
    lines = []
    for names, description in found:
        if not (skip_help and names.startswith("-h,")):
            lines += [".TP", option(names), escape(description)]
    return lines


def commands(program: str, verbs: list[str]) -> list[str]:
    """Returns the roff lines of all verbs below `verbs`, each with its options."""
    lines = []
    for verb, _ in entries(sections(help_of(program, verbs)).get("Subcommands", []), ""):
        path = [*verbs, verb]
        text = help_of(program, path)
        deeper = commands(program, path)
        if not deeper:
            description, usage = text.splitlines()[:2]
            lines += [f'.SS "{escape(usage.removeprefix("Usage: "))}"', escape(description) + "."]
            lines += options(text, skip_help=True)
        lines += deeper
    return lines


def exit_codes(help_text: str) -> list[str]:
    """Returns the roff lines of the exit codes, of which the help has several on a line."""
    lines = []
    for line in sections(help_text).get("Exit codes", []):
        for code, meaning in re.findall(r"(\d+) (.+?)(?= +\d+ |$)", line):
            lines += [".TP", f"\\fB{code}\\fR", escape(meaning.strip())]
    return lines


def main() -> None:
    template, program, page, version = sys.argv[1:]
    text = help_of(program, [])
    usage = [line.strip().removeprefix("usage: ") for line in text.splitlines() if " --" in line]
    parts = {
        "@OPTIONS@": lambda: options(text),
        "@COMMANDS@": lambda: commands(program, []),
        "@EXIT_CODES@": lambda: exit_codes(text),
        "@USAGE@": lambda: [line for call in usage for line in (".br", escape(call))][1:],
    }
    lines = []
    for line in pathlib.Path(template).read_text(encoding="utf-8").splitlines():
        if line in parts:
            made = parts[line]()
            if not made:
                sys.exit(f"{template}: the help of {program} has nothing for {line}")
            lines += made
        else:
            lines.append(line.replace("@VERSION@", version))
    path = pathlib.Path(page)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
