#!/usr/bin/env python3
"""Runs the documents' commands, word for word, against a real server on the example scene.

    readme_commands_test.py REPOSITORY FOLDER_OF_PROGRAMS [OPTION OF train...]

Runs the indented blocks below "<!-- tests run this -->" lines of README.md and then of
clients/cli/README.md in their order, in a folder that looks like the repository. Every command must
exit with 0 and leave the files it promises; so must the commands that `upload` and `train` say to
type next. Options given here are added to `train`. Two things differ from the documents, and neither
is in a command: the server listens on a free port with its data in the test's folder, and its worker
does fewer steps.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time

MARKER = "<!-- tests run this -->"
PAGES = ("README.md", "clients/cli/README.md")
STEPS = {"reconstruct": 150, "features": 150}
VIEWS = 15
SIZE = (640, 480)  # of the photographs, and so of every mask

WORKER = """#!{python}
# Runs the worker with fewer steps than the job's preset has.
import json, os, sys
arguments = dict(word.split("=", 1) for word in sys.argv[1:] if "=" in word)
spec_path = os.path.join(arguments["--job"], "spec-" + arguments["--fence"] + ".json")
with open(spec_path) as file:
    spec = json.load(file)
for stage, steps in {steps}.items():
    spec["options"][stage]["numSteps"] = steps
with open(spec_path, "w") as file:
    json.dump(spec, file)
os.execv({worker!r}, [{worker!r}] + sys.argv[1:])
"""

SERVER = """#!{python}
# Runs the server with the given arguments, except for its port and its data.
import os, sys
words = [w.replace("127.0.0.1:50051", "127.0.0.1:0").replace("/var/tmp/pepeseg", {data!r})
         for w in sys.argv[1:]]
for name, value in (("--listen", "127.0.0.1:0"), ("--data", {data!r})):
    if not any(w.split("=")[0] == name for w in words):
        words += [name, value]
words += ["--port-file", {port!r}, "--worker", {worker!r}]
os.execv({server!r}, [{server!r}] + words)
"""


def fail(text: str) -> None:
    sys.exit(f"FAILED: {text}")


def blocks(readme: str) -> list[list[str]]:
    """Returns the commands of each marked block."""
    found: list[list[str]] = []
    lines = iter(readme.splitlines())
    for line in lines:
        if line.strip() != MARKER:
            continue
        block: list[str] = []
        for line in lines:
            if line.startswith("    "):
                block.append(line.strip())
            elif block and line.strip():
                break
        found.append(block)
    return found


class Place:
    """A folder in which the documents' paths exist."""

    def __init__(self, repository: Path, programs: Path, folder: Path) -> None:
        self.folder = folder
        self.port = folder / "port"
        built = folder / "build" / "bin"
        built.mkdir(parents=True)
        (folder / "tests").symlink_to(repository / "tests")
        (built / "pepeseg").symlink_to(programs / "pepeseg")
        worker = folder / "short-worker"
        self._write(worker, WORKER, steps=STEPS, worker=str(programs / "pepeseg-worker"))
        self._write(
            built / "pepesegd",
            SERVER,
            data=str(folder / "data"),
            port=str(self.port),
            worker=str(worker),
            server=str(programs / "pepesegd"),
        )
        self.environment = {
            **{k: v for k, v in os.environ.items() if not k.startswith("PEPESEG_")},
            "PATH": f"{built}:{os.environ['PATH']}",
            "HOME": str(folder),
            "XDG_DATA_HOME": str(folder / "xdg"),
        }
        self.server: subprocess.Popen[bytes] | None = None

    @staticmethod
    def _write(path: Path, text: str, **values: object) -> None:
        path.write_text(text.format(python=sys.executable, **values))
        path.chmod(0o755)

    def start_server(self, command: str) -> None:
        with open(self.folder / "server.log", "wb") as log:
            self.server = subprocess.Popen(
                ["bash", "-c", "exec " + command.removesuffix("&")],
                cwd=self.folder,
                env=self.environment,
                stdout=log,
                stderr=log,
            )
        end = time.monotonic() + 60
        while not (self.port.exists() and self.port.read_text().strip()):
            if self.server.poll() is not None or time.monotonic() > end:
                fail(f"{command}: {(self.folder / 'server.log').read_text()}")
            time.sleep(0.05)
        self.environment["PEPESEG_SERVER"] = f"127.0.0.1:{self.port.read_text().strip()}"

    def run(self, command: str) -> str:
        """Runs the command. Returns its standard output; exits if it fails."""
        print(f"$ {command}", flush=True)
        ran = subprocess.run(
            ["bash", "-c", command],
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        if ran.returncode != 0:
            log = self.folder / "server.log"
            tail = log.read_text()[-2000:] if log.exists() else ""
            fail(f"{command}: exit code {ran.returncode}\n{ran.stdout}{ran.stderr}\n{tail}")
        return ran.stdout

    def stop(self) -> None:
        if self.server is None:
            return
        self.server.send_signal(signal.SIGTERM)
        try:
            self.server.wait(30)
        except subprocess.TimeoutExpired:
            self.server.kill()
            self.server.wait()


def png_head(path: Path) -> tuple[int, int, int, int]:
    """Returns width, height, bits and colour type (0: grey, 2: RGB)."""
    head = path.read_bytes()[:26]
    if head[:8] != b"\x89PNG\r\n\x1a\n":
        fail(f"{path} is not a PNG")
    width, height, bits, colour = struct.unpack(">IIBB", head[16:26])
    return width, height, bits, colour


def expect_pngs(folder: Path, pattern: str, count: int, bits: int, colour: int) -> None:
    found = sorted(folder.glob(pattern))
    if len(found) != count:
        fail(f"{folder}/{pattern}: {len(found)} files, not {count}")
    for path in found:
        if png_head(path) != (*SIZE, bits, colour):
            fail(f"{path}: {png_head(path)}, not {(*SIZE, bits, colour)}")


def expect_ply(path: Path) -> int:
    """Returns the number of Gaussians of a PLY; exits if it is not one."""
    with open(path, "rb") as file:
        head = file.read(400)
    if not head.startswith(b"ply\n"):
        fail(f"{path} is not a PLY")
    return int(head.split(b"element vertex ")[1].split()[0])


def check_files(folder: Path) -> None:
    """Checks the files that the documents promise."""
    expect_pngs(folder / "masks", "*_mask.png", VIEWS, 8, 0)
    expect_pngs(folder / "masks", "*_overlay.png", VIEWS, 8, 2)
    whole = expect_ply(folder / "shelf.ply")
    if not sorted((folder / "answers").glob("*_1.png")):
        fail("propose left no pictures")
    if not sorted((folder / "pictures").glob("*_selection.png")):
        fail("select left no picture")
    if not 0 < expect_ply(folder / "without-tissues.ply") < whole:
        fail("without-tissues.ply lacks nothing, or all")
    segments = sorted((folder / "parts").glob("level_*/segment_*.ply"))
    if not segments or sum(expect_ply(path) for path in segments) > whole:
        fail(f"decompose left {len(segments)} segments")
    expect_pngs(folder / "parts", "*_ids.png", VIEWS, 16, 0)
    expect_pngs(folder / "parts", "*_colors.png", VIEWS, 8, 2)


def next_command(output: str, of: str) -> str:
    lines = [line for line in output.splitlines() if line.startswith("Next: ")]
    if len(lines) != 1:
        fail(f"{of} says {len(lines)} times what is next")
    return lines[0].removeprefix("Next: ")


def run_all(place: Place, commands: list[str], options: list[str]) -> None:
    for command in commands:
        if command.split("#")[0].rstrip().endswith("&"):
            place.start_server(command.split("#")[0].rstrip())
            continue
        words = command.split()
        verb = words[1] if words[0].endswith("pepeseg") else ""
        if verb == "train":
            command = " ".join([command, *options])
        output = place.run(command)
        if verb == "upload" and next_command(output, verb) != f"{words[0]} train {words[2]}":
            fail(f"upload: {output}")
        if verb == "train":
            place.run(next_command(output, verb))
            shutil.rmtree(place.folder / "masks")


def main() -> None:
    repository, programs = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    found = [block for page in PAGES for block in blocks((repository / page).read_text())]
    commands = [command for block in found for command in block]
    if len(found) != 2 or len(found[0]) != 5 or len(found[1]) < 7:
        fail(f"{PAGES} have other marked blocks than expected: {json.dumps(found, indent=1)}")
    with tempfile.TemporaryDirectory() as folder:
        place = Place(repository, programs, Path(folder))
        try:
            run_all(place, commands, sys.argv[3:])
            check_files(place.folder)
        finally:
            place.stop()
    print("every command does what the documents say")


if __name__ == "__main__":
    main()
