"""The files of this repository, and the comments and strings in each.

Two checks read them: check_citations.py (what is cited exists) and check_words.py (the glossary).
No compiler and no git: files are found by walking the tree, comments and strings by the lexical
rules of their language.
"""
import collections
import io
import os
import re
import tokenize

# Folders that are built, downloaded or not in the repository, by name or by path from the root.
SKIPPED = re.compile(r"^(\..+|build(-.*)?|node_modules|__pycache__|.*\.egg-info)$")
SKIPPED_PATHS = ("clients/web/gen", "clients/web/dist", "deploy/secrets",
                 "clients/python/pepeseg/build", "clients/python/pepeseg/dist")
# Data, and stubs made from proto/: what is in them can be cited, but only their documents are read.
UNREAD = ("tests/data", "tests/system/fuzz/corpus", "clients/python/pepeseg/pepeseg/v1")
C_LIKE = (".h", ".cc", ".cu", ".cuh", ".proto", ".ts", ".tsx", ".js", ".mjs", ".css")
HASH = (".sh", ".txt", ".cmake", ".yaml", ".yml", ".cfg", ".conf", ".toml", ".example", ".supp",
        ".lua", ".service", ".in")
HASH_NAMES = ("Makefile", "Dockerfile", "run")

C_TOKEN = re.compile(
    r'(?P<raw>R"(?P<mark>[^(\s"]*)\((?:.|\n)*?\)(?P=mark)")'
    r'|(?P<string>"(?:\\.|[^"\\\n])*"|(?<![0-9A-Za-z])\'(?:\\.|[^\'\\\n])*\')'
    r"|(?P<comment>//[^\n]*|/\*(?:.|\n)*?\*/)")
TEMPLATE = re.compile(r"`(?:\\.|[^`\\])*`")  # of TypeScript

# A piece of text: its kind ("comment" or "string"), its first line, and the text itself.
Piece = collections.namedtuple("Piece", "kind line text")


def all_files(root):
    """Returns the paths of all files below `root`, relative to it, less the skipped folders."""
    found = []
    for folder, subfolders, names in os.walk(root):
        here = os.path.relpath(folder, root)
        here = "" if here == "." else here + "/"
        subfolders[:] = sorted(s for s in subfolders
                               if not SKIPPED.match(s) and here + s not in SKIPPED_PATHS)
        found += [here + name for name in sorted(names)]
    return found


def is_prose(path):
    """Returns whether the checks read the file."""
    return path.endswith(".md") or not any(path.startswith(folder + "/") for folder in UNREAD)


def read(root, path):
    with open(os.path.join(root, path), encoding="utf-8", errors="replace") as file:
        return file.read()


def c_pieces(text, templates):
    pieces = []
    for match in C_TOKEN.finditer(text):
        start = text.rfind("\n", 0, match.start()) + 1
        if match.group("comment") is None and re.match(r"\s*#\s*include", text[start:match.end()]):
            continue
        kind = "comment" if match.group("comment") is not None else "string"
        pieces.append(Piece(kind, text.count("\n", 0, match.start()) + 1, match.group(0)))
    if templates:
        for match in TEMPLATE.finditer(text):
            pieces.append(Piece("string", text.count("\n", 0, match.start()) + 1, match.group(0)))
    return pieces


def names_of(root, path):
    """Returns (line, words) of each identifier of a C++ source: (7, "num mask cells")."""
    if os.path.splitext(path)[1] not in (".h", ".cc", ".cu", ".cuh"):
        return []
    # What is no code becomes blank, so that lines keep their numbers.
    code = C_TOKEN.sub(lambda match: re.sub(r"[^\n]", " ", match.group(0)), read(root, path))
    names = []
    for number, line in enumerate(code.split("\n"), 1):
        if not line.startswith("#include"):
            names += [(number, re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|_+", " ", name).strip())
                      for name in re.findall(r"\b[A-Za-z_]\w*", line)]
    return names


def python_pieces(text):
    """Comments, docstrings (as comments) and strings of a Python file."""
    pieces, statement_begins = [], True
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            pieces.append(Piece("comment", token.start[0], token.string))
        elif token.type == tokenize.STRING:
            kind = "comment" if statement_begins and token.string.endswith('"""') else "string"
            pieces.append(Piece(kind, token.start[0], token.string))
            statement_begins = False
        elif token.type in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT):
            statement_begins = True
        elif token.type != tokenize.NL:
            statement_begins = False
    return pieces


def hash_pieces(text, mark):
    """Comments of a file in which `mark` begins one. The rest of each line counts as a string."""
    pieces = []
    for number, line in enumerate(text.split("\n"), 1):
        code, comment = line, ""
        match = re.search(r"(^|\s)" + mark + r"(.*)", line)
        if match:
            code, comment = line[:match.start()], match.group(2)
        if comment:
            pieces.append(Piece("comment", number, comment))
        if code.strip():
            pieces.append(Piece("string", number, code))
    return pieces


def pieces_of(root, path):
    """Returns the comments and strings of a source file in their order, [] for other files."""
    name, suffix = os.path.basename(path), os.path.splitext(path)[1]
    if suffix in C_LIKE:
        pieces = c_pieces(read(root, path), suffix in (".ts", ".tsx", ".js", ".mjs"))
    elif suffix == ".py" or suffix == ".pyi":
        pieces = python_pieces(read(root, path))
    elif suffix in HASH or name in HASH_NAMES or name.startswith("Dockerfile"):
        pieces = hash_pieces(read(root, path), "--" if suffix == ".lua" else "#")
    else:
        pieces = []
    return sorted(pieces, key=lambda piece: piece.line)


def join_comments(pieces):
    """Joins comments on consecutive lines, so that a sentence may be matched across them."""
    joined = []
    for piece in pieces:
        if piece.kind != "comment":
            continue
        text = re.sub(r"(?m)^\s*(//+|/\*+|\*+/?|#+) ?", "", piece.text)
        end = joined[-1].line + joined[-1].text.count("\n") if joined else -1
        if end + 1 == piece.line:
            joined[-1] = joined[-1]._replace(text=joined[-1].text + "\n" + text)
        else:
            joined.append(Piece("comment", piece.line, text))
    return joined
