"""Finding things: all that are alike, or what a word means."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pepeseg import prompts, rle
from pepeseg.calls import Place, Steps, Unary
from pepeseg.cameras import Viewpoint
from pepeseg.errors import refused
from pepeseg.subsets import Segment, to_segment_ref
from pepeseg.v1 import find_pb2

_SOURCES = {
    find_pb2.FindSegmentsResponse.SOURCE_LABELS: "labels",
    find_pb2.FindSegmentsResponse.SOURCE_DETECTOR: "detector",
    find_pb2.FindSegmentsResponse.SOURCE_TEXT_COMMAND: "text-command",
    find_pb2.FindSegmentsResponse.SOURCE_APPEARANCE: "appearance",
}


@dataclass(frozen=True)
class Appearance:
    """A thing in a view. `box`: x, y, width, height, pixels of the frame. `area`: about the number
    of pixels that show it."""

    view: str
    box: tuple[int, int, int, int]
    area: int


@dataclass(frozen=True, eq=False)
class Found:
    """A thing that was found.

    Attributes:
        score: in [0, 1].
        label: name of the label whose thing it is; empty: none.
        word: the known word that names it; empty: it was found by likeness.
        segment: the segment of the decomposition, for `render` and `export`; None: a label's thing
            that no segment is like.
        prompt: with it `segment` and `select` show the thing.
        appearances: the views that show it, the largest first, at most 8.
    """

    score: float
    label: str
    word: str
    segment: Segment | None
    prompt: prompts.Prompt
    appearances: tuple[Appearance, ...]


@dataclass(frozen=True, eq=False)
class Findings:
    """What was found, the best score first. It can be iterated and indexed, and is False if
    nothing was found.

    Attributes:
        source: "labels", "detector", "text-command" or "appearance"; empty: nothing was found.
        best_score, best_word: if nothing was found, the best score below the minimum, and its word.
        did_you_mean: if nothing was found, known words that are spelt alike.
        known_words: if nothing was found, the words that are known.
        model: name of the model used.
    """

    things: tuple[Found, ...]
    source: str
    best_score: float
    best_word: str
    did_you_mean: tuple[str, ...]
    known_words: tuple[str, ...]
    model: str

    def __len__(self) -> int:
        return len(self.things)

    def __iter__(self) -> Iterator[Found]:
        return iter(self.things)

    def __getitem__(self, index: int) -> Found:
        return self.things[index]


def _parse_segment(message: find_pb2.FindSegmentsResponse.Found) -> Segment | None:
    if not message.HasField("segment"):
        return None
    low, high = message.box.min, message.box.max
    return Segment(
        id=message.segment.id,
        level=message.segment.level,
        parent=0,
        num_gaussians=message.num_gaussians,
        min=(low.x, low.y, low.z),
        max=(high.x, high.y, high.z),
        scales=tuple(message.segment.scales),
    )


def _parse_found(message: find_pb2.FindSegmentsResponse.Found) -> Found:
    if message.prompt.WhichOneof("what") == "label":
        prompt = prompts.Prompt(label=message.prompt.label)
    else:
        mask = rle.decode(message.prompt.mask.rle)
        prompt = prompts.Prompt(message.prompt.view.view, mask=mask)
    return Found(
        score=message.score,
        label=message.label,
        word=message.word,
        segment=_parse_segment(message),
        prompt=prompt,
        appearances=tuple(
            Appearance(seen.view, (seen.x, seen.y, seen.width, seen.height), seen.area)
            for seen in message.appearances
        ),
    )


def find(
    at: Place,
    text: str | None = None,
    *,
    like: Segment | prompts.Prompt | None = None,
    view: Viewpoint | None = None,
    scale: float | None = None,
    scale_units: float | None = None,
    threshold: float | None = None,
    max_results: int = 0,
    min_score: float | None = None,
    frame: str = "photograph",
    **what: Any,
) -> Steps[Findings]:
    """Finds what a text names, or all things that look like one thing.

        for mug in client.find("mug"): ...
        bolts = client.find(view="0001.jpg", points=[320, 240])
        print(len(bolts), "bolts")

    A text is looked up in the scene's labels (texts and ids: words, prefixes, plurals,
    synonyms), then in the other sources of words that the server has. Likeness takes the server's
    SAM. The first call for a model takes seconds, or half a minute where the training has not kept
    what SAM sees.

    Args:
        text: what is looked for, at most 200 characters.
        like: a segment of `decompose` at its default scales, or a Prompt for one of the things.
        view, what: in place of `like`, the fields of its Prompt: points, box, mask, label, ...
        scale, scale_units, threshold: granularity of the prompt, as in `segment`.
        max_results: 1 to 200; 0: 100.
        min_score: results have at least this score, in [0, 1]; None: the server's minimum.
        frame: the pixels of prompts and boxes, as in `segment`.

    Returns:
        The things. None, with the known words, if no name and no likeness is sure enough.

    Raises:
        InvalidArgumentError: a text and a thing, or neither; else as in `segment`.
        FailedPreconditionError: the server has no SAM, which likeness takes; the scene has no model.
        NotFoundError: no such label.
    """
    by_prompt = view is not None or bool(what) or isinstance(like, prompts.Prompt)
    if (text is not None) + isinstance(like, Segment) + by_prompt != 1:
        raise refused("exactly one of a text, like and the fields of a prompt is wanted")
    request = find_pb2.FindSegmentsRequest(
        model=at.model,
        max_results=max_results,
        min_score=min_score,
        granularity=prompts.granularity(scale, scale_units, threshold),
        frame=prompts.pixel_frame(frame),
    )
    if text is not None:
        request.text = text
    elif isinstance(like, Segment):
        request.like_segment.CopyFrom(to_segment_ref(like))
    else:
        request.like.CopyFrom(prompts.to_prompt(like or view, what).to_message())
    answer = yield Unary("segmentation", "FindSegments", request, at.scene)
    return Findings(
        things=tuple(_parse_found(found) for found in answer.found),
        source=_SOURCES.get(answer.source, ""),
        best_score=answer.best_score,
        best_word=answer.best_word,
        did_you_mean=tuple(answer.did_you_mean),
        known_words=tuple(answer.known_words),
        model=answer.model,
    )
