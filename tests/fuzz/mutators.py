"""Mutations of files with a seeded generator: flipped bits, removed and duplicated parts, changed
numbers."""

import random
import re
from collections.abc import Callable

_HEADER = 700
_NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
_STRANGE = [
    b"0", b"-1", b"1e308", b"1e-308", b"nan", b"inf", b"999999999999", b"", b"\xff",
    b"-0", b"1e5", b"2147483648",
]  # fmt: skip


def flip_a_bit(data: bytearray, source: random.Random) -> None:
    position = source.randrange(len(data))
    data[position] ^= 1 << source.randrange(8)


def flip_a_bit_of_the_header(data: bytearray, source: random.Random) -> None:
    position = source.randrange(min(len(data), _HEADER))
    data[position] ^= 1 << source.randrange(8)


def set_a_byte(data: bytearray, source: random.Random) -> None:
    data[source.randrange(len(data))] = source.choice((0, 255, 32, 10, source.randrange(256)))


def cut_off(data: bytearray, source: random.Random) -> None:
    del data[source.randrange(1, len(data)) :]


def lose_a_piece(data: bytearray, source: random.Random) -> None:
    size = source.choice((1, 2, 8, 64, 512))
    position = source.randrange(max(1, len(data) - size))
    del data[position : position + size]


def double_a_piece(data: bytearray, source: random.Random) -> None:
    size = source.choice((1, 2, 8, 64, 512))
    position = source.randrange(max(1, len(data) - size))
    data[position:position] = data[position : position + size]


def zero_a_piece(data: bytearray, source: random.Random) -> None:
    size = source.choice((4, 16, 64, 512))
    position = source.randrange(max(1, len(data) - size))
    data[position : position + size] = bytes(len(data[position : position + size]))


def change_a_number(data: bytearray, source: random.Random) -> None:
    """Change one of the first numbers of a text, which are in its header, or any number."""
    found = list(_NUMBER.finditer(bytes(data[: source.choice((2000, len(data)))])))
    if found:
        match = source.choice(found)
        digit = str(source.randrange(10)).encode()
        near = (match[0] + digit, match[0][:-1], digit + match[0][1:])
        data[match.start() : match.end()] = source.choice([*_STRANGE, *near])


def lose_or_swap_lines(data: bytearray, source: random.Random) -> None:
    lines = bytes(data).split(b"\n")
    a, b = source.randrange(len(lines)), source.randrange(len(lines))
    action = source.randrange(3)
    if action == 0:
        del lines[a]
    elif action == 1:
        lines.insert(a, lines[b])
    else:
        lines[a], lines[b] = lines[b], lines[a]
    data[:] = b"\n".join(lines)


MUTATORS: tuple[Callable[[bytearray, random.Random], None], ...] = (
    flip_a_bit, flip_a_bit, flip_a_bit_of_the_header, flip_a_bit_of_the_header,
    set_a_byte, cut_off, lose_a_piece, double_a_piece, zero_a_piece, change_a_number,
    change_a_number, lose_or_swap_lines,
)  # fmt: skip


def mutated(data: bytes, seed: int) -> bytes:
    """Return the data after one to three changes, which are the same for the same seed."""
    source = random.Random(seed)
    changed = bytearray(data)
    for _ in range(source.choice((1, 1, 1, 2, 3))):
        if len(changed) > 1:
            source.choice(MUTATORS)(changed, source)
    return bytes(changed)
