#!/usr/bin/env python3
"""Prints what a reader meets in this repository, as a Markdown table.

code_metrics.py ROOT [--details] [--ninja-log FILE]

Sources are the .h, .cc, .cu and .cuh files of kernels/, core/, server/ and clients/; tests are those
of tests/. How each line is measured:

units          files with the same path but for the suffix count as one.
functions      definitions with a body, by their braces (no compiler): methods and constructors, too,
               lambdas and macros not. Length: from the first line of the signature to the closing
               brace. Parameters: of the signature.
comments       lines with nothing but a comment, of all lines that are not empty.
folder cycles  as check_folders.py finds them.
SegmentViews   units that define a function that the handler of the RPC SegmentViews reaches: of all in
               server/ and core/, those that answer (ANSWERING), and the others, such as loading a
               model or authorising the caller. A call is a name before "(" in a body. It reaches the
               definitions of that name in the caller's unit and in the units that this unit
               includes. Where an included unit only declares the name, the call reaches the
               definitions in those units of the same folder that include the declaration. Calls by a
               base class or a callback are missed, and functions of one name in one unit count
               together: compare with other runs of this script only.
options        fields of structs whose names end in Options, in core/ and server/, and fields of such
               messages of the contract.
build          seconds from start to end of each step in a ninja log, added up. They are CPU time as
               far as no other work shares the cores: build with -j no larger than the cores.
"""
import collections
import os
import re
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import check_folders  # noqa: E402

SOURCES = ("clients", "core", "kernels", "server")
SMALL = 40  # lines
SERVICE, HANDLER = "SegmentationService", "SegmentViews"
ANSWERING = ("core/decompose/", "core/prompt/", "core/query/", "core/render/", "server/api/",
             "server/rpc/", "server/services/")
KEYWORDS = {"if", "for", "while", "switch", "return", "sizeof", "catch", "decltype", "alignof",
            "defined", "static_assert", "noexcept", "new", "delete", "throw", "alignas", "requires"}
STRING = re.compile(r'R"(\w*)\((?s:.*?)\)\1"|"(?:\\.|[^"\\\n])*"|(?<![0-9a-fA-F])\'(?:\\.|[^\'\\\n])*\'')
COMMENT = re.compile(r"//[^\n]*|/\*(?s:.*?)\*/")

# A definition: where it is, how large, its name, its class ("" without), and the names it calls.
Function = collections.namedtuple("Function", "file line lines parameters name owner calls")


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


SIGNATURE = re.compile(r"((?:\w+(?:<[^<>()]*>)?::)*)(~?\w+|operator\s*(?:\(\)|[^\s\w(]+|[\w:]+))\s*\(")


def read_signature(head):
    """Returns (name, class, number of parameters) of the function with the signature `head`."""
    for match in SIGNATURE.finditer(head):
        name = match.group(2)
        if name in KEYWORDS or name.isupper() or name.startswith("__"):
            continue
        last = matching(head, match.end() - 1)
        owner = match.group(1).rstrip(":").split("::")[-1]
        return name, owner, len(split_commas(head[match.end():last]))
    return None


def find_functions(file, text):
    """Returns the functions that the file defines."""
    return scan(file, text)[0]


def scan(file, text):
    """Returns the functions that the file defines, and the names of those that it only declares."""
    code = without_comments(text)
    functions, declared = [], set()
    scopes = []                 # classes of the open braces outside functions, "" for others
    start = i = 0               # of the statement that is being read
    while i < len(code):
        c = code[i]
        if c == ";":
            head = code[start:i]
            signature = read_signature(head) if "=" not in operators_out(head) else None
            if signature is not None:
                declared.add(signature[0])
            start = i + 1
        elif c == "(":
            i = matching(code, i)
        elif c == "}":
            if scopes:
                scopes.pop()
            start = i + 1
        elif c == "{":
            head = code[start:i]
            scope = re.search(r"\b(?:namespace|class|struct|union|enum|extern)\b(?:[^()]*?)(\w*)\s*"
                              r"(?:final\s*)?(?::[^()]*)?$", head)
            signature = read_signature(head) if not scope and "=" not in operators_out(head) else None
            if scope:
                named = re.search(r"\b(?:class|struct|union)\s+(?:alignas\([^)]*\)\s*)?(\w+)", head)
                scopes.append(named.group(1) if named else "")
                start = i + 1
            elif signature is None or is_member_initialiser(head):
                i = matching(code, i)   # an initialiser: the statement goes on
            else:
                end = matching(code, i)
                first = start + len(head) - len(head.lstrip())
                name, owner, parameters = signature
                owner = owner or next((s for s in reversed(scopes) if s), "")
                calls = frozenset(re.findall(r"(\w+)\s*(?:<[^<>;{}()]*>\s*)?\(", code[i:end])) - KEYWORDS
                functions.append(Function(file, code.count("\n", 0, first) + 1,
                                          code.count("\n", first, end) + 1, parameters, name, owner,
                                          calls))
                i = end
                start = i + 1
        i += 1
    return functions, declared


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


def definitions_in_reach(root, functions):
    """Returns {unit: {name: functions}}, what a call to a name means where the unit is included."""
    defined = collections.defaultdict(lambda: collections.defaultdict(list))
    for function in functions:
        defined[unit_of(function.file)][function.name].append(function)
    reach = collections.defaultdict(lambda: collections.defaultdict(list))
    for unit, names in defined.items():
        reach[unit].update(names)
    for include in check_folders.read_includes(root)[0]:
        unit, user = unit_of(include.target), unit_of(include.file)
        if unit == user or os.path.dirname(unit) != os.path.dirname(user):
            continue
        declared = scan(include.target, read(root, include.target))[1]
        for name in declared & defined[user].keys() - defined[unit].keys():
            reach[unit][name] += defined[user][name]
    return reach


def segment_units(root, functions):
    """Returns the units that define what the handler of SegmentViews reaches."""
    reach = definitions_in_reach(root, functions)
    includes = collections.defaultdict(set)
    for include in check_folders.read_includes(root)[0]:
        includes[unit_of(include.file)].add(unit_of(include.target))
    work = [f for f in functions if f.owner.startswith(SERVICE) and f.name == HANDLER]
    reached = set(work)
    while work:
        caller = work.pop()
        unit = unit_of(caller.file)
        for near in {unit} | includes[unit]:
            for name in caller.calls & reach[near].keys():
                for callee in reach[near][name]:
                    if callee not in reached and callee.file.split("/")[0] in ("server", "core"):
                        reached.add(callee)
                        work.append(callee)
    return sorted({unit_of(f.file) for f in reached})


def count_fields(body):
    """Returns the number of data members in the body of a struct, without comments."""
    for opening, closing in ("()", "{}"):
        while re.search(rf"\{opening}[^{opening}{closing}]*\{closing}", body):
            body = re.sub(rf"\{opening}[^{opening}{closing}]*\{closing}", "@", body)
    fields = 0
    for statement in body.split(";"):
        statement = statement.strip()
        no_field = r"(enum|struct|class|using|static|friend|public|private|template|explicit)\b"
        if statement and not re.match(no_field, statement) and "operator" not in statement:
            if re.search(r"\w\s*@\s*(const)?\s*@?$", statement) and "=" not in statement \
                    and not re.search(r"\w\s+\w+\s*@$", statement):
                continue
            fields += len(split_commas(statement))
    return fields


def option_fields(root, files):
    """Returns {name: number of fields} of structs and of messages named ...Options."""
    structs, messages = {}, {}
    for file in files:
        code = without_comments(read(root, file))
        for match in re.finditer(r"\bstruct\s+(\w*Options)\s*(?:final\s*)?\{", code):
            end = matching(code, match.end() - 1)
            structs[match.group(1)] = count_fields(code[match.end():end])
    for folder, _, names in os.walk(os.path.join(root, "proto")):
        for name in (n for n in sorted(names) if n.endswith(".proto")):
            code = without_comments(read(folder, name))
            for match in re.finditer(r"\bmessage\s+(\w*Options)\s*\{", code):
                end = matching(code, match.end() - 1)
                messages[match.group(1)] = len(re.findall(r"=\s*\d+\s*[\[;]", code[match.end():end]))
    return structs, messages


def quantile(values, share):
    """Returns the smallest value that at least `share` percent of the values do not exceed."""
    ordered = sorted(values)
    return ordered[max(0, -(-len(ordered) * share // 100) - 1)] if ordered else 0


def build_times(log):
    """Returns {output: seconds} of a ninja log; a step with several outputs counts once."""
    seconds, seen = {}, set()
    with open(log, encoding="utf-8") as lines:
        for line in lines:
            parts = line.rstrip("\n").split("\t")
            if len(parts) == 5 and (parts[0], parts[1], parts[4]) not in seen:
                seen.add((parts[0], parts[1], parts[4]))
                seconds[parts[3]] = (int(parts[1]) - int(parts[0])) / 1000
    return seconds


def build_part(output):
    if output.endswith(".cu.o"):
        return "CUDA"
    top = output.split("/")[0]
    return top if top in SOURCES + ("proto", "tests") else "programs and others"


def print_build(log):
    seconds = build_times(log)
    parts = collections.Counter()
    for output, time in seconds.items():
        parts[build_part(output)] += time
    print(f"| build, minutes of all steps | {sum(parts.values()) / 60:.1f} | |")
    for part, time in parts.most_common():
        print(f"| of which {part} | {time / 60:.1f} | |")
    print("\nThe ten longest steps:\n\n| Step | Seconds |\n|---|---|")
    for output, time in sorted(seconds.items(), key=lambda item: -item[1])[:10]:
        print(f"| {output} | {time:.1f} |")


def measure(root, tops):
    """Returns (files, {file: lines}, functions, {suffix: [comment lines, lines]})."""
    files = list(code_files(root, tops))
    lines, functions, comments = {}, [], collections.defaultdict(lambda: [0, 0])
    for file in files:
        text = read(root, file)
        lines[file] = text.count("\n")
        functions += find_functions(file, text)
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
    root = arguments[0]
    sources, tests = measure(root, SOURCES), measure(root, ("tests",))
    print("| | sources | tests |\n|---|---|---|")
    for (name, value), (_, in_tests) in zip(rows_of(sources), rows_of(tests)):
        print(f"| {name} | {value} | {in_tests} |")
    includes = check_folders.read_includes(root)[0]
    table = os.path.join(root, check_folders.TABLE)
    rows = check_folders.read_rows(table) if os.path.exists(table) else []
    cycles = [name for name, _ in check_folders.find_cycles(includes,
                                                            check_folders.joined_folders(rows))]
    of_tests = sum(name.startswith("tests/") for name in cycles)
    print(f"| folder cycles | {len(cycles) - of_tests} | {of_tests} |")
    followed = segment_units(root, sources[2])
    answering = [unit for unit in followed if unit.startswith(ANSWERING)]
    print(f"| units that a SegmentViews request is followed through: answering | {len(answering)} | |")
    print(f"| all of them | {len(followed)} | |")
    structs, messages = option_fields(root, [f for f in sources[0]
                                             if f.split("/")[0] in ("core", "server")])
    print(f"| options: fields of {len(structs)} structs ...Options | {sum(structs.values())} | |")
    print(f"| options: fields of {len(messages)} messages ...Options | {sum(messages.values())} | |")
    if "--ninja-log" in arguments:
        print_build(arguments[arguments.index("--ninja-log") + 1])
    if "--details" in arguments:
        print("\nSegment:", *followed, sep="\n  ")
        print("\nStructs:", *(f"{k} {v}" for k, v in sorted(structs.items())), sep="\n  ")
        print("\nMessages:", *(f"{k} {v}" for k, v in sorted(messages.items())), sep="\n  ")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
