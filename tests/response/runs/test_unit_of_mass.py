"""The motion of a building does not depend on the unit of mass: if all masses and forces are
multiplied by a factor, drifts are equal and forces are multiplied by it. A number with a hidden
unit (a tolerance in N, a mass in kg) would change them."""

import re

import numpy as np
import pytest
import yaml

import tdint
from tdint.assessment.validation.validation import pulse
from validation.separate_solver import SAMPLING, cases

RECORD = tdint.make_record(pulse(), dt=SAMPLING, units="m/s^2")

FACTOR = 2.0**-20
"""Masses of the cases of 1e5 kg become .1 kg. A power of two has no rounding."""
WITH_MASS = {
    *("mass", "inertance", "stiffness", "stop_stiffness", "dashpot", "coefficient", "brace"),
    *(
        "yield_force",
        "strength",
        "ultimate_force",
        "force",
        "amplitude",
        "last_slope",
        "return_slope",
    ),
    *("coefficients",),
}
"""Keys with the dimension of a mass, a force, or their quotient by a length or time."""
FORCE_SECOND = {"backbone", "return", "points"}
"""Lists of pairs, of which the second number is a force."""
WITHOUT = {"rayleigh", "pinching", "transition", "negative_ratio"}
"""Sections with ratios, in which keys of the same names have another dimension."""


def scaled(item):
    """Return a model with masses and forces multiplied by FACTOR."""
    if isinstance(item, list):
        return [scaled(part) for part in item]
    if not isinstance(item, dict):
        return item
    result = {}
    for key, value in item.items():
        if key in WITHOUT:
            result[key] = value
        elif key in FORCE_SECOND:
            result[key] = [[first, FACTOR * second] for first, second in value]
        elif key in WITH_MASS and not isinstance(value, dict):
            numbers = np.asarray(value, dtype=float) * FACTOR
            result[key] = numbers.tolist()
        else:
            result[key] = scaled(value)
    return result


def read_numbers(text):
    """Return a model; PyYAML reads numbers like 1.0e5 as texts."""
    return yaml.safe_load(re.sub(r"\d\.?\d*e\d+", lambda found: repr(float(found[0])), text))


@pytest.mark.parametrize("case", cases(), ids=[case["name"] for case in cases()])
def test_motion_is_independent_of_the_unit_of_mass(case):
    model = read_numbers(case["model"])
    whole = tdint.run(model, RECORD, history=True)
    part = tdint.run(scaled(model), RECORD, history=True)
    for name, values in vars(whole.stories).items():
        factor = FACTOR if any(word in name for word in ("shear", "force", "energy")) else 1.0
        np.testing.assert_allclose(
            getattr(part.stories, name), factor * np.asarray(values), rtol=1e-9, err_msg=name
        )
    np.testing.assert_allclose(
        part.history.displacement, whole.history.displacement, rtol=0.0, atol=1e-12
    )
