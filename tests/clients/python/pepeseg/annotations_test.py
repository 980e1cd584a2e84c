"""Tests exports of annotations: every format has the masks that `segment` answers."""

import csv
import json
import re
import xml.etree.ElementTree
import zipfile

import numpy as np
from PIL import Image
import pytest

import pepeseg

VIEW = "frame-000000.jpg"
SIZE = (480, 640)


@pytest.fixture(scope="module")
def labelled(server, trained):
    """A client, and the masks of two labels by label and view; one has a hole in its own view."""
    client = pepeseg.Client(trained, server=server.address)
    first = client.label("cup", VIEW, points=[[440, 280]], threshold=0.2, text="mug.2")
    drawn = np.zeros(SIZE, bool)
    drawn[100:300, 200:420] = True
    drawn[150:200, 250:300] = False
    client.label("painted", VIEW, mask=drawn, text='a "box" & more')
    try:
        found = {
            id: {mask.view: mask.mask for mask in client.segment(label=id, targets="all").masks}
            for id in ("cup", "painted")
        }
        assert not found["painted"][VIEW][175, 275] and found["painted"][VIEW][120, 275]
        assert iou(found["cup"][VIEW], first.mask) > 0.8
        yield client, found
    finally:
        client.delete_label("cup")
        client.delete_label("painted")
        client.close()


def iou(a, b):
    return np.logical_and(a, b).sum() / max(1, np.logical_or(a, b).sum())


def filled(polygons):
    """Returns the pixels whose centre has an odd number of edges of a polygon to its left."""
    mask = np.zeros(SIZE, bool)
    centres = np.arange(SIZE[1]) + 0.5
    for polygon in polygons:
        ends = np.roll(polygon, -1, axis=0)
        for row in range(SIZE[0]):
            at = row + 0.5
            crosses = (polygon[:, 1] <= at) != (ends[:, 1] <= at)
            assert np.array_equal(polygon[crosses, 0], ends[crosses, 0]), "an edge is slanted"
            left = np.searchsorted(np.sort(polygon[crosses, 0]), centres)
            mask[row] |= left % 2 == 1
    return mask


def stem(view):
    return view.rpartition(".")[0]


def runs_by_columns(text):
    """Decodes COCO's compressed run lengths."""
    runs, at = [], 0
    while at < len(text):
        value, shift, more = 0, 0, True
        while more:
            digit = ord(text[at]) - 48
            value |= (digit & 31) << shift
            more, shift, at = digit & 32, shift + 5, at + 1
            if not more and digit & 16:
                value -= 1 << shift
        runs.append(value + runs[-2] if len(runs) > 2 else value)
    flat = np.repeat(np.arange(len(runs)) % 2 == 1, runs)
    return flat.reshape(SIZE[::-1]).T


def test_coco_has_the_masks(labelled, tmp_path):
    client, masks = labelled
    progress = []
    made = client.export_annotations(
        tmp_path / "coco", on_progress=lambda *done: progress.append(done)
    )
    assert made == pepeseg.AnnotationExport(tmp_path / "coco", 2, 15, "scenes/shelf/models/1")
    assert progress == [(8, 30), (16, 30), (23, 30), (30, 30)]
    assert [file.name for file in tmp_path.iterdir()] == ["coco"]
    coco = json.loads((tmp_path / "coco" / "annotations.json").read_text())
    names = {image["id"]: image["file_name"] for image in coco["images"]}
    assert len(names) == 15
    found = 0
    for annotation in coco["annotations"]:
        mask = runs_by_columns(annotation["segmentation"]["counts"])
        want = masks[annotation["label"]][names[annotation["image_id"]]]
        assert np.array_equal(mask, want)
        assert annotation["area"] == want.sum()
        found += 1
    assert found == sum(mask.any() for views in masks.values() for mask in views.values())
    assert {category["name"] for category in coco["categories"]} == {"mug", 'a "box" & more'}


def test_yolo_and_labelme_have_the_masks_as_polygons(labelled, tmp_path):
    client, masks = labelled
    client.export_annotations(tmp_path / "yolo", "yolo", targets="held-out")
    client.export_annotations(tmp_path / "labelme", "labelme", targets="held-out")
    with open(tmp_path / "yolo" / "tracks.csv", newline="") as file:
        tracks = list(csv.DictReader(file))
    held_out = [view.name for view in client.views() if view.held_out]
    assert len(list((tmp_path / "yolo" / "labels").iterdir())) == len(held_out)
    assert len(tracks) > 2
    ids = {"1": "cup", "2": "painted"}
    for track in tracks:
        lines = (tmp_path / "yolo" / track["file"]).read_text().splitlines()
        numbers = np.array(lines[int(track["line"]) - 1].split()[1:], float).reshape(-1, 2)
        polygon = np.round(numbers * SIZE[::-1], 3)
        view = track["file"].removeprefix("labels/").replace(".txt", ".jpg")
        assert np.array_equal(filled([polygon]), masks[ids[track["track_id"]]][view])
    for view in held_out:
        shapes = json.loads((tmp_path / "labelme" / f"{stem(view)}.json").read_text())["shapes"]
        for group, label in ((1, "cup"), (2, "painted")):
            polygons = [np.array(shape["points"]) for shape in shapes if shape["group_id"] == group]
            assert np.array_equal(filled(polygons), masks[label][view])


def test_pngs_have_the_masks(labelled, tmp_path):
    client, masks = labelled
    client.export_annotations(tmp_path / "masks", "masks", targets=[VIEW], labels=["painted"])
    assert [file.name for file in (tmp_path / "masks").iterdir() if file.is_dir()] == ["painted"]
    image = np.asarray(Image.open(tmp_path / "masks" / "painted" / f"{stem(VIEW)}.png"))
    assert np.array_equal(image, masks["painted"][VIEW] * np.uint8(255))
    client.export_annotations(tmp_path / "ids", "ids", targets=[VIEW])
    image = np.asarray(Image.open(tmp_path / "ids" / f"{stem(VIEW)}.png"))
    cup, painted = masks["cup"][VIEW], masks["painted"][VIEW]
    want = np.where(cup, 1, 0) if cup.sum() < painted.sum() else np.where(painted, 2, 0)
    want = np.where(want == 0, np.where(painted, 2, np.where(cup, 1, 0)), want)
    assert np.array_equal(image, want)


def test_cvat_has_the_masks_in_a_zip(labelled, tmp_path):
    client, masks = labelled
    made = client.export_annotations(tmp_path / "cvat.zip", "cvat", table=True)
    assert [file.name for file in tmp_path.iterdir()] == ["cvat.zip"]
    with zipfile.ZipFile(made.path) as files:
        assert files.testzip() is None
        assert files.namelist() == ["annotations.xml", "labels.json", "things.csv"]
        tree = xml.etree.ElementTree.fromstring(files.read("annotations.xml"))
        labels = json.loads(files.read("labels.json"))
        things = list(csv.DictReader(files.read("things.csv").decode().splitlines()))
    assert [label["name"] for label in labels] == ["mug", 'a "box" & more']
    assert [name.text for name in tree.iterfind("meta/task/labels/label/name")] == [
        label["name"] for label in labels
    ]
    assert re.fullmatch("#[0-9a-f]{6}", labels[0]["color"])
    seen = {"cup": 0, "painted": 0}
    for image in tree.iterfind("image"):
        assert (image.get("width"), image.get("height")) == ("640", "480")
        for mask in image.iterfind("mask"):
            track = mask.find("attribute[@name='track_id']").text
            label = {"1": "cup", "2": "painted"}[track]
            runs = [int(run) for run in mask.get("rle").split(",")]
            left, top, width, height = (
                int(mask.get(name)) for name in ("left", "top", "width", "height")
            )
            box = np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(height, width)
            read = np.zeros(SIZE, bool)
            read[top : top + height, left : left + width] = box
            assert np.array_equal(read, masks[label][image.get("name")])
            seen[label] += 1
    for thing in things:
        assert int(thing["views"]) == seen[thing["id"]] > 0
        assert int(thing["pixels"]) == sum(mask.sum() for mask in masks[thing["id"]].values())
        assert int(thing["gaussians"]) > 0
        assert float(thing["min_x"]) < float(thing["max_x"])


def test_all_segments_of_a_level_are_things(labelled, tmp_path):
    client, _ = labelled
    level = client.decompose().levels[1]
    made = client.export_annotations(
        tmp_path / "ids", "ids", segments=1, targets=[VIEW], table=True
    )
    assert (made.num_things, made.num_views) == (len(level.segments), 1)
    image = np.asarray(Image.open(tmp_path / "ids" / f"{stem(VIEW)}.png"))
    rendered = client.render(VIEW, content="segments", level=1)
    assert np.array_equal(image, rendered)
    with open(tmp_path / "ids" / "things.csv", newline="") as file:
        things = list(csv.DictReader(file))
    for thing, segment in zip(things, level.segments, strict=True):
        assert thing["id"] == f"1-{segment.id}" and thing["track_id"] == str(segment.id)
        assert thing["parent"] == f"2-{segment.parent}"
        assert thing["gaussians"] == str(segment.num_gaussians)
        assert int(thing["pixels"]) == (rendered == segment.id).sum()
        assert float(thing["max_z"]) == pytest.approx(segment.max[2])
    client.export_annotations(tmp_path / "masks", "masks", segments=1, targets=[VIEW])
    written = {file.parent.name for file in tmp_path.glob("masks/*/*.png")}
    assert written == {f"1-{id}" for id in np.unique(rendered) if id != 0}


def test_wrong_exports_leave_nothing(labelled, tmp_path):
    client, _ = labelled
    with pytest.raises(pepeseg.InvalidArgumentError, match="coco, yolo"):
        client.export_annotations(tmp_path / "none", "voc")
    with pytest.raises(pepeseg.NotFoundError, match="plate"):
        client.export_annotations(tmp_path / "none", labels=["plate"])
    with pytest.raises(pepeseg.InvalidArgumentError):
        client.export_annotations(tmp_path / "none", targets=["nothing.jpg"])
    with pytest.raises(pepeseg.InvalidArgumentError, match="level"):
        client.export_annotations(tmp_path / "none", segments=3)
    with pytest.raises(pepeseg.InvalidArgumentError, match="labels"):
        client.export_annotations(tmp_path / "none", segments=1, labels=["cup"])
    assert not list(tmp_path.iterdir())
