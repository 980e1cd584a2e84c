"""The command line, for use by hand before an upload or as pepesegd's --priors-command."""

from __future__ import annotations

import argparse
import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Callable, Iterator, Optional, Sequence

from pepeseg_priors import files
from pepeseg_priors.photos import Photo, list_photos, read_photo

if TYPE_CHECKING:
    from pepeseg_priors.models import DepthMaker, MaskMaker

SAM = "facebook/sam-vit-huge"
DEPTH = "depth-anything/Depth-Anything-V2-Large-hf"
WANTS = ("masks", "depth")

# Exit codes, in addition to argparse's 2.
FAILED = 1
MISSING_MODULE = 3


@dataclass(frozen=True)
class Loaders:
    """The functions that load the models; tests replace them."""

    masks: Callable[[str, str], MaskMaker]
    depth: Callable[[str, str], DepthMaker]


class Progress:
    """Prints the lines "progress N M" that pepesegd reads."""

    def __init__(self, total: int) -> None:
        self._done = 0
        self._total = total

    def add(self, count: int = 1) -> None:
        if count > 0:
            self._done += count
            print(f"progress {self._done} {self._total}", flush=True)


def _wants(text: str) -> tuple[str, ...]:
    wants = tuple(text.split(","))
    if not set(wants) <= set(WANTS):
        raise argparse.ArgumentTypeError(f"{text!r} is not masks, depth or masks,depth")
    return tuple(want for want in WANTS if want in wants)


def _positive(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least 1")
    return int(text)


def parse(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="pepeseg_priors",
        description="Makes masks (SAM) and depth maps (Depth-Anything-V2) of photographs, in the "
        "formats of a pepeseg upload. Existing files are not made again.",
    )
    parser.add_argument("--photos", type=Path, required=True, help="folder of photographs")
    parser.add_argument("--out", type=Path, required=True, help="folder for masks/ and disparity/")
    parser.add_argument("--want", type=_wants, default=WANTS, metavar="masks,depth")
    model_help = "name on the Hugging Face hub, or folder (%(default)s)"
    parser.add_argument("--sam", default=SAM, metavar="MODEL", help=model_help)
    parser.add_argument("--depth", default=DEPTH, metavar="MODEL", help=model_help)
    parser.add_argument("--device", default="auto", help="auto, cpu, cuda or cuda:N")
    parser.add_argument(
        "--batch", type=_positive, default=4, help="photographs at once, for depth (%(default)s)"
    )
    return parser.parse_args(arguments)


def missing_modules(names: Sequence[str]) -> list[str]:
    return [name for name in names if importlib.util.find_spec(name) is None]


def _tell(message: str) -> None:
    print(f"pepeseg_priors: {message}", file=sys.stderr, flush=True)


def _batches(photos: Sequence[Photo], size: int) -> Iterator[Sequence[Photo]]:
    for start in range(0, len(photos), size):
        yield photos[start : start + size]


def _make_masks(make: MaskMaker, photos: Sequence[Photo], out: Path, progress: Progress) -> None:
    for photo in photos:
        files.write_masks(out, photo.stem, make(read_photo(photo)))
        progress.add()


def _make_depth(
    make: DepthMaker, batches: Iterator[Sequence[Photo]], out: Path, progress: Progress
) -> None:
    for batch in batches:
        pictures = [read_photo(photo) for photo in batch]
        for photo, picture, depth in zip(batch, pictures, make(pictures)):
            files.write_depth(out, photo.stem, depth, (picture.shape[1], picture.shape[0]))
            progress.add()


def run(options: argparse.Namespace, loaders: Loaders) -> None:
    """Makes what `options` want and what does not exist yet. Raises ValueError, OSError or
    RuntimeError if something cannot be read, loaded or made."""
    photos = list_photos(options.photos)
    progress = Progress(len(photos) * len(options.want))
    if "masks" in options.want:
        todo = [photo for photo in photos if not files.has_masks(options.out, photo.stem)]
        progress.add(len(photos) - len(todo))
        if todo:
            _make_masks(loaders.masks(options.sam, options.device), todo, options.out, progress)
    if "depth" in options.want:
        todo = [photo for photo in photos if not files.has_depth(options.out, photo.stem)]
        progress.add(len(photos) - len(todo))
        if todo:
            make = loaders.depth(options.depth, options.device)
            _make_depth(make, _batches(todo, options.batch), options.out, progress)


def _models() -> Loaders:
    from pepeseg_priors import models

    return Loaders(models.load_masks, models.load_depth)


def main(arguments: Optional[Sequence[str]] = None, loaders: Optional[Loaders] = None) -> int:
    """Runs the command line and returns the exit code. `loaders` replace the real models, which
    need torch and transformers."""
    options = parse(arguments)
    needed = ["numpy", "PIL"] + ([] if loaders else ["torch", "transformers"])
    missing = missing_modules(needed)
    if missing:
        pip = " ".join("Pillow" if name == "PIL" else name for name in missing)
        _tell(f"{', '.join(missing)} cannot be imported: pip install {pip}")
        return MISSING_MODULE
    try:
        run(options, loaders or _models())
    except (ImportError, KeyError, OSError, RuntimeError, ValueError) as error:
        # transformers raises these, too: a model that cannot be fetched, or that it does not know.
        _tell(f"{type(error).__name__}: {error}")
        return FAILED
    return 0
