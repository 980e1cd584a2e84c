"""Tests the conversion of masks and pictures to NumPy and back."""

import io

import numpy as np
from PIL import Image
import pytest

import pepeseg
from pepeseg import png, rle
from pepeseg.v1 import prompt_pb2


def disc(height, width):
    rows, columns = np.mgrid[:height, :width]
    return (rows - height / 2) ** 2 + (columns - width / 3) ** 2 < (height / 4) ** 2


class TestRle:
    def test_reads_and_writes_strings_of_pycocotools(self):
        # Down the columns: 6 zeros, 1 one, 40 zeros, 3 ones, 14 zeros; from the fourth on, each as
        # its difference to the one before the last: 3 - 1, 14 - 40.
        mask = np.zeros(64, bool)
        mask[6] = mask[47:50] = True
        encoded = rle.encode(mask.reshape(8, 8).T)
        counts = [6, 1, 40, 2, -26]
        assert encoded.counts == "".join(spell(count) for count in counts)

    @pytest.mark.parametrize(
        "shape", [(1, 1), (3, 5), (7, 8), (120, 160), (97, 161), (1, 2000), (2000, 1)]
    )
    def test_comes_back(self, shape):
        draws = np.random.default_rng(7).random(shape)
        for mask in (draws < 0, draws < 2, draws < 0.5, draws < 0.01, disc(*shape)):
            decoded = rle.decode(rle.encode(mask))
            assert decoded.dtype == np.bool_ and decoded.flags.c_contiguous
            assert np.array_equal(decoded, mask)

    def test_runs_of_no_length_are_read(self):
        # 0 zeros, 1 one, 0 zeros, 2 ones; and a last run of none.
        for counts in ([0, 1, 0, 2], [0, 3, 0]):
            text = "".join(spell(n - counts[i - 2] if i > 2 else n) for i, n in enumerate(counts))
            message = prompt_pb2.CocoRle(height=3, width=1, counts=text)
            assert rle.decode(message).all()
        nothing = rle.decode(prompt_pb2.CocoRle(height=0, width=0, counts=""))
        assert nothing.shape == (0, 0)

    def test_nonzero_integers_are_inside(self):
        assert rle.decode(rle.encode(np.array([[0, 255], [1, 0]]))).tolist() == [
            [False, True],
            [True, False],
        ]

    @pytest.mark.parametrize(
        "counts", ["", "3", "5", "4o", "0P", "zzzzzzzz0", "\u20ac", "02N", "~"]
    )
    def test_runs_that_do_not_fill_the_mask_are_data_loss(self, counts):
        with pytest.raises(pepeseg.DataLossError):
            rle.decode(prompt_pb2.CocoRle(height=2, width=2, counts=counts))
        with pytest.raises(pepeseg.DataLossError):
            rle.decode(prompt_pb2.CocoRle(height=-2, width=-2, counts="4"))

    @pytest.mark.parametrize("mask", [np.zeros(4), np.zeros((0, 3)), np.zeros((2, 2, 2))])
    def test_arrays_that_are_not_masks_are_refused(self, mask):
        with pytest.raises(pepeseg.InvalidArgumentError):
            rle.encode(mask)


def spell(value):
    """Returns COCO's digits of a number, without the code under test."""
    text = ""
    more = True
    while more:
        digit = value & 0x1F
        value >>= 5
        more = value != -1 if digit & 0x10 else value != 0
        text += chr((digit | 0x20 if more else digit) + 48)
    return text


class TestPng:
    @pytest.mark.parametrize("mode", ["L", "RGB", "I;16"])
    def test_reads_files_of_another_program(self, mode):
        # Smooth and noisy parts, so that the encoder chooses all five filters.
        rows, columns = np.mgrid[:64, :80]
        noise = np.random.default_rng(3).integers(0, 9, (64, 80))
        values = (rows * 3 + columns * columns // 40 + noise) * (200 if mode == "I;16" else 1)
        pixels = values.astype(np.uint16 if mode == "I;16" else np.uint8)
        if mode == "RGB":
            pixels = np.dstack((pixels, pixels.T[:64, :64].repeat(2, 1)[:, :80], 255 - pixels))
        file = io.BytesIO()
        Image.fromarray(pixels).save(file, "PNG")
        assert np.array_equal(png.decode(file.getvalue()), pixels)

    @pytest.mark.parametrize("dtype", [np.bool_, np.uint8, np.uint16])
    def test_another_program_reads_our_files(self, dtype):
        pixels = np.random.default_rng(5).integers(0, 2, (5, 7)).astype(dtype)
        read = np.asarray(Image.open(io.BytesIO(png.encode(pixels))))
        assert np.array_equal(read, pixels * 255 if dtype == np.bool_ else pixels)

    def test_damage_is_data_loss(self):
        good = png.encode(np.zeros((4, 4), np.uint8))
        for bad in (b"", good[:20], good[:-30], good.replace(b"IDAT", b"JDAT"), b"x" + good[1:]):
            with pytest.raises(pepeseg.DataLossError):
                png.decode(bad)
        file = io.BytesIO()
        Image.new("RGBA", (2, 2)).save(file, "PNG")
        with pytest.raises(pepeseg.DataLossError, match="RGBA"):
            png.decode(file.getvalue())
