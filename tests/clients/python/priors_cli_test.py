"""Tests the command line of pepeseg_priors, with fakes in place of the real models."""

import contextlib
import io
import json
import tempfile
import types
import unittest
from pathlib import Path
from unittest import mock

import numpy as np
from PIL import Image

from pepeseg_priors import cli, models


class MaskPipeline:
    """Answers as transformers' mask-generation pipeline does: the red pixels."""

    def __init__(self):
        self.photos = 0

    def __call__(self, image, points_per_batch):
        self.photos += 1
        assert points_per_batch >= 1
        pixels = np.asarray(image)
        return {"masks": [pixels[..., 0] > 128], "scores": np.array([0.75])}


class DepthPipeline:
    """Answers as the depth-estimation pipeline does: brighter is nearer."""

    def __init__(self, kind="relative"):
        self.batches = []
        config = types.SimpleNamespace(depth_estimation_type=kind)
        self.model = types.SimpleNamespace(config=config)

    def __call__(self, images, batch_size):
        self.batches.append(len(images))
        assert batch_size == len(images)
        return [
            {"predicted_depth": np.asarray(image.convert("L"), np.float32)[None]}
            for image in images
        ]


class CommandLineTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.photos = Path(folder.name) / "photos"
        self.out = Path(folder.name) / "out"
        for name in ("000001.png", "000002.png", "cam/3.png"):
            image = Image.new("RGB", (8, 6), (0, 0, 255))
            image.paste((255, 0, 0), (0, 0, 4, 6))
            (self.photos / name).parent.mkdir(parents=True, exist_ok=True)
            image.save(self.photos / name)
        self.masks = MaskPipeline()
        self.depth = DepthPipeline()

    def run_main(self, *more):
        loaders = cli.Loaders(
            lambda model, device: models.masks_of(self.masks),
            lambda model, device: models.depth_of(self.depth),
        )
        output, errors = io.StringIO(), io.StringIO()
        arguments = ["--photos", str(self.photos), "--out", str(self.out), *more]
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
            code = cli.main(arguments, loaders)
        return code, output.getvalue().splitlines(), errors.getvalue()

    def test_makes_both_and_prints_progress(self):
        code, lines, errors = self.run_main("--batch", "2")
        self.assertEqual((code, errors), (0, ""))
        self.assertEqual(lines, [f"progress {n} 6" for n in range(1, 7)])
        (mask,) = json.loads((self.out / "masks/cam/3.json").read_text())
        self.assertEqual(mask["segmentation"], {"size": [6, 8], "counts": [0, 24, 24]})
        self.assertEqual(mask["predicted_iou"], 0.75)
        depth = np.load(self.out / "disparity/000002.npy")
        self.assertEqual(depth.shape, (6, 8))
        self.assertGreater(depth[0, 0], depth[0, 7])
        self.assertEqual(self.depth.batches, [2, 1])

    def test_makes_only_what_is_wanted(self):
        code, lines, _ = self.run_main("--want", "depth")
        self.assertEqual((code, lines[-1]), (0, "progress 3 3"))
        self.assertFalse((self.out / "masks").exists())
        self.assertEqual(self.masks.photos, 0)

    def test_resumes_an_interrupted_run(self):
        self.assertEqual(self.run_main()[0], 0)
        (self.out / "masks/000002.json").unlink()
        code, lines, _ = self.run_main()
        self.assertEqual(code, 0)
        self.assertEqual(self.masks.photos, 4)
        self.assertEqual(sum(self.depth.batches), 3)
        self.assertEqual(lines, ["progress 2 6", "progress 3 6", "progress 6 6"])

    def test_metres_are_depth(self):
        self.depth = DepthPipeline("metric")
        self.assertEqual(self.run_main("--want", "depth")[0], 0)
        self.assertTrue((self.out / "depth/000001.npy").is_file())

    def test_a_model_that_cannot_be_loaded_is_reported(self):
        def fail(*_):
            raise OSError("no such model: x/y")

        errors = io.StringIO()
        with contextlib.redirect_stderr(errors):
            code = cli.main(
                ["--photos", str(self.photos), "--out", str(self.out)], cli.Loaders(fail, fail)
            )
        self.assertEqual(code, cli.FAILED)
        self.assertIn("no such model: x/y", errors.getvalue())

    def test_missing_modules_are_named_with_a_remedy(self):
        errors = io.StringIO()
        with mock.patch.object(cli, "missing_modules", return_value=["torch", "transformers"]):
            with contextlib.redirect_stderr(errors):
                code = cli.main(["--photos", str(self.photos), "--out", str(self.out)])
        self.assertEqual(code, cli.MISSING_MODULE)
        self.assertIn("pip install torch transformers", errors.getvalue())

    def test_a_wrong_want_is_refused(self):
        with self.assertRaises(SystemExit) as ended, contextlib.redirect_stderr(io.StringIO()):
            self.run_main("--want", "masks,colours")
        self.assertEqual(ended.exception.code, 2)

    def test_an_empty_folder_is_reported(self):
        self.photos = self.out
        self.out.mkdir()
        code, _, errors = self.run_main()
        self.assertEqual(code, cli.FAILED)
        self.assertIn("no photographs", errors)


if __name__ == "__main__":
    unittest.main()
