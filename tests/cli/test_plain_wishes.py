"""Small requests of users: scale factors of spectra, distinct record names, advice for several
models or methods, titles and labels."""

import math

import numpy as np
import pytest

from csv_rows import rows
from tdint.ground_motion.record import Record
from tdint.output.figures.spectrum_curves import in_median
from tdint.output.figures.style import changed, record_names, scaled_unit
from tdint.units import parse_output_units


def test_a_spectrum_of_a_scaled_record(folder, tdint):
    call = ("spectrum", "motion.mseed", "--units", "m/s^2", "--period", "0.3,1")
    plain, scaled = (rows(tdint(*call, *options).stdout) for options in ((), ("--scale", "-1.7")))
    for plain_row, scaled_row in zip(plain, scaled, strict=True):
        assert math.isclose(
            1.7 * float(plain_row["psa_m_s2"]), float(scaled_row["psa_m_s2"]), rel_tol=1e-10
        )


@pytest.mark.parametrize(
    ("arguments", "advice"),
    [
        (("shaken.yaml", "forced.yaml", "motion.mseed"), "models: [shaken.yaml, forced.yaml]"),
        (
            ("shaken.yaml", "--method", "newmark-average,impulse4", "--plot=a.png"),
            "tdint chart shaken.yaml --method newmark-average,impulse4",
        ),
    ],
)
def test_several_models_point_to_campaigns_and_several_methods_to_the_chart(
    folder, tdint, arguments, advice
):
    tdint.refused(advice, "run", *arguments)


@pytest.mark.parametrize(
    ("sources", "expected"),
    [
        (["a/x.at2", "b/y.at2"], ["x.at2", "y.at2"]),
        (["a/x.at2", "b/x.at2", "c.at2"], ["a/x.at2", "b/x.at2", "c.at2"]),
        (["1/a/x.at2", "2/a/x.at2"], ["1/a/x.at2", "2/a/x.at2"]),
    ],
)
def test_records_with_equal_names_get_distinct_names(sources, expected):
    assert [record_names(sources)[source] for source in sources] == expected


class Line:
    """Result of a component."""

    def __init__(self, component: str) -> None:
        self.record = Record(np.zeros(4), 0.01, "", "", component, "file")


def test_vertical_components_are_excluded_from_a_median_of_horizontals():
    assert in_median([Line("HNE"), Line("HNZ"), Line("UP"), Line("090")]) == [
        True,
        False,
        False,
        True,
    ]
    assert in_median([Line("HNZ"), Line("UP")]) == [True, True]


def test_titles_contain_the_scale():
    record = Record(np.ones(4), 0.01, "", "", "HNE", "file")
    assert changed([record]) == ""
    assert changed([record.scaled(1.7)]) == " x 1.7"
    assert changed([record.scaled(1.7), record]) == ""


def test_large_numbers_of_other_units_have_their_power_in_the_label():
    """Above the panel, the power of ten would be hidden by a legend."""
    units = parse_output_units("kN,mm")
    factor, label = scaled_unit(2.3e6, "J", units)  # 2.3e6 kN mm
    assert (label, factor * 2.3e6) == ("10⁶ kN·mm", pytest.approx(2.3))
    assert scaled_unit(5e4, "J", units)[1] == "kN·mm"
