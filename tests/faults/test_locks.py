"""Locks whose files are removed."""

import sys

import pytest

from faults.locks import LOCKS, stress
from selection import every
from tdint.system import locked

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks processes")


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "removed"),
    every(3, [(name, removed) for removed in ("with the lock", "never") for name in LOCKS]),
)
def test_removing_a_lock_file_allows_no_second_process(name, removed):
    sections, overlaps = stress(name, removed, seconds=0.7, processes=4)
    assert sections > 10 and overlaps == 0


def test_a_lock_file_that_cannot_be_created_does_not_block(tmp_path):
    with locked(tmp_path / "no folder" / "lock", lambda: pytest.fail("waited")):
        pass
    with locked(None, lambda: pytest.fail("waited")):
        pass


@pytest.mark.slow
def test_removing_a_lock_file_allows_no_second_process_for_longer():
    """A file that was removed between two calls of the system was used without a lock, in 5 of 8000
    sections."""
    sections, overlaps = stress("file", "with the lock", seconds=15.0, seed=5)
    assert sections > 1000 and overlaps == 0
