"""The form of a kernel in a file: a line of JSON that describes the object, then the object."""

from __future__ import annotations

import hashlib
import json
from typing import Any

_FORM = "tdint object 1"


def pack(code: bytes, about: dict[str, Any]) -> bytes:
    """An object and what is known about it."""
    about = {"form": _FORM, "size": len(code), "sha256": hashlib.sha256(code).hexdigest(), **about}
    return json.dumps(about).encode() + b"\n" + code


def unpack(data: bytes) -> tuple[bytes, dict[str, Any]]:
    """What `pack` packed.

    Raises
    ------
    ValueError
        The data are something else, cut off or damaged.
    """
    head, _, code = data.partition(b"\n")
    about = json.loads(head)
    if not isinstance(about, dict) or about.get("form") != _FORM or not isinstance(about.get("symbol"), str):
        raise ValueError("not an object of tdint")
    if len(code) != about.get("size") or hashlib.sha256(code).hexdigest() != about.get("sha256"):
        raise ValueError("cut off or damaged")
    return code, about
