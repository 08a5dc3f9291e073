"""Tests of multi-period spectra of ASCE 7-22 that are read from a file with the structure of the
USGS service."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

from tdint.errors import ModelError, TdintError, UsageError
from tdint.output.spectrum_text import spectrum_text
from tdint.response.spectra.target import read_target
from tdint.units import STANDARD_GRAVITY

PERIODS = [0, 0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.75, 1, 1.5]
PERIODS += [2, 3, 4, 5, 7.5, 10]
"""The periods of the service, s."""

ORDINATES = [min(0.4 + 6.0 * t, 1.0, 0.6 / max(t, 0.01)) for t in PERIODS]
"""A design spectrum of two periods at these periods, g."""


def content(**changes):
    """Return a response of the web service with artificial values, including its other entries."""
    data = {
        "pgam": 0.6,
        "sds": 1.0,
        "sd1": 0.6,
        "sdc": "D",
        "tl": 8,
        "twoPeriodDesignSpectrum": {"periods": [0, 0.2], "ordinates": [0.4, 1.0]},
        "multiPeriodDesignSpectrum": {"periods": PERIODS, "ordinates": ORDINATES},
        "multiPeriodMCErSpectrum": {
            "periods": PERIODS,
            "ordinates": [1.5 * value for value in ORDINATES],
        },
    }
    return {
        "request": {
            "date": "2026-01-31T00:00:00.000Z",
            "referenceDocument": "ASCE7-22",
            "status": "success",
            "parameters": {"latitude": 34.05, "longitude": -118.25, "siteClass": "C"},
        },
        "response": {"data": data | changes, "metadata": {"vs30": 530}},
    }


@pytest.fixture
def site(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("site.json").write_text(json.dumps(content()))


def test_values_are_linear_between_periods_of_file(site):
    target = read_target("asce7-22:site.json")
    np.testing.assert_allclose(
        target.at(PERIODS), STANDARD_GRAVITY * np.array(ORDINATES), rtol=1e-14
    )
    middle = 0.5 * (ORDINATES[14] + ORDINATES[15])
    assert target.at(1.25)[0] == pytest.approx(STANDARD_GRAVITY * middle, rel=1e-14)
    assert target.zero == STANDARD_GRAVITY * ORDINATES[0] and target.damping == 0.05
    np.testing.assert_allclose(
        read_target("mcer-22:site.json").at(PERIODS), 1.5 * target.at(PERIODS), rtol=1e-14
    )
    again = pickle.loads(pickle.dumps(target))
    np.testing.assert_array_equal(again.at([0.0, 0.33, 9.0]), target.at([0.0, 0.33, 9.0]))
    # Max PSV over max Sa: TS = SD1 / SDS = 0.6 s, if the file had this period.
    assert target.corner == pytest.approx(0.6, rel=1e-9)
    with pytest.raises(UsageError, match="0 to 10 s"):
        target.at(11.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"multiPeriodDesignSpectrum": None}, "JSON file of the USGS"),
        ({"multiPeriodDesignSpectrum": {"periods": PERIODS}}, "must be a JSON file of the USGS"),
        (
            {"multiPeriodDesignSpectrum": {"periods": PERIODS, "ordinates": ["1"] * 22}},
            "must be a JSON file of the USGS",
        ),
        (
            {"multiPeriodDesignSpectrum": {"periods": PERIODS, "ordinates": ORDINATES[:-1]}},
            "of equal length, got 22 and 21",
        ),
        (
            {"multiPeriodDesignSpectrum": {"periods": PERIODS[::-1], "ordinates": ORDINATES}},
            "must start at 0 s and increase",
        ),
        (
            {
                "multiPeriodDesignSpectrum": {
                    "periods": PERIODS,
                    "ordinates": [20.0 * value for value in ORDINATES],
                }
            },
            "ordinates must be in g",
        ),
    ],
)
def test_invalid_files_are_refused_with_name(site, changes, message):
    Path("site.json").write_text(json.dumps(content(**changes)))
    with pytest.raises(ModelError, match=message) as raised:
        read_target("asce7-22:site.json")
    assert str(raised.value).startswith("site.json: ")


def test_missing_files_are_refused(site):
    with pytest.raises(UsageError, match="add the JSON file"):
        read_target("asce7-22")
    with pytest.raises(TdintError, match=r"no\.json: cannot be read"):
        read_target("asce7-22:no.json")
    Path("text.json").write_text("not JSON")
    with pytest.raises(ModelError, match=r"text\.json: must be a JSON file"):
        read_target("mcer-22:text.json")


def test_printed_form_contains_standard_and_file():
    assert spectrum_text("asce7-22:site.json") == (
        "ASCE 7-22 multi-period design spectrum (site.json)"
    )
    assert spectrum_text("mcer-22:a/b.json") == "ASCE 7-22 multi-period MCER spectrum (a/b.json)"
