"""The rate of dialect markers does not increase."""

import pytest

import dialect


@pytest.mark.long
def test_marker_rate_does_not_exceed_the_limit():
    assert dialect.survey().rates()["total"] <= dialect.MAX_RATE
