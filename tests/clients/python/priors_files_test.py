"""Tests the files that pepeseg_priors reads and writes."""

import json
import tempfile
import unittest
from pathlib import Path

import numpy as np
from PIL import Image

from pepeseg_priors import files
from pepeseg_priors.photos import list_photos, read_photo


def decode_rle(rle):
    flat = np.repeat(np.arange(len(rle["counts"])) % 2, rle["counts"])
    return flat.astype(bool).reshape(rle["size"], order="F")


class RleTest(unittest.TestCase):
    def test_runs_go_down_the_columns_and_begin_with_zeros(self):
        pixels = np.array([[0, 1, 1], [0, 0, 1]], dtype=bool)
        self.assertEqual(files.encode_rle(pixels), {"size": [2, 3], "counts": [2, 1, 1, 2]})
        self.assertEqual(files.encode_rle(~pixels), {"size": [2, 3], "counts": [0, 2, 1, 1, 2]})

    def test_of_one_value(self):
        self.assertEqual(files.encode_rle(np.zeros((2, 2), bool))["counts"], [4])
        self.assertEqual(files.encode_rle(np.ones((2, 2), bool))["counts"], [0, 4])

    def test_comes_back(self):
        random = np.random.default_rng(3)
        for shape in ((1, 1), (1, 7), (7, 1), (13, 8)):
            pixels = random.random(shape) < 0.4
            rle = files.encode_rle(pixels)
            self.assertEqual(sum(rle["counts"]), pixels.size)
            np.testing.assert_array_equal(decode_rle(rle), pixels)


class WrittenTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def names(self):
        return sorted(
            path.relative_to(self.folder).as_posix()
            for path in self.folder.rglob("*")
            if path.is_file()
        )

    def test_masks_have_the_format_of_sam(self):
        pixels = np.zeros((4, 6), bool)
        pixels[1:3, 2:6] = True
        empty = files.Mask(np.zeros((4, 6), bool), 1.0)
        files.write_masks(self.folder, "cam0/7", [files.Mask(pixels, 0.5), empty])
        self.assertEqual(self.names(), ["masks/cam0/7.json"])
        (mask,) = json.loads((self.folder / "masks/cam0/7.json").read_text())
        self.assertEqual(mask["area"], 8)
        self.assertEqual(mask["bbox"], [2, 1, 4, 2])
        self.assertEqual(mask["predicted_iou"], 0.5)
        np.testing.assert_array_equal(decode_rle(mask["segmentation"]), pixels)
        self.assertTrue(files.has_masks(self.folder, "cam0/7"))
        self.assertFalse(files.has_masks(self.folder, "cam0/8"))

    def test_depth_has_the_shape_of_the_photograph(self):
        values = np.tile(np.linspace(0, 1, 14, dtype=np.float32), (14, 1))
        files.write_depth(self.folder, "a", files.DepthMap(values, False), (4000, 3000))
        files.write_depth(self.folder, "b", files.DepthMap(values, True), (40, 30))
        self.assertEqual(self.names(), ["depth/b.npy", "disparity/a.npy"])
        large = np.load(self.folder / "disparity/a.npy")
        self.assertEqual((large.dtype.str, large.shape), ("<f4", (768, 1024)))
        small = np.load(self.folder / "depth/b.npy")
        self.assertEqual(small.shape, (30, 40))
        self.assertTrue((np.diff(small, axis=1) >= 0).all())
        self.assertTrue(files.has_depth(self.folder, "a") and files.has_depth(self.folder, "b"))

    def test_depth_that_is_not_finite_is_refused(self):
        values = np.full((3, 3), np.nan, np.float32)
        with self.assertRaisesRegex(ValueError, "the depth of a is not finite"):
            files.write_depth(self.folder, "a", files.DepthMap(values, False), (3, 3))
        self.assertEqual(self.names(), [])


class PhotosTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def save(self, name, mode="RGB", colour=(255, 0, 0)):
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        Image.new(mode, (4, 3), colour).save(path)

    def test_are_listed_by_name_with_their_folders(self):
        for name in ("b.png", "a.JPG", "cam0/a.webp"):
            self.save(name)
        (self.folder / "notes.txt").write_text("no photograph")
        self.assertEqual([photo.stem for photo in list_photos(self.folder)], ["a", "b", "cam0/a"])

    def test_are_rgb(self):
        self.save("a.png")
        self.save("b.png", "L", 7)
        red, grey = (read_photo(photo) for photo in list_photos(self.folder))
        self.assertEqual((red.shape, red.dtype), ((3, 4, 3), np.uint8))
        self.assertEqual(red[0, 0].tolist(), [255, 0, 0])
        self.assertEqual(grey[2, 3].tolist(), [7, 7, 7])

    def test_no_photographs_and_equal_names_are_refused(self):
        with self.assertRaisesRegex(ValueError, "no photographs"):
            list_photos(self.folder)
        self.save("a.png")
        self.save("a.jpg")
        with self.assertRaisesRegex(ValueError, "a.png and .*a.jpg"):
            list_photos(self.folder)


if __name__ == "__main__":
    unittest.main()
