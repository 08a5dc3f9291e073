"""Shards that are killed many times, and merged from read-only directories."""

import sys

import pytest

from faults.kills import campaign

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="forks processes"),
]


def test_killed_shards_give_the_tables_of_one_campaign(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    counts = campaign(runs=2000, kills=20, shards=2, seed=4)
    assert (counts["runs"], counts["kills"]) == (2000, 20)
