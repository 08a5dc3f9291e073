"""Keys of model files and of descriptions of records, which `keys.csv` declares."""

from __future__ import annotations

from tdint.model.keys.declared import KeyFile

keys = KeyFile(__file__)
"""Keys of a section of `keys.csv`."""
