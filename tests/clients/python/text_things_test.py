"""Tests the text command, with a fake in place of the real model; and with a tiny OWLv2 of random
weights, if torch and transformers are here."""

import contextlib
import importlib.util
import io
import json
import tempfile
import unittest
from pathlib import Path

import numpy as np
from PIL import Image

from pepeseg_priors import text_things

MISSING = [name for name in ("torch", "transformers") if importlib.util.find_spec(name) is None]


class RedDetector:
    """Answers as transformers' zero-shot-object-detection pipeline does: a box around the red
    pixels, if red is asked for."""

    def __call__(self, image, candidate_labels, threshold):
        (text,) = candidate_labels
        rows, columns = np.nonzero(np.asarray(image)[..., 0] > 128)
        if "red" not in text or not rows.size or threshold > 0.8:
            return []
        sides = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
        names = ("xmin", "ymin", "xmax", "ymax")
        box = {name: int(side) for name, side in zip(names, sides)}
        return [{"score": 0.5, "label": text, "box": box}, {"score": 0.8, "label": text, "box": box}]


class TextThingsTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.photos = Path(folder.name) / "photos"
        self.out = Path(folder.name) / "out"
        self.photos.mkdir()
        for name, red in (("000001.png", True), ("000002.png", False)):
            image = Image.new("RGB", (8, 6), (0, 0, 255))
            if red:
                image.paste((255, 0, 0), (2, 1, 5, 4))
            image.save(self.photos / name)

    def run_main(self, text, *more, loader=None):
        def fake(model, device, threshold):
            return text_things.finder_of(RedDetector(), threshold)

        output, errors = io.StringIO(), io.StringIO()
        arguments = ["--photos", str(self.photos), "--text", text, "--out", str(self.out), *more]
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
            code = text_things.main(arguments, loader or fake)
        return code, output.getvalue().splitlines(), errors.getvalue()

    def test_writes_the_boxes_of_each_photograph_that_has_some(self):
        code, lines, errors = self.run_main("the red cup")
        self.assertEqual((code, errors), (0, ""))
        self.assertEqual(lines, ["progress 1 2", "progress 2 2"])
        things = json.loads((self.out / "000001.json").read_text())
        self.assertEqual(things, [{"score": 0.8, "box": [2, 1, 5, 4]},
                                  {"score": 0.5, "box": [2, 1, 5, 4]}])
        self.assertFalse((self.out / "000002.json").exists())

    def test_finds_nothing_below_the_threshold_or_of_another_kind(self):
        self.assertEqual(self.run_main("a blue cup")[0], 0)
        self.assertEqual(self.run_main("the red cup", "--threshold", "0.9")[0], 0)
        self.assertFalse(self.out.exists())

    def test_says_what_went_wrong(self):
        def broken(model, device, threshold):
            raise OSError(f"{model} is not here")

        code, _, errors = self.run_main("cup", "--model", "none", loader=broken)
        self.assertEqual((code, errors), (1, "pepeseg-text: OSError: none is not here\n"))


@unittest.skipIf(MISSING, f"{' and '.join(MISSING)} cannot be imported here")
class TinyOwlTest(unittest.TestCase):
    def test_gives_boxes(self):
        import torch
        import transformers as t

        torch.manual_seed(1)
        config = t.Owlv2Config(
            text_config=t.Owlv2TextConfig(
                vocab_size=64, hidden_size=32, intermediate_size=64, num_hidden_layers=1,
                num_attention_heads=2, max_position_embeddings=16,
            ).to_dict(),
            vision_config=t.Owlv2VisionConfig(
                hidden_size=32, intermediate_size=64, num_hidden_layers=1, num_attention_heads=2,
                image_size=64, patch_size=16,
            ).to_dict(),
            projection_dim=32,
        )
        model = t.Owlv2ForObjectDetection(config).eval()
        processor = t.Owlv2ImageProcessor(size={"height": 64, "width": 64})

        def detect(image, candidate_labels, threshold):
            inputs = processor(images=image, return_tensors="pt")
            tokens = torch.zeros((1, 16), dtype=torch.long)
            with torch.no_grad():
                outputs = model(input_ids=tokens, pixel_values=inputs["pixel_values"])
            (found,) = processor.post_process_object_detection(
                outputs, threshold=0.0, target_sizes=[(image.height, image.width)]
            )
            names = ("xmin", "ymin", "xmax", "ymax")
            return [{"score": score.item(), "label": candidate_labels[0],
                     "box": dict(zip(names, box.tolist()))}
                    for score, box in zip(found["scores"], found["boxes"])]

        photo = np.random.default_rng(5).integers(0, 256, (48, 64, 3), dtype=np.uint8)
        things = text_things.finder_of(detect, 0.0)(photo, "cup")
        self.assertGreater(len(things), 0)
        for thing in things:
            self.assertTrue(0 <= thing.score <= 1 and np.isfinite(thing.box).all())
