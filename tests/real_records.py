"""Real records, which are not shipped with the project but read from the directory
TDINT_RECORDS."""

import os
from pathlib import Path

import pytest


def real_file(name: str) -> Path:
    """Return the path of a real record, or skip the test if it is not available."""
    folder = os.environ.get("TDINT_RECORDS", "")
    if not folder:
        pytest.skip("TDINT_RECORDS does not name a folder of real records")
    path = Path(folder) / name
    if not path.is_file():
        pytest.skip(f"the folder of TDINT_RECORDS has no {name}")
    return path
