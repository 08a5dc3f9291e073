"""Steim's compression (SEED manual 2.4, appendix B): frames of 64 bytes with differences of 4 to 32 bits.

A frame's first word has two bits for each of the 15 others that tell how many differences are packed into it; the first
frame has the first and the last sample in its first two words.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_WORDS = 16
_Table = dict[tuple[int, int | None], tuple[int, int]]
_STEIM_1: _Table = {(1, None): (4, 8), (2, None): (2, 16), (3, None): (1, 32)}
_STEIM_2: _Table = {
    (1, None): (4, 8),
    (2, 1): (1, 30),
    (2, 2): (2, 15),
    (2, 3): (3, 10),
    (3, 0): (5, 6),
    (3, 1): (6, 5),
    (3, 2): (7, 4),
}
"""Number and bits of the differences in a word, by its code and, where it has one, the code in its first two bits."""

_TABLES = {1: _STEIM_1, 2: _STEIM_2}


def most_samples(frames: bytes, version: int, order: str = ">") -> int:
    """The number of differences that whole frames hold, by the codes of their words.

    Parameters
    ----------
    frames : bytes
        Frames; what is left of the last one that is not whole is passed over.
    version : int
        1 or 2.
    order : str
        Order of the bytes, > or <.
    """
    _, codes, inner = _codes(frames, order)
    return sum(
        count * int(np.sum((codes == code) & (inner == second if second is not None else True)))
        for (code, second), (count, _) in _TABLES[version].items()
    )


def last_samples(frames: bytes, version: int, samples: int) -> tuple[int, int]:
    """The last sample that the first frame states, and the one that the differences lead to.

    Parameters
    ----------
    frames : bytes
        Frames, big-endian; at least one.
    version : int
        1 or 2.
    samples : int
        Number of samples, from 1 to `most_samples`.
    """
    words, codes, inner = _codes(frames, ">")
    first, last = (int(word) for word in words[1:3].view(np.int32))
    parts: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = []
    for (code, second), (count, bits) in _TABLES[version].items():
        places = np.flatnonzero((codes == code) & ((inner == second) if second is not None else True))
        raw = words[places].astype(np.int64)
        for j in range(count):
            value = (raw >> (bits * (count - 1 - j))) & ((1 << bits) - 1)
            value = np.where(value >> (bits - 1), value - (1 << bits), value)
            parts.append((places * 8 + j, value))
    order = np.argsort(np.concatenate([place for place, _ in parts]))
    differences = np.concatenate([value for _, value in parts])[order]
    # The first difference leads from the record before to the first sample, which is given.
    end = first + int(np.sum(differences[1:samples]))
    return last, (end + 2**31) % 2**32 - 2**31


def _codes(frames: bytes, order: str) -> tuple[NDArray[np.uint32], NDArray[np.int64], NDArray[np.int64]]:
    """The words of whole frames, their codes, and the codes in their first two bits; each of shape (words,)."""
    whole = len(frames) // (4 * _WORDS) * _WORDS
    words = np.frombuffer(frames, f"{order}u4", whole).astype(np.uint32)
    shifts = np.arange(30, -2, -2, dtype=np.uint32)
    codes = ((words[::_WORDS, None] >> shifts) & 3).astype(np.int64)
    codes[:, 0] = 0
    codes = codes.reshape(-1)
    codes[1:3] = 0
    return words, codes, (words >> np.uint32(30)).astype(np.int64)
