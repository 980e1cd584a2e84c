"""The two models, each as a function of photographs. Only this module uses torch and transformers.

Photographs are [height, width, 3] RGB arrays of 8 bits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable, Sequence

from pepeseg_priors.files import DepthMap, Mask

if TYPE_CHECKING:
    import numpy as np

    MaskMaker = Callable[[np.ndarray], list[Mask]]
    DepthMaker = Callable[[Sequence[np.ndarray]], list[DepthMap]]

# Number of prompts of SAM's grid that are decoded at once.
POINTS_PER_BATCH = 64


def choose_device(device: str) -> str:
    """Returns torch's name of a device; "auto" is CUDA if there is a device, else the CPU."""
    import torch

    if device != "auto":
        return device
    return "cuda" if torch.cuda.is_available() else "cpu"


def _array(tensor: Any) -> np.ndarray:
    """Returns a tensor on any device, or an array, as an array."""
    import numpy as np

    if hasattr(tensor, "detach"):
        tensor = tensor.detach().float().cpu().numpy()
    return np.asarray(tensor)


def _images(photos: Sequence[np.ndarray]) -> list[Any]:
    from PIL import Image

    return [Image.fromarray(photo) for photo in photos]


def load_masks(model: str, device: str) -> MaskMaker:
    """Loads SAM, or SAM 2 if the installed transformers has it. `model`: a hub name or a folder."""
    from transformers import pipeline

    return masks_of(pipeline("mask-generation", model=model, device=choose_device(device)))


def masks_of(generator: Any) -> MaskMaker:
    """Returns a function that makes masks with `generator`, a mask-generation pipeline of
    transformers or an object like it."""

    def make(photo: np.ndarray) -> list[Mask]:
        result = generator(_images([photo])[0], points_per_batch=POINTS_PER_BATCH)
        masks = [_array(mask).astype(bool) for mask in result["masks"]]
        scores = _array(result["scores"]).reshape(-1).tolist() if masks else []
        return [Mask(pixels, score) for pixels, score in zip(masks, scores)]

    return make


def load_depth(model: str, device: str) -> DepthMaker:
    """Loads Depth-Anything-V2 or another model for the depth-estimation pipeline."""
    from transformers import pipeline

    return depth_of(pipeline("depth-estimation", model=model, device=choose_device(device)))


def depth_of(estimator: Any) -> DepthMaker:
    """Returns a function that makes depth with `estimator`, a depth-estimation pipeline of
    transformers or an object like it. Models for metres give depth; all others are assumed to give
    disparity, as Depth-Anything's do."""
    config = getattr(getattr(estimator, "model", None), "config", None)
    far_is_large = getattr(config, "depth_estimation_type", "relative") == "metric"

    def make(photos: Sequence[np.ndarray]) -> list[DepthMap]:
        results = estimator(_images(photos), batch_size=len(photos))
        maps = [_array(result["predicted_depth"]) for result in results]
        return [DepthMap(values.reshape(values.shape[-2:]), far_is_large) for values in maps]

    return make
