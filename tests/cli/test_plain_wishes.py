"""Small requests of users: scale factors of spectra, distinct record names, advice for several
models or methods, titles and labels."""

import numpy as np
import pytest

from tdint.ground_motion.record import Record
from tdint.output.figures.spectrum_curves import in_median
from tdint.output.figures.style import record_names


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
        True, False, False, True,
    ]  # fmt: skip
    assert in_median([Line("HNZ"), Line("UP")]) == [True, True]
