"""Finds what a text names in photographs, by hand or as pepesegd's --text-command.

A zero-shot object detector of Hugging Face transformers (OWLv2) is asked for the text in each
photograph. STEM.json of the output folder lists what it has found: {"score": 0.4, "box": [x0, y0,
x1, y1]} in pixels. A photograph that shows nothing of the kind has no file.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Optional, Sequence

from pepeseg_priors.cli import FAILED, MISSING_MODULE, missing_modules
from pepeseg_priors.files import write_whole
from pepeseg_priors.photos import list_photos, read_photo

if TYPE_CHECKING:
    import numpy as np

    Finder = Callable[[np.ndarray, str], list["Thing"]]
    Loader = Callable[[str, str, float], Finder]

MODEL = "google/owlv2-base-patch16-ensemble"
# Boxes of a photograph that are written; pepesegd takes 200.
MOST_THINGS = 50


@dataclass(frozen=True)
class Thing:
    score: float  # [0, 1]
    box: tuple[float, float, float, float]  # x0, y0, x1, y1, pixels


def finder_of(detector: Any, threshold: float) -> Finder:
    """Returns a function that finds things with `detector`, a zero-shot-object-detection pipeline
    of transformers or an object like it."""

    def find(photo: np.ndarray, text: str) -> list[Thing]:
        from PIL import Image

        found = detector(Image.fromarray(photo), candidate_labels=[text], threshold=threshold)
        sides = ("xmin", "ymin", "xmax", "ymax")
        things = [
            Thing(float(one["score"]), tuple(float(one["box"][side]) for side in sides))
            for one in found
        ]
        return sorted(things, key=lambda thing: -thing.score)[:MOST_THINGS]

    return find


def load(model: str, device: str, threshold: float) -> Finder:
    """Loads the model. `model`: a hub name or a folder."""
    from transformers import pipeline

    from pepeseg_priors.models import choose_device

    detector = pipeline("zero-shot-object-detection", model=model, device=choose_device(device))
    return finder_of(detector, threshold)


def parse(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="pepeseg-text", description="Finds what a text names in photographs, by OWLv2."
    )
    parser.add_argument("--photos", type=Path, required=True, help="folder of photographs")
    parser.add_argument("--text", required=True, help='what to find, such as "the red cup"')
    parser.add_argument("--out", type=Path, required=True, help="folder for the answers")
    parser.add_argument(
        "--model", default=MODEL, help="name on the Hugging Face hub, or folder (%(default)s)"
    )
    parser.add_argument("--device", default="auto", help="auto, cpu, cuda or cuda:N")
    parser.add_argument(
        "--threshold", type=float, default=0.1, help="lowest score of a thing (%(default)s)"
    )
    return parser.parse_args(arguments)


def run(options: argparse.Namespace, loader: Loader) -> None:
    photos = list_photos(options.photos)
    find = loader(options.model, options.device, options.threshold)
    for number, photo in enumerate(photos, 1):
        things = find(read_photo(photo), options.text)
        if things:
            listed = [{"score": thing.score, "box": list(thing.box)} for thing in things]
            text = json.dumps(listed, allow_nan=False)
            write_whole(options.out / f"{photo.stem}.json", text.encode())
        print(f"progress {number} {len(photos)}", flush=True)


def main(arguments: Optional[Sequence[str]] = None, loader: Optional[Loader] = None) -> int:
    """Runs the command line and returns the exit code. `loader` replaces the real model, which
    needs torch and transformers."""
    options = parse(arguments)
    needed = ["numpy", "PIL"] + ([] if loader else ["torch", "transformers"])
    missing = missing_modules(needed)
    if missing:
        pip = " ".join("Pillow" if name == "PIL" else name for name in missing)
        print(f"pepeseg-text: {', '.join(missing)} cannot be imported: pip install {pip}",
              file=sys.stderr)
        return MISSING_MODULE
    try:
        run(options, loader or load)
    except (ImportError, KeyError, OSError, RuntimeError, ValueError) as error:
        print(f"pepeseg-text: {type(error).__name__}: {error}", file=sys.stderr)
        return FAILED
    return 0


if __name__ == "__main__":
    sys.exit(main())
