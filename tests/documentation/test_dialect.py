"""The rate of dialect markers decreases, layer by layer."""

import json

import dialect


def test_the_rate_of_markers_in_no_layer_exceeds_its_stored_rate():
    """After a rewrite, `python tests/dialect.py --store` lowers the stored rates."""
    stored = json.loads(dialect.STORED_RATES.read_text())
    rates = dialect.survey().rates()
    assert rates.keys() == stored.keys()
    assert {layer: rate for layer, rate in rates.items() if rate > stored[layer]} == {}
