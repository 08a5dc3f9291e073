"""Real records, none of which comes with the project: taken from the folder that TDINT_RECORDS
names."""

import os
from pathlib import Path

import pytest


def real_file(name: str) -> Path:
    """The path of a real record; the test that asks for it is skipped where it is not at hand."""
    folder = os.environ.get("TDINT_RECORDS", "")
    if not folder:
        pytest.skip("TDINT_RECORDS does not name a folder of real records")
    path = Path(folder) / name
    if not path.is_file():
        pytest.skip(f"the folder of TDINT_RECORDS has no {name}")
    return path
