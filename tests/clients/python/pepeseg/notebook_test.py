"""Tests that the notebook runs from its first cell to its last."""

import ast
import io
import json

from PIL import Image

from conftest import ROOT

NOTEBOOK = ROOT / "clients" / "python" / "notebooks" / "shelf.ipynb"


def run_cell(source, names):
    """Runs a cell as a notebook does: it shows the value of its last expression."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, NOTEBOOK.name, "exec"), names)
    return eval(compile(ast.Expression(last.value), NOTEBOOK.name, "eval"), names) if last else None


def test_runs_end_to_end_on_the_shelf(server, monkeypatch, tmp_path):
    monkeypatch.setenv("PEPESEG_SERVER", server.address)
    # It writes files in the current folder: here a folder from which it finds the scene, too.
    (tmp_path / "tests" / "data").mkdir(parents=True)
    (tmp_path / "tests" / "data" / "apc_shelf").symlink_to(ROOT / "tests/data/apc_shelf")
    monkeypatch.chdir(tmp_path)
    notebook = json.loads(NOTEBOOK.read_text())
    names = {}
    shown = []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [] and cell["execution_count"] is None
            shown.append(run_cell("".join(cell["source"]), names))
    pictures = [thing._repr_png_() for thing in shown if hasattr(thing, "_repr_png_")]
    assert len(pictures) == 5
    for picture in pictures:
        image = Image.open(io.BytesIO(picture))
        image.load()
        assert image.size == (640, 480) and image.getextrema() != ((0, 0),) * 3
    assert (tmp_path / "product.ply").read_bytes()[:3] == b"ply"
