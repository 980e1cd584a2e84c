"""Tests evaluations against a second implementation of the metrics, on masks that the server
returns for the scale and the threshold that the evaluation names."""

import asyncio
from pathlib import Path

import numpy as np
from PIL import Image
import pytest

import pepeseg
from conftest import SHELF
from pepeseg import aio

NAMES = {48: "stems", 114: "book.1", 132: "tissues", 144: "book.2"}
TENTH_OF_A_POINT = 1e-3


def in_view(path):
    """Returns an image of the photograph's size, 640x480, at that of the view, 160x120."""
    image = np.asarray(Image.open(path))
    assert image.shape == (480, 640)
    return image[2::4, 2::4]


@pytest.fixture
def truth(client):
    held_out = [view.name for view in client.views() if view.held_out]
    assert len(held_out) >= 2
    return {view: in_view(SHELF / "labels" / Path(view).with_suffix(".png")) for view in held_out}


@pytest.fixture
def ignore():
    return in_view(SHELF / "ignore_mask.png") != 0


def eroded(mask):
    wide = np.pad(mask, 1)
    height, width = mask.shape
    return np.all(
        [wide[y : y + height, x : x + width] for y in range(3) for x in range(3)], axis=0
    )


def boundary(mask):
    inside = mask
    for _ in range(max(1, round(0.02 * np.hypot(*mask.shape)))):
        inside = eroded(inside)
    return mask & ~inside


def iou(a, b, counts):
    union = ((a | b) & counts).sum()
    return (a & b & counts).sum() / union if union else 1.0


def scores_of(found, wanted, counts):
    """Returns IoU, accuracy and boundary IoU. What is found where nothing counts makes no
    boundary."""
    found = np.where(counts, found, wanted)
    return (
        iou(found, wanted, counts),
        (found == wanted)[counts].mean(),
        iou(boundary(found), boundary(wanted), counts),
    )


def as_tuple(scores):
    return scores.iou, scores.accuracy, scores.boundary_iou


def mean_of(rows):
    return tuple(np.mean(list(rows), axis=0))


def expect_scores(client, entity, points, truth, counts, name):
    """Compares each choice with the masks of `segment` at its scale and threshold."""
    ids = {name: id for id, name in NAMES.items()}
    views = list(entity.num_pixels)
    for choice in (getattr(entity, name), entity.automatic, entity.paper):
        found = client.segment(
            entity.reference_view,
            points=points,
            scale=choice.scale,
            threshold=choice.threshold,
            targets=views,
            frame="view",
        )
        rows = {
            mask.view: scores_of(mask.mask, truth[mask.view] == ids[entity.name], counts)
            for mask in found.masks
        }
        for view in views:
            assert as_tuple(choice.views[view]) == pytest.approx(rows[view], abs=TENTH_OF_A_POINT)
        assert as_tuple(choice.mean) == pytest.approx(
            mean_of(rows.values()), abs=TENTH_OF_A_POINT
        )


class TestEvaluate:
    def test_agrees_with_a_second_scorer(self, client, truth, ignore):
        result = client.evaluate(truth, names=NAMES, ignore=ignore, frame="view")
        assert set(result.entities) == set(NAMES.values()) and not result.left_out
        ids = {name: id for id, name in NAMES.items()}
        for entity in result.entities.values():
            assert entity.reference_view == min(truth)
            assert list(entity.num_pixels) == sorted(truth)[1:]
            for view, count in entity.num_pixels.items():
                assert count == ((truth[view] == ids[entity.name]) & ~ignore).sum()
            assert not entity.missing
            (click,) = entity.clicks
            column, row = int(click.x), int(click.y)
            assert truth[entity.reference_view][row, column] == ids[entity.name]
            points = [[click.x, click.y]]
            expect_scores(client, entity, points, truth, ~ignore, "reference")
        for name in ("paper", "reference", "automatic"):
            means = [as_tuple(getattr(entity, name).mean) for entity in result.entities.values()]
            assert as_tuple(getattr(result.scene, name)) == pytest.approx(mean_of(means))
        books = [as_tuple(result.entities[f"book.{i}"].paper.mean) for i in (1, 2)]
        assert result.categories["book"].num_entities == 2
        assert as_tuple(result.categories["book"].paper) == pytest.approx(mean_of(books))

    def test_the_best_choice_bounds_the_others_on_plain_masks(self, client, truth, ignore):
        plain = {"refine_borders": False}
        result = client.evaluate(truth, names=NAMES, ignore=ignore, options=plain, frame="view")
        for entity in result.entities.values():
            assert entity.paper.mean.iou >= entity.reference.mean.iou - 1e-9
            assert max(entity.iou_by_scale) <= entity.paper.mean.iou + 1e-9

    def test_points_are_prompts_of_the_reference(self, client, truth, ignore):
        reference, *_, scored = sorted(truth)
        rows, columns = np.nonzero((truth[reference] == 144) & ~ignore)
        middle = len(rows) // 2
        points = [[columns[i] + 0.5, rows[i] + 0.5] for i in (middle // 2, middle)]
        # The view of the prompt has no truth: nothing is known there to choose by.
        result = client.evaluate(
            {scored: truth[scored]},
            names=NAMES,
            entity_prompts={"book.2": pepeseg.Prompt(reference, points=points)},
            ignore={scored: ignore},
            options={"scales": [0.2, 0.5, 0.8], "thresholds": [0.3, 0.6]},
            frame="view",
        )
        entity = result.entities["book.2"]
        assert (entity.reference_view, entity.reference) == (reference, None)
        assert result.scales == (0.2, 0.5, 0.8) and len(entity.iou_by_scale) == 3
        if not entity.missing:
            expect_scores(client, entity, points, {scored: truth[scored]}, ~ignore, "paper")

    def test_masks_may_overlap_and_are_read_in_the_photograph(self, client):
        masks = {}
        for view in (view.name for view in client.views() if view.held_out):
            labels = np.asarray(Image.open(SHELF / "labels" / Path(view).with_suffix(".png")))
            masks[view] = {"book.2": labels == 144, "books": (labels == 114) | (labels == 144)}
        result = client.evaluate(masks, score_reference=True)
        assert set(result.entities) == {"book.2", "books"}
        assert set(result.entities["books"].num_pixels) == set(masks)
        click = result.entities["book.2"].clicks[0]
        assert masks[min(masks)]["book.2"][int(click.y), int(click.x)]

    @pytest.mark.parametrize(
        "protocol", ["label-propagation", "label-propagation-pixels", "promptable"]
    )
    def test_protocols_of_a_mask(self, client, truth, protocol):
        reference = min(truth)
        result = client.evaluate(
            truth,
            protocol=protocol,
            names=NAMES,
            own_masks={name: reference for name in NAMES.values()},
            options={"refine_borders": False},
            frame="view",
        )
        thresholds = {entity.paper.threshold for entity in result.entities.values()}
        assert thresholds <= {0.9 if protocol == "promptable" else 0.7, 0.0}
        for entity in result.entities.values():
            assert entity.paper.mean.iou >= entity.reference.mean.iou
            assert max(entity.iou_by_scale) == pytest.approx(entity.paper.mean.iou)

    def test_void_pixels_are_left_out(self, client, truth):
        largest = {view: np.argmax(np.bincount(ids.ravel())[1:]) + 1 for view, ids in truth.items()}
        void = {view: np.where(ids == largest[view], 255, ids) for view, ids in truth.items()}
        num_void = sum((ids == 255).sum() for ids in void.values())
        result = client.evaluate(void, frame="view")
        assert "255" not in {*result.entities, *result.left_out}
        assert result.num_void_pixels == num_void > 0
        named = client.evaluate(void, names={255: "mug"}, frame="view")
        assert "mug" in {*named.entities, *named.left_out}
        assert named.num_void_pixels == 0
        ignored = client.evaluate(truth, names=NAMES, ignore_label=48, frame="view")
        assert "stems" not in {*ignored.entities, *ignored.left_out}
        assert ignored.num_void_pixels == sum((ids == 48).sum() for ids in truth.values())
        with pytest.raises(pepeseg.InvalidArgumentError, match="ignore_label"):
            client.evaluate(truth, ignore_label=0, frame="view")

    def test_clicks_are_counted(self, client, truth, ignore):
        result = client.evaluate(
            truth,
            protocol="clicks",
            names=NAMES,
            ignore=ignore,
            options={"clicks.max_clicks": 4, "clicks.min_iou": 0.8},
            frame="view",
        )
        counts = [entity.num_clicks for entity in result.entities.values()]
        assert result.scene.num_clicks == pytest.approx(np.mean(counts))
        for entity in result.entities.values():
            assert entity.paper is None and 1 <= entity.num_clicks <= 4
            ious = [click.reference_iou for click in entity.clicks]
            assert entity.reached == (max(ious) >= 0.8)
            if entity.reached:
                assert ious[entity.num_clicks - 1] >= 0.8 > max(ious[: entity.num_clicks - 1] + [0])

    def test_both_clients_return_the_same(self, server, trained, client, truth):
        async def ask():
            async with aio.Client(trained, server=server.address) as awaited:
                return await awaited.evaluate(truth, frame="view")

        blocking = client.evaluate(truth, frame="view")
        awaited = asyncio.run(ask())
        assert awaited.entities == blocking.entities
        assert awaited.scene == blocking.scene

    def test_refusals_name_the_field(self, client, truth):
        with pytest.raises(pepeseg.InvalidArgumentError) as caught:
            client.evaluate({"nowhere.jpg": next(iter(truth.values()))})
        assert caught.value.field == "views[0].view"
        trained = next(view.name for view in client.views() if not view.held_out)
        with pytest.raises(pepeseg.InvalidArgumentError, match="was trained on"):
            client.evaluate({trained: next(iter(truth.values()))}, frame="view")
        with pytest.raises(pepeseg.InvalidArgumentError, match="options.clicks.min_iou is 2"):
            client.evaluate(truth, options={"clicks.min_iou": 2.0}, frame="view")
        for options in ({"no_such": 1}, {"clicks.no_such": 1}, {"min_pixels": "many"}):
            with pytest.raises(pepeseg.InvalidArgumentError, match='option "'):
                client.evaluate(truth, options=options, frame="view")
        with pytest.raises(pepeseg.InvalidArgumentError, match="exactly one"):
            client.evaluate(truth, entity_prompts={"48": pepeseg.Prompt()}, frame="view")
        with pytest.raises(pepeseg.InvalidArgumentError, match="protocol"):
            client.evaluate(truth, protocol="sam-agreement")
        with pytest.raises(pepeseg.InvalidArgumentError, match="ids"):
            client.evaluate({min(truth): np.zeros((120, 160))}, frame="view")


def test_agreement_with_sam_takes_the_best_proposal(client, truth):
    masks = {
        view: [
            pepeseg.SamMask(labels == 144, predicted_iou=0.95, stability=0.97),
            pepeseg.SamMask(labels == 48, predicted_iou=0.5),
            pepeseg.SamMask(labels == 114),
        ]
        for view, labels in truth.items()
    }
    found = client.sam_agreement(masks, frame="view")
    assert found.num_masks == 2 * len(truth)
    assert set(found.views) == set(truth)
    assert 0 <= found.first_iou <= found.best_iou <= 1
    means = [view.best_iou for view in found.views.values()]
    assert found.best_iou == pytest.approx(np.mean(means))
    with pytest.raises(pepeseg.InvalidArgumentError, match="none of the masks"):
        client.sam_agreement(masks, options={"min_pixels": 100_000}, frame="view")
