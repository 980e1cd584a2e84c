#!/usr/bin/env python3
"""check_folders.py must find each planted violation, name its line, and pass a tree without any."""
import os
import pathlib
import subprocess
import sys
import tempfile

CHECK = pathlib.Path(__file__).resolve().parent / "check_folders.py"
TABLE = "ARCHITECTURE.md"
KNOWN = "tests/layering/known_cycles.txt"

# A tree without findings: file -> what it includes.
CLEAN = {
    "core/base/a.h": [],
    "core/query/a.h": ["core/base/a.h"],
    "core/train/a.h": ["core/query/a.h", "core/base/a.h"],
    "server/main.cc": ["server/rpc/a.h"],
    "server/rpc/a.h": ["core/query/a.h", "pepeseg/v1/scene.grpc.pb.h"],
    "proto/pepeseg/v1/scene.proto": [],
}
ROWS = [
    "| `core/base` | Base. | |",
    "| `core/query` | Query. | `base` |",
    "| `core/train` | Training. | `base`, `query` |",
    "| `server` | Assembly. | `rpc` |",
    "| `server/rpc` | Calls. | `core/query`, `proto` |",
]
failures = []


def write_tree(root, files):
    for name, content in files.items():
        path = pathlib.Path(root, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, list):
            content = "#pragma once\n" + "".join(f'#include "{name}"\n' for name in content)
        path.write_text(content)


def run(files, rows):
    """Returns the exit status and the output for CLEAN with `files` and these rows."""
    with tempfile.TemporaryDirectory() as root:
        table = "| Folder | What it is | May include |\n|---|---|---|\n" + "\n".join(rows) + "\n"
        write_tree(root, {**CLEAN, TABLE: table, **files})
        done = subprocess.run([sys.executable, str(CHECK), root], text=True, capture_output=True)
        return done.returncode, done.stdout + done.stderr


def expect_found(what, files, *words, rows=()):
    """`words` are in the output and the check fails; `rows` replace those of the same folders."""
    code, output = run(files, changed(rows))
    missing = [word for word in words if word not in output]
    if code != 1 or missing:
        failures.append(f"not found: {what}: exit {code}, lacks {missing}, output:\n{output}")


def expect_allowed(what, files, rows=()):
    code, output = run(files, changed(rows))
    if code != 0 or output:
        failures.append(f"wrongly refused: {what}: exit {code}, output:\n{output}")


def changed(rows):
    replaced = " ".join(row.split("|")[1] for row in rows)
    return [row for row in ROWS if row.split("|")[1].strip() not in replaced] + list(rows)


def test_cycles():
    expect_allowed("a clean tree", {})
    expect_found("two folders that include each other", {"core/base/b.h": ["core/query/a.h"]},
                 "cycle between folders: core/base, core/query",
                 "core/base/b.h:2: includes core/query/a.h",
                 "core/query/a.h:2: includes core/base/a.h",
                 rows=["| `core/base` | Base. | `query` |"])
    expect_found("a cycle of three", {"core/base/b.cc": ["core/train/a.h"]},
                 "cycle between folders: core/base, core/query, core/train",
                 rows=["| `core/base` | Base. | `train` |"])
    expect_found("a folder's own files and a subfolder", {"server/rpc/b.cc": ["server/flags.h"],
                                                          "server/flags.h": []},
                 "cycle between folders: server (own files), server/rpc",
                 rows=["| `server/rpc` | Calls. | `core/query`, `proto`, `server` |"])
    expect_found("folders two levels down", {"server/rpc/x/a.h": ["server/rpc/y/a.h"],
                                             "server/rpc/y/a.h": [],
                                             "server/rpc/y/b.cc": ["server/rpc/x/a.h"]},
                 "cycle between folders: server/rpc/x, server/rpc/y",
                 rows=["| `server/rpc/x` | X. | `rpc/y` |", "| `server/rpc/y` | Y. | `rpc/x` |"])
    expect_found("a cycle of top folders by different subfolders",
                 {"core/base/b.cc": ["server/rpc/a.h"]},
                 "cycle between folders: core, server",
                 rows=["| `core/base` | Base. | `server/rpc` |"])
    expect_found("folders of tests", {"tests/core/a.h": ["tests/server/a.h"], "tests/server/a.h": [],
                                      "tests/server/b.cc": ["tests/core/a.h"]},
                 "cycle between folders: tests/core, tests/server")
    expect_found("an include with spaces and angle brackets",
                 {"core/base/b.h": "#pragma once\n#  include <core/query/a.h>\n"},
                 "cycle between folders: core/base, core/query", "core/base/b.h:2",
                 rows=["| `core/base` | Base. | `query` |"])
    expect_allowed("folders that count as one",
                   {"core/base/b.h": ["core/query/a.h"]},
                   rows=["| `core/base`, `core/query` | Both. | |",
                         "| `core/train` | Training. | `base` |",
                         "| `server/rpc` | Calls. | `core/base`, `proto` |"])


def test_known_cycles():
    both = {"core/base/b.h": ["core/query/a.h"]}
    rows = ["| `core/base` | Base. | `query` |"]
    expect_allowed("a known cycle", {**both, KNOWN: "# for now\ncore/base, core/query\n"}, rows)
    expect_found("a larger cycle than the known one", {"core/base/b.h": ["core/train/a.h"],
                                                       KNOWN: "core/base, core/query\n"},
                 "cycle between folders: core/base, core/query, core/train",
                 "there is no such cycle: core/base, core/query",
                 rows=["| `core/base` | Base. | `train` |"])
    expect_found("a known cycle that is gone", {KNOWN: "core/base, core/query\n"},
                 "there is no such cycle: core/base, core/query")
    expect_found("a list without a cycle", {KNOWN: "# none\n"}, "remove the file")


def test_arrows():
    expect_found("an arrow that is not declared", {"server/rpc/b.cc": ["core/train/a.h"]},
                 "server/rpc may not include core/train: server/rpc/b.cc:2")
    expect_found("a contract where it is not declared",
                 {"core/base/b.cc": ["pepeseg/v1/scene.pb.h"]}, "core/base may not include proto")
    expect_found("a declared arrow that nothing makes", {},
                 "core/train does not include server/rpc; remove the arrow",
                 rows=["| `core/train` | Training. | `base`, `query`, `server/rpc` |"])
    expect_found("a folder without a row", {"core/new/a.h": []}, "core/new has no row")
    expect_found("a row without a folder", {}, "there are no sources in core/old",
                 rows=["| `core/old` | Old. | |"])
    expect_found("an include of a file that does not exist",
                 {"core/query/b.cc": ["core/base/gone.h"]},
                 "core/query/b.cc:2: includes core/base/gone.h, which does not exist")
    expect_allowed("a file beside the one that includes it", {"core/query/b.cc": ["a.h"]})
    expect_allowed("headers of others", {"core/query/b.cc": ["absl/status/status.h"]})


def test_sentences():
    expect_found("a row without a sentence", {}, "core/query has no sentence",
                 rows=["| `core/query` | | `base` |"])
    expect_found("a word that is no sentence", {}, "core/query has no sentence",
                 rows=["| `core/query` | ? | `base` |"])
    expect_found("two rows of one folder", {}, "core/query has 2 rows",
                 rows=["| `core/query` | Query. | `base` |", "| `core/query` | Masks. | `base` |"])


def test_repository_lists():
    """Run on this repository, the check must see its files: it would pass an empty tree."""
    root = CHECK.parents[2]
    done = subprocess.run([sys.executable, str(CHECK), str(root), "--print"], text=True,
                          capture_output=True)
    for row in ("| `core/query` |", "| `kernels/cuda` |", "| `server` |", "| `clients/cli` |"):
        if row not in done.stdout:
            failures.append(f"--print lacks {row} in {os.fspath(root)}")


test_cycles()
test_known_cycles()
test_arrows()
test_sentences()
test_repository_lists()
print("\n".join(failures), end="\n" if failures else "")
sys.exit(1 if failures else 0)
