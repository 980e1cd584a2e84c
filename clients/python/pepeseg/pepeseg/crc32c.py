"""CRC-32C (Castagnoli) with NumPy alone. The contract requires it of each chunk.

The bytes are a polynomial over GF(2), of which each 32-bit word holds 32 coefficients. Each round
multiplies the upper half of the words by x to the power of its distance and adds it to the lower
half, which halves the number of words, until one word is left. A round is a few NumPy operations.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

_Words = npt.NDArray[np.uint32]

# Arrays of this size reuse memory that the process already has; larger ones cost page faults.
_PIECE_BYTES = 1 << 17
_POLYNOMIAL = 0x82F63B78  # reflected: bit 31 of a word is x^0


def _times_x(word: int) -> int:
    return (word >> 1) ^ (_POLYNOMIAL if word & 1 else 0)


def _multiply(a: int, b: int) -> int:
    product = 0
    for bit in range(31, -1, -1):
        if (a >> bit) & 1:
            product ^= b
        b = _times_x(b)
    return product


@lru_cache(maxsize=None)
def _power(exponent_of_two: int) -> int:
    """Returns x^(32 * 2^exponent_of_two), reduced by the polynomial."""
    if exponent_of_two == 0:
        word = 1 << 31
        for _ in range(32):
            word = _times_x(word)
        return word
    root = _power(exponent_of_two - 1)
    return _multiply(root, root)


@lru_cache(maxsize=None)
def _tables(exponent_of_two: int) -> _Words:
    """Returns [2, 65536]: each value of the lower and of the upper half-word, times that power."""
    factor = _power(exponent_of_two)
    tables = np.zeros((2, 1 << 16), np.uint32)
    for place in range(2):
        for bit in range(16):
            step = 1 << bit
            product = np.uint32(_multiply(factor, step << (16 * place)))
            tables[place, step : 2 * step] = tables[place, :step] ^ product
    return tables


def _advance(register: int, data: npt.NDArray[np.uint8]) -> int:
    # Leading zeros change nothing; four trailing ones are the factor x^32 of the definition.
    num_words = (len(data) + 7) // 4
    padded = np.zeros(4 * num_words, np.uint8)
    start = 4 * num_words - 4 - len(data)
    padded[start : start + len(data)] = data
    padded[start : start + 4] ^= np.frombuffer(register.to_bytes(4, "little"), np.uint8)
    words: _Words = padded.view("<u4").astype(np.uint32, copy=False)
    while words.size > 1:
        exponent = int(words.size - 1).bit_length() - 1
        distance = 1 << exponent
        upper, words = words[: words.size - distance], words[words.size - distance :]
        tables = _tables(exponent)
        halves = upper.astype("<u4", copy=False).view("<u2").reshape(-1, 2)
        for place in range(2):
            # "clip" only avoids the bounds check: every half-word is an index.
            words[distance - upper.size :] ^= np.take(tables[place], halves[:, place], mode="clip")
    return int(words[0])


def crc32c(data: bytes | memoryview) -> int:
    """Returns the CRC-32C of `data`."""
    register = 0xFFFFFFFF
    all_bytes = np.frombuffer(data, np.uint8)
    for start in range(0, len(all_bytes), _PIECE_BYTES):
        register = _advance(register, all_bytes[start : start + _PIECE_BYTES])
    return register ^ 0xFFFFFFFF
