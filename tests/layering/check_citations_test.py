#!/usr/bin/env python3
"""check_citations.py must find each planted violation, name its line, and pass a tree without any."""
import pathlib
import subprocess
import sys
import tempfile

CHECK = pathlib.Path(__file__).resolve().parent / "check_citations.py"

# A tree without findings: file -> content.
CLEAN = {
    "Makefile": "demo: packages\n\tdeploy/demo.sh\nweb-test:\n\techo\npackages:\n\techo\n",
    "CMakeLists.txt": "add_executable(pepesegd server/main.cc)\n",
    "README.md": "# Top\n\n[Running](deploy/OPERATIONS.md#file-descriptors--limits), "
                 "[here](#top), [out](https://x.y/z), `make demo web-test BUILD=x`\n\n"
                 "    make demo    # trains\n    build/bin/pepesegd --data x &\n\n"
                 "See core/query/segmenter.h, `query/segmenter.h`, core/query/segmenter, core/*.md,\n"
                 "core/{query,METHOD.md}, tests/NAME_test.cc, clients/web/gen and FOLDER/out.md.\n",
    "deploy/OPERATIONS.md": "# Operations\n\n## File descriptors & limits\n\n[up](../README.md)\n",
    "deploy/demo.sh": "#!/bin/sh\n# See OPERATIONS.md.\n",
    "core/METHOD.md": "# Method\n\n## 1. Rendering\n\n## 2. Scales\n",
    "core/query/segmenter.h": "// METHOD.md section 1 and 2.\n#include \"a.h\"\n"
                              "int a = 1'000;  // see core/METHOD.md\n",
    "tests/one_test.cc": "",
    "server/main.cc": "int main() {}  // run it as deploy/demo.sh does\n",
}
failures = []


def run(files):
    """Returns the exit status and the output for CLEAN with `files`."""
    with tempfile.TemporaryDirectory() as root:
        for name, content in {**CLEAN, **files}.items():
            path = pathlib.Path(root, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(content)
        done = subprocess.run([sys.executable, str(CHECK), root], text=True, capture_output=True)
        return done.returncode, done.stdout + done.stderr


def expect_found(file, content, message):
    code, output = run({file: content})
    if code != 1 or output.strip() != f"{file}:{message}":
        failures.append(f"not found: {file}:{message}\nexit {code}, output:\n{output}")


def expect_allowed(file, content):
    code, output = run({file: content})
    if code != 0 or output:
        failures.append(f"wrongly refused: {file}: {content!r}\nexit {code}, output:\n{output}")


def test_documents():
    expect_found("a.md", "# A\n[x](GONE.html)\n", "2: links GONE.html, which does not exist")
    expect_found("core/a.md", "[x](README)\n", "1: links README, which does not exist")
    expect_found("a.md", "[x](README.md#bottom)\n",
                 "1: links README.md#bottom; README.md has no such heading")
    expect_found("a.md", "[x](#b)\n", "1: links a.md#b; a.md has no such heading")
    expect_found("a.md", "one\n\n`core/query/gone.h`\n",
                 "3: cites core/query/gone.h, which does not exist")
    expect_found("a.md", "core/{query,gone}\n", "1: cites core/gone, which does not exist")
    expect_found("a.md", "tests/bench/*.md\n", "1: cites tests/bench/*.md, which does not exist")
    expect_found("a.md", "gone.h\n", "1: cites gone.h; no file has this name")
    expect_found("a.md", "x/segmenter.h\n", "1: cites x/segmenter.h; no file has this name")
    expect_found("a.md", "`make sense`\n", "1: cites `make sense`; the Makefile has no such target")
    expect_found("a.md", "\n    make gone\n", "2: cites `make gone`; the Makefile has no such target")
    expect_found("a.md", "build/bin/gone\n", "1: cites build/bin/gone; no CMakeLists.txt names it")
    expect_allowed("a.md", "They make sense, and build/bin/pepesegd runs.\n")
    expect_allowed("a.md", "[x](core), [y](core/METHOD.md#2-scales)\n")


def test_comments():
    expect_found("core/b.cc", "int a;\n// METHOD.md\n// section 7.\n",
                 "2: cites METHOD.md section 7, which does not exist")
    expect_found("core/b.cc", "/* see kernels/ops/gone.h */\n",
                 "1: cites kernels/ops/gone.h, which does not exist")
    expect_found("core/b.cu", "int a;  // GONE.md\n", "1: cites GONE.md; no file has this name")
    expect_found("deploy/b.sh", "true  # as deploy/gone.sh\n",
                 "1: cites deploy/gone.sh, which does not exist")
    expect_found("deploy/b.py", '"""As gone.py."""\n', "1: cites gone.py; no file has this name")
    expect_found("proto/b.proto", "// See server/gone/x.\n",
                 "1: cites server/gone/x, which does not exist")
    expect_found("core/CMakeLists.txt", "add_executable(pepesegd)  # `make gone`\n",
                 "1: cites `make gone`; the Makefile has no such target")
    expect_found("server/b.cc", 'const char* a = "see GONE.md";\n',
                 "1: a message cites GONE.md, which does not exist")
    expect_found("server/b.cc", '\nauto a = "run deploy/gone.sh, then";\n',
                 "2: a message cites deploy/gone.sh, which does not exist")
    expect_allowed("core/b.cc", 'auto url = "https://a.b/core/gone.h";\n#include "core/gone.h"\n')
    expect_allowed("tests/b_test.cc", 'auto a = "deploy/gone.sh";\n')
    expect_allowed("node_modules/a/b.md", "gone.h\n")


test_documents()
test_comments()
code, output = run({})
if code != 0 or output:
    failures.append(f"a clean tree: exit {code}, output:\n{output}")
sys.exit("\n".join(failures) or 0)
