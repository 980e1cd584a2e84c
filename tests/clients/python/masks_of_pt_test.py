"""Tests the converter of PyTorch's masks, without PyTorch: the reader of files is replaced."""

import json
import tempfile
import unittest
from pathlib import Path

import numpy as np
from PIL import Image

from pepeseg_priors import masks_of_pt


class MasksOfPtTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        (self.folder / "photos").mkdir()
        for name in ("a.jpg", "b.jpg"):
            Image.new("RGB", (8, 6)).save(self.folder / "photos" / name)
        (self.folder / "a.pt").write_bytes(b"")

    def run_with(self, array):
        photos, out = self.folder / "photos", self.folder / "out"
        return masks_of_pt.run(self.folder, photos, out, load=lambda path: array)

    def test_masks_get_the_size_of_their_photograph(self):
        masks = np.zeros((2, 3, 4), bool)
        masks[0, :, :2] = True
        masks[1, 0, 0] = True
        self.assertEqual(self.run_with(masks), 1)
        written = json.loads((self.folder / "out/masks/a.json").read_text())
        self.assertEqual([mask["area"] for mask in written], [24, 4])
        self.assertEqual(written[0]["segmentation"]["size"], [6, 8])
        self.assertNotIn("predicted_iou", written[0])
        self.assertFalse((self.folder / "out/masks/b.json").exists())

    def test_other_shapes_are_refused(self):
        with self.assertRaisesRegex(ValueError, r"a\.pt: the shape is \(3, 4\)"):
            self.run_with(np.zeros((3, 4), bool))
        with self.assertRaisesRegex(ValueError, "masks of 3x4 pixels, the photograph has 8x6"):
            self.run_with(np.zeros((1, 4, 3), bool))

    def test_a_folder_without_masks_is_refused(self):
        (self.folder / "a.pt").unlink()
        with self.assertRaisesRegex(ValueError, r"no masks of a photograph: expected a\.pt"):
            self.run_with(np.zeros((1, 3, 4), bool))
