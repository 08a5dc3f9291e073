"""The rate of dialect markers in each layer does not increase."""

import json

import pytest

import dialect


@pytest.mark.long
def test_marker_rates_do_not_exceed_the_stored_rates():
    """After a rewrite, `python tests/dialect.py --store` lowers the stored rates. The layer `tests`
    contains this test suite."""
    stored = json.loads(dialect.STORED_RATES.read_text())
    rates = dialect.survey().rates()
    assert rates.keys() == stored.keys()
    assert {layer: rate for layer, rate in rates.items() if rate > stored[layer]} == {}
