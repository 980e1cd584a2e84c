#!/usr/bin/env python3
"""Checks the folders of this repository by their includes: no cycles, no undeclared arrows.

check_folders.py ROOT            exit 1 and a message for each finding
check_folders.py ROOT --print    the table of folders for the tree as it is, cycles included

Each #include of a file of ours is resolved, and makes an arrow from folder to folder.

Cycles are looked for at every depth, in the tests, too. Below a folder, each subfolder is a node with all that is in
it, and the folder's own files are a node of their own, called "FOLDER (own files)". So the files
that stand in server/ itself (main, flags, assembly) must be above every subfolder of server/:
nothing below may include them. Strongly connected components of two nodes or more are cycles.

Arrows of all but the tests must be declared in the tables of TABLE, one row a folder: its name, one
sentence on what it is, which folders it may include. An arrow that is not declared is an error, and so
are a declared arrow that no include makes, a folder without a row, two rows of one folder, and a row
without a sentence. Folders that one row names together count as one.

KNOWN lists the cycles that exist for now, one a line, as this check prints them. A line without a
cycle is an error, so that the file shrinks with the cycles and then goes.
"""
import collections
import os
import re
import sys

DECLARED = ("clients", "core", "kernels", "server")  # top folders with rows in the table
TOPS = DECLARED + ("proto", "tests")
TABLE = "ARCHITECTURE.md"
KNOWN = "tests/layering/known_cycles.txt"
SUFFIXES = (".h", ".cc", ".cu", ".cuh")
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^">]+)[">]')

# One #include: where it is, and the file of ours that it names.
Include = collections.namedtuple("Include", "file line target")
# A row of the table: folders that count as one, and what they may include.
Row = collections.namedtuple("Row", "folders sentence allowed")


def source_files(root):
    for top in TOPS:
        for folder, subfolders, names in os.walk(os.path.join(root, top)):
            subfolders[:] = sorted(s for s in subfolders if s not in ("node_modules", "gen", "dist"))
            for name in sorted(names):
                if name.endswith(SUFFIXES):
                    yield os.path.relpath(os.path.join(folder, name), root)


def resolve(root, file, name):
    """Returns the file of ours that `file` means by `name`, which need not exist, or None."""
    proto = re.sub(r"(\.grpc)?\.pb\.h$", ".proto", name)
    if proto != name:
        proto = proto if proto.startswith("proto/") else "proto/" + proto
        return proto if os.path.exists(os.path.join(root, proto)) else None
    if name.split("/")[0] in TOPS:
        return os.path.normpath(name)
    beside = os.path.normpath(os.path.join(os.path.dirname(file), name))
    return beside if os.path.isfile(os.path.join(root, beside)) else None


def read_includes(root):
    """Returns the includes among our files, and messages on those whose file does not exist."""
    includes, findings = [], []
    for file in source_files(root):
        with open(os.path.join(root, file), encoding="utf-8") as lines:
            for number, line in enumerate(lines, 1):
                match = INCLUDE.match(line)
                target = resolve(root, file, match.group(1)) if match else None
                if target is None:
                    continue
                if os.path.isfile(os.path.join(root, target)):
                    includes.append(Include(file, number, target))
                else:
                    findings.append(f"{file}:{number}: includes {target}, which does not exist")
    return includes, findings


def folder_of(file, joined):
    """Returns the file's folder, or the folder that the table joins it to. proto/ is one folder."""
    folder = os.path.dirname(file)
    if folder.split("/")[0] == "proto":
        return "proto"
    return joined.get(folder, folder)


def node_below(parent, folder):
    """Returns the node of `folder` among the folders right below `parent`."""
    if folder == parent:
        return f"{parent} (own files)"
    depth = parent.count("/") + 1 if parent else 0
    return "/".join(folder.split("/")[: depth + 1])


def common_folder(a, b):
    parts = []
    for x, y in zip(a.split("/"), b.split("/")):
        if x != y:
            break
        parts.append(x)
    return "/".join(parts)


def arrows_at_every_depth(includes, joined):
    """Returns {parent folder: {(node, node): [Include...]}}, the arrows between a folder's nodes."""
    graphs = collections.defaultdict(lambda: collections.defaultdict(list))
    for include in includes:
        source = folder_of(include.file, joined)
        target = folder_of(include.target, joined)
        if source != target:
            parent = common_folder(source, target)
            arrow = (node_below(parent, source), node_below(parent, target))
            graphs[parent][arrow].append(include)
    return graphs


def strong_components(arrows):
    """Returns the strongly connected components of two nodes or more (Tarjan, no recursion)."""
    following = collections.defaultdict(list)
    for source, target in sorted(arrows):
        following[source].append(target)
    index, low, stack, components = {}, {}, [], []
    for start in sorted(following):
        work = [(start, iter(following[start]))] if start not in index else []
        while work:
            node, rest = work[-1]
            if node not in index:
                index[node] = low[node] = len(index)
                stack.append(node)
            target = next(rest, None)
            if target is None:
                work.pop()
                if work:
                    above = work[-1][0]
                    low[above] = min(low[above], low[node])
                if low[node] == index[node]:
                    first = stack.index(node)
                    components.append(sorted(stack[first:]))
                    del stack[first:]
            elif target not in index:
                work.append((target, iter(following[target])))
            elif target in stack:
                low[node] = min(low[node], index[target])
    return sorted(c for c in components if len(c) > 1)


def describe_cycle(component, arrows, most=3):
    """Returns the arrows of a cycle with the first `most` include lines of each."""
    lines = []
    for source, target in sorted(arrows):
        if source in component and target in component:
            found = arrows[source, target]
            lines.append(f"  {source} -> {target}: {len(found)} includes")
            lines += [f"    {i.file}:{i.line}: includes {i.target}" for i in found[:most]]
    return lines


def find_cycles(includes, joined):
    """Returns [(name, lines that describe it)] of all cycles."""
    cycles = []
    for parent, arrows in sorted(arrows_at_every_depth(includes, joined).items()):
        for component in strong_components(arrows):
            cycles.append((", ".join(component), describe_cycle(component, arrows)))
    return cycles


def check_cycles(root, cycles):
    known = set()
    if os.path.exists(os.path.join(root, KNOWN)):
        with open(os.path.join(root, KNOWN), encoding="utf-8") as lines:
            known = {line.strip() for line in lines if line.strip() and line[0] != "#"}
        if not known:
            return [f"{KNOWN}: lists no cycle; remove the file"]
    findings = []
    for name, lines in cycles:
        if name not in known:
            findings.append("\n".join([f"cycle between folders: {name}"] + lines))
    for name in sorted(known - {name for name, _ in cycles}):
        findings.append(f"{KNOWN}: there is no such cycle: {name}")
    return findings


def full_name(name, folder):
    """Completes a name of the column "May include", which may lack the top folder of its row."""
    top = folder.split("/")[0]
    return name if name.split("/")[0] in TOPS else f"{top}/{name}"


def read_rows(path):
    """Reads the rows of a Markdown table whose first cell names folders: `core/base`."""
    rows = []
    with open(path, encoding="utf-8") as lines:
        for line in lines:
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if not line.startswith("| `") or len(cells) != 3:
                continue
            folders = re.findall(r"`([^`]+)`", cells[0])
            if folders and folders[0].split("/")[0] in DECLARED:
                names = re.findall(r"`([^`]+)`", cells[2])
                allowed = {full_name(name, folders[0]) for name in names}
                rows.append(Row(folders, cells[1], allowed))
    return rows


def joined_folders(rows):
    return {folder: row.folders[0] for row in rows for folder in row.folders[1:]}


def arrows_between_folders(includes, joined):
    arrows = collections.defaultdict(list)
    for include in includes:
        source, target = folder_of(include.file, joined), folder_of(include.target, joined)
        if source != target:
            arrows[source, target].append(include)
    return arrows


def check_arrows(includes, rows, folders):
    joined = joined_folders(rows)
    allowed = {row.folders[0]: row.allowed for row in rows}
    arrows = arrows_between_folders(includes, joined)
    findings = []
    for (source, target), found in sorted(arrows.items()):
        if source.split("/")[0] not in DECLARED:
            continue
        if target not in allowed.get(source, ()):
            first = found[0]
            findings.append(f"{source} may not include {target}: {first.file}:{first.line} "
                            f"includes {first.target} (allowed arrows: {TABLE})")
    for source in sorted(allowed):
        for target in sorted(allowed[source]):
            if (source, target) not in arrows:
                findings.append(f"{TABLE}: {source} does not include {target}; remove the arrow")
    for folder in sorted({joined.get(f, f) for f in folders} - set(allowed)):
        findings.append(f"{TABLE}: {folder} has no row")
    for folder in sorted(set(allowed) - folders):
        findings.append(f"{TABLE}: there are no sources in {folder}")
    return findings


def check_sentences(rows):
    """Checks that each folder has one row, and each row a sentence: words that end with a period."""
    findings = []
    counts = collections.Counter(folder for row in rows for folder in row.folders)
    for folder in sorted(f for f in counts if counts[f] > 1):
        findings.append(f"{TABLE}: {folder} has {counts[folder]} rows")
    for row in rows:
        if not re.fullmatch(r"\S.*\.", row.sentence):
            findings.append(f"{TABLE}: {row.folders[0]} has no sentence")
    return findings


def print_table(includes, rows, folders):
    """Prints the table for the includes as they are, with the sentences of the present table."""
    joined = joined_folders(rows)
    sentences = {row.folders[0]: (row.folders, row.sentence) for row in rows}
    arrows = arrows_between_folders(includes, joined)
    print("| Folder | What it is | May include |")
    print("|---|---|---|")
    for folder in sorted({joined.get(f, f) for f in folders}):
        names, sentence = sentences.get(folder, ([folder], "?"))
        top = folder.split("/")[0]
        targets = [t[len(top) + 1:] if t.startswith(top + "/") else t
                   for s, t in sorted(arrows) if s == folder]
        print("| " + ", ".join(f"`{n}`" for n in names) + f" | {sentence} | " +
              ", ".join(f"`{t}`" for t in targets) + " |")


def main(arguments):
    if not arguments:
        sys.exit(__doc__)
    root = arguments[0]
    includes, findings = read_includes(root)
    folders = {os.path.dirname(file) for file in source_files(root)
               if file.split("/")[0] in DECLARED}
    table = os.path.join(root, TABLE)
    rows = read_rows(table) if os.path.exists(table) else []
    cycles = find_cycles(includes, joined_folders(rows))
    if "--print" in arguments:
        print_table(includes, rows, folders)
        for name, lines in cycles:
            print("\n" + "\n".join([f"cycle between folders: {name}"] + lines))
        return 0
    findings += check_cycles(root, cycles) + check_arrows(includes, rows, folders)
    findings += check_sentences(rows)
    print("\n".join(findings), end="\n" if findings else "")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
