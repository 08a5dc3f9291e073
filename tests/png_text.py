"""Text chunks of PNG files: the command that drew a committed figure.

The pixels are not changed, and no image library is needed.
"""

import zlib
from pathlib import Path

COMMAND = "Command"
"""Keyword of the chunk with the command."""

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_HEADER_END = len(_SIGNATURE) + 25  # the header chunk IHDR with 25 bytes is always first


def _chunks(data: bytes):
    """Yield the position, type and content of each chunk."""
    assert data.startswith(_SIGNATURE), "not a PNG file"
    position = len(_SIGNATURE)
    while position < len(data):
        length = int.from_bytes(data[position : position + 4])
        yield (
            position,
            data[position + 4 : position + 8],
            data[position + 8 : position + 8 + length],
        )
        position += length + 12


def texts(file: Path) -> dict[str, str]:
    """Return the texts of a PNG file by keyword."""
    found = {}
    for _, chunk_type, content in _chunks(file.read_bytes()):
        if chunk_type == b"iTXt":
            keyword, _, remainder = content.partition(b"\0")
            # Compression flag and method, then language and translated keyword, both empty here.
            found[keyword.decode("latin-1")] = remainder[2:].split(b"\0", 2)[2].decode()
        elif chunk_type == b"tEXt":
            keyword, _, text = content.partition(b"\0")
            found[keyword.decode("latin-1")] = text.decode("latin-1")
    return found


def with_command(data: bytes, command: str) -> bytes:
    """Return the bytes of a PNG file with its command, which replaces any earlier command."""
    for position, chunk_type, content in list(_chunks(data)):
        if chunk_type == b"iTXt" and content.startswith(COMMAND.encode() + b"\0"):
            data = data[:position] + data[position + len(content) + 12 :]
            break
    content = COMMAND.encode() + b"\0\0\0\0\0" + command.encode()
    checksum = zlib.crc32(b"iTXt" + content).to_bytes(4)
    chunk = len(content).to_bytes(4) + b"iTXt" + content + checksum
    return data[:_HEADER_END] + chunk + data[_HEADER_END:]


def stamp(file: Path, command: str) -> None:
    """Write the command into a PNG file."""
    file.write_bytes(with_command(file.read_bytes(), command))
