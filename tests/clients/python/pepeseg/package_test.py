"""Tests the package: stubs, wheel, command line."""

import ast
import filecmp
import inspect
from pathlib import Path
import re
import shutil
import subprocess
import sys
import zipfile

import numpy as np
from PIL import Image
import pytest

import pepeseg
from conftest import ROOT, SHELF
from pepeseg.__main__ import main

PACKAGE = ROOT / "clients" / "python" / "pepeseg"
MODULES = sorted((PACKAGE / "pepeseg").glob("*.py"))


def test_the_stubs_match_the_contract(tmp_path):
    (tmp_path / "pepeseg").mkdir()
    subprocess.run([PACKAGE / "generate_stubs.sh", tmp_path], check=True)
    fresh = sorted(path.name for path in (tmp_path / "pepeseg/v1").iterdir())
    shipped = [p.name for p in (PACKAGE / "pepeseg/v1").iterdir() if p.name != "__pycache__"]
    assert fresh == sorted(shipped)
    _, different, unread = filecmp.cmpfiles(
        tmp_path / "pepeseg/v1", PACKAGE / "pepeseg/v1", fresh, shallow=False
    )
    assert not different and not unread, "run clients/python/pepeseg/generate_stubs.sh"


def test_the_version_is_that_of_the_project():
    cmake = (ROOT / "CMakeLists.txt").read_text()
    assert f"project(pepeseg VERSION {pepeseg.__version__} " in cmake


def test_the_asyncio_client_comes_with_the_package():
    code = "import pepeseg; pepeseg.aio.Client; assert 'aio' in dir(pepeseg)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_needs_only_grpc_protobuf_numpy_and_pillow():
    allowed = {"grpc", "google", "numpy", "PIL", "pepeseg", *sys.stdlib_module_names}
    found = set()
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found.update(alias.name.partition(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                found.add(node.module.partition(".")[0])
    assert found - allowed == {"tqdm"}  # used where it is there


def test_progress_is_printed_without_tqdm(monkeypatch, capsys):
    from pepeseg.progress import Bar

    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    bar = Bar("step")
    for step in range(1, 101):
        bar.show("features", step, 100)
    assert capsys.readouterr().err.splitlines() == [
        "features: 1/100 step",
        "features: 100/100 step",
    ]


def test_everything_public_has_a_docstring():
    for name in pepeseg.__all__:
        thing = getattr(pepeseg, name)
        assert inspect.getdoc(thing), name
        for part, value in vars(thing).items() if inspect.isclass(thing) else ():
            if inspect.isfunction(value) and not part.startswith("_"):
                assert inspect.getdoc(value), f"{name}.{part}"


def test_the_wheel_is_complete_and_runs(tmp_path):
    source = tmp_path / "source"
    shutil.copytree(PACKAGE, source, ignore=shutil.ignore_patterns("__pycache__", ".mypy_cache"))
    build = "import setuptools.build_meta as b, sys; b.build_wheel(sys.argv[1])"
    subprocess.run(
        [sys.executable, "-c", build, tmp_path], cwd=source, check=True, capture_output=True
    )
    (wheel,) = tmp_path.glob("pepeseg-*-py3-none-any.whl")
    assert wheel.name.split("-")[1] == pepeseg.__version__
    names = set(zipfile.ZipFile(wheel).namelist())
    for path in [*MODULES, *(PACKAGE / "pepeseg" / "v1").glob("*.py*")]:
        assert path.relative_to(PACKAGE).as_posix() in names
    assert "pepeseg/py.typed" in names
    done = subprocess.run(
        [sys.executable, "-m", "pepeseg", "--help"],
        env={"PYTHONPATH": str(wheel), "PATH": "/usr/bin:/bin"},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    for verb in ("upload", "train", "watch", "segment", "propose", "select", "export"):
        assert re.search(rf"^ +{verb} ", done.stdout, re.MULTILINE), verb


class TestCommandLine:
    def run(self, server, *arguments):
        return main(["--server", server.address, *map(str, arguments)])

    def test_a_click_gives_masks_and_a_ply(self, server, trained, tmp_path, capsys):
        ask = ["segment", trained, "--view", "frame-000000.jpg", "-p", "110,70"]
        views = ["--views", "held-out", "--out", tmp_path]
        assert self.run(server, *ask, "--threshold", "0.3", *views) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0].startswith("scenes/shelf/models/1  scale ")
        mask = np.asarray(Image.open(tmp_path / "frame-000000_mask.png"))
        assert f"  frame-000000.jpg  {(mask > 0).sum()} px" in lines[1]
        ply = tmp_path / "cup.ply"
        select = ["select", trained, "--view", "frame-000000.jpg", "-p", "110,70"]
        assert self.run(server, *select, "--export", ply) == 0
        assert ply.read_bytes()[:3] == b"ply"
        number = re.search(r"selections/(\d+)", capsys.readouterr().out).group(1)
        assert self.run(server, "export", trained, ply, "--selection", number, "--without") == 0
        assert self.run(server, "views", trained) == 0
        assert "frame-000000.jpg  160x120  held out" in capsys.readouterr().out
        assert self.run(server, "propose", *select[1:]) == 0
        assert self.run(server, "scenes") == 0

    def test_exit_codes_are_those_of_the_cpp_client(self, server, trained, tmp_path, capsys):
        assert self.run(server, "watch", "jobs/j999") == 3
        assert self.run(server, "upload", trained, tmp_path / "none") == 3
        assert self.run(server, "segment", trained, "--view", "x.jpg", "-p", "1,1") == 4
        assert self.run(server, "train", trained, "-o", "steps=1") == 4
        assert self.run(server, "views", "untrained") == 3
        assert "pepeseg: " in capsys.readouterr().err
        with pytest.raises(SystemExit) as usage:
            self.run(server, "segment", trained, "-p", "1")
        assert usage.value.code == 2

    def test_upload_train_and_watch(self, server, tmp_path, capsys):
        small = ["--steps", 20, "--feature-steps", 10, "--image-scale", 0.125]
        assert self.run(server, "upload", "line", SHELF, "--layout", "colmap") == 0
        assert self.run(server, "train", "line", *small, "-o", "features.num_pixels=50") == 0
        assert "Gaussians  psnr" in capsys.readouterr().out
        assert self.run(server, "train", "line", *small, "--detach") == 0
        job = capsys.readouterr().out.strip()
        assert self.run(server, "cancel", job) == 0
        assert self.run(server, "watch", job) in (0, 8)
