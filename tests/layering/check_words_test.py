#!/usr/bin/env python3
"""check_words.py must find each planted word, hold the allowances, and lower them on request."""
import pathlib
import shutil
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
FOLDER = "tests/layering"
failures = []


def expect(what, condition, output):
    if not condition:
        failures.append(f"{what}; output:\n{output}")


class Tree:
    """A tree with the glossary of this repository, these files and this allowance."""

    def __init__(self, files, allowance=""):
        self.folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self.folder.name)
        self.write(f"{FOLDER}/glossary_allowance.tsv", allowance)
        for name in ("check_words.py", "source_text.py", "glossary.tsv"):
            shutil.copy(HERE / name, self.root / FOLDER / name)
        for name, content in files.items():
            self.write(name, content)

    def write(self, name, content):
        (self.root / name).parent.mkdir(parents=True, exist_ok=True)
        (self.root / name).write_text(content)

    def run(self, *options):
        done = subprocess.run([sys.executable, str(HERE / "check_words.py"), str(self.root), *options],
                              text=True, capture_output=True)
        return done.returncode, done.stdout + done.stderr


def expect_found(file, content, line, word):
    code, output = Tree({file: content}).run()
    expect(f"not found: {word} in {file}", code == 1 and f'{file}:{line}: "{word}": write' in output,
           output)


def expect_allowed(file, content):
    code, output = Tree({file: content}).run()
    expect(f"wrongly refused: {content!r} in {file}", code == 0 and not output, output)


def test_where_words_are_found():
    expect_found("a.md", "One.\nLoaded anew.\n", 2, "anew")
    expect_found("core/a.h", "int a;\n// The client is told.\n", 2, "told")
    expect_found("core/a.h", "int a;\nint num_void_renders = 0;\n", 2, "void renders")
    expect_found("core/a.cc", "void AskForNewGrains();\n", 1, "Grains")
    expect_found("core/a.h", "// It is not heard\n// of.\n", 1, "not heard of")
    expect_found("core/a.cc", 'f("\\"a\\" is no checkpoint");\n', 1, "is no checkpoint")
    expect_found("core/a.cc", 'f(R"(two\nbeside)");\n', 2, "beside")
    expect_found("kernels/a.cu", "/* one\n   void render */\n", 2, "void render")
    expect_found("proto/a.proto", "message A {}  // Likewise.\n", 1, "Likewise")
    expect_found("deploy/a.sh", "echo 'a job goes on from here'\n", 1, "goes on from")
    expect_found("deploy/a.py", '"""Of a question."""\n', 1, "question")
    expect_found("deploy/a.py", "say(f'so many {x}')\n", 1, "so many")
    expect_found("clients/web/a.ts", "const a = `any more ${b}`;\n", 1, "any more")


def test_what_is_no_finding():
    expect_allowed("core/a.cc", "int toll = IsThatOfANewDatabase();\n#include \"told.h\"\n")
    expect_allowed("core/a.ts", "const told = question(anew);\n")
    expect_allowed("a.md", "There is no checkpoint. Besides, so many as can.\n")
    expect_allowed("core/a.h", "// Tells parts apart; the view in question; a stand-in.\n")
    expect_allowed("node_modules/a.md", "told\n")
    expect_allowed("tests/data/a.txt", "told\n")


def test_allowances():
    files = {"core/a.h": "// told, anew\n", "core/x/a.h": "// told\n"}
    code, output = Tree(files, "core\t2\ncore/x\t1\n").run()
    expect("an exact allowance is refused", code == 0 and not output, output)
    code, output = Tree(files, "core\t1\ncore/x\t1\n").run()
    expect("more than the allowance passes", code == 1 and "core: 2 words" in output
           and "core/x" not in output, output)
    code, output = Tree(files, "core\t2\n").run()
    expect("an allowance holds for a subfolder", code == 1 and "core/x: 1 words" in output, output)
    code, output = Tree(files, "core\t5\ncore/x\t1\ngone\t3\n").run()
    expect("a fall is not reported", code == 0 and "lower its allowance of 5" in output
           and "gone: 0 words" in output, output)
    tree = Tree(files, "core\t5\ncore/x\t0\ngone\t3\n")
    tree.run("--lower")
    kept = (tree.root / FOLDER / "glossary_allowance.tsv").read_text().splitlines()
    expect("--lower", [line for line in kept if line[0] != "#"] == ["core\t2"], "\n".join(kept))
    code, output = Tree(files, "core\t2\ncore/x\t1\n").run("--list", "core/x")
    expect("--list", code == 0 and output == 'core/x/a.h:1: "told": write reported\n', output)


def test_glossary_tests_itself():
    tree = Tree({f"{FOLDER}/glossary.tsv": "told\treported\tsaid\n"})
    code, output = tree.run()
    expect("an expression that misses its example", code == 1 and "does not match" in output, output)


test_where_words_are_found()
test_what_is_no_finding()
test_allowances()
test_glossary_tests_itself()
sys.exit("\n".join(failures) or 0)
