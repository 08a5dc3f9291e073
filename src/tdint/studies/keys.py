"""Keys of campaign files and of files of recordings, which `keys.csv` declares."""

from __future__ import annotations

from tdint.model.keys.declared import KeyFile

keys = KeyFile(__file__)
"""Keys of a section of `keys.csv`."""
