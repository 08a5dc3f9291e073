"""Parameters of softening and pinching laws in model files."""

import io
import math
import pickle
from typing import Any

import pytest

from facts import states
from tdint import load_model
from tdint.errors import ModelError, UsageError
from tdint.kernels.laws.law import LawParameter
from tdint.model.building import assemble
from tdint.model.config.sections import ModelUnits
from tdint.model.config.stories import read_law
from tdint.model.definition import Model
from tdint.model.keys.fields import Value
from tdint.model.keys.nodes import Faults, nodes_of
from tdint.model.story import Story
from tdint.model.story_laws import LAWS
from tdint.units import OutputUnits

TRILINEAR = (
    "type: trilinear-pinching, yield_force: 10, ultimate_force: 20, ultimate_drift: 100, pinching: "
    "0.5"
)
IMK = (
    "type: imk, yield_force: 10, plastic_drift: 50, post_capping_drift: 100, capping_ratio: 1.1, "
    "residual_ratio: 0.2"
)
SIDE = (1e4, 0.05, 0.1, 1.1, 0.2, 0.4, 1.0)
SI = ModelUnits(1.0, 1.0, 1.0, OutputUnits())
NUMBERS = (
    "a positive number for all of strength, capping, reloading, unloading, a mapping of them, or "
    "none"
)


def read(text: str, more: str = "") -> Story:
    """Return a story with a law, in SI units."""
    model = (
        f"units: {{force: kN, length: mm, mass: kg}}\nstories: [{{mass: 1, {more}law: {{{text}}}}}]"
    )
    return load_model(io.StringIO(model)).stories[0]


def law(text: str) -> tuple[float, ...]:
    """Return the parameters of the law of a story with k = 1 kN/mm, in SI units."""
    return read(text, "stiffness: 1, ").law.parameters


def test_parameters_of_trilinear_pinching() -> None:
    assert law(f"{TRILINEAR}, unloading: 0.3") == pytest.approx(
        (1e4, 2e4, 0.1, 0.5, 0.3), rel=1e-15
    )


def test_imk_defaults() -> None:
    expected = (*SIDE, *SIDE, *4 * [math.inf], 1.0, 1.0, 1.0)
    assert law(f"{IMK}, ultimate_drift: 400") == pytest.approx(expected, rel=1e-15)
    assert law(f"{IMK}, ultimate_drift: 400, deterioration: none") == law(
        f"{IMK}, ultimate_drift: 400"
    )
    peak_oriented = f"{IMK}, ultimate_drift: 400, pinching: {{force: 1, drift: 1}}"
    assert law(peak_oriented) == law(f"{IMK}, ultimate_drift: 400")


def test_imk_with_all_parameters() -> None:
    more = (
        "deterioration: {strength: 900, unloading: 600}, exponent: 1.5, rate: 0.9, pinching: "
        "{drift: 0.5, force: 0.3}"
    )
    other = "negative: {yield_force: 8, rate: 0.5, ultimate_drift: 300}"
    expected = (
        *SIDE[:6], 0.9, 8e3, *SIDE[1:5], 0.3, 0.5, 0.9, math.inf, math.inf, 0.6, 1.5, 0.3, 0.5,
    )  # fmt: skip
    assert law(f"{IMK}, ultimate_drift: 400, {more}, {other}") == pytest.approx(expected, rel=1e-15)
    assert law(f"{IMK}, ultimate_drift: 400, deterioration: 700")[14:18] == pytest.approx(
        4 * [0.7], rel=1e-15
    )


MULTILINEAR = "type: multilinear-pinching, pinching: {drift: 0.5, force: 25%, unloading: 0.05}"
POINTS = "[[10, 4], [20, 6], [40, 5], [80, 1]]"


def law_with_own_stiffness(text: str) -> tuple[float, ...]:
    """Return the parameters, in SI units, of a law that defines the stiffness of its story."""
    story = read(text)
    assert story.stiffness == pytest.approx(
        story.law.parameters[1] / story.law.parameters[0], rel=1e-15
    )
    return story.law.parameters


def test_multilinear_pinching_defaults() -> None:
    side = (0.01, 4e3, 0.02, 6e3, 0.04, 5e3, 0.08, 1e3)
    intact = (math.inf, *3 * (0.0, 0.0, 1.0, 1.0, 0.0), math.inf)
    expected = (*side, *side, *2 * (0.5, 0.25, 0.05), *intact)
    assert law_with_own_stiffness(f"{MULTILINEAR}, backbone: {POINTS}") == pytest.approx(
        expected, rel=1e-14
    )


@pytest.mark.parametrize(
    ("points", "four"),
    [
        ("[[10, 4], [40, 10]]", (0.01, 4e3, 0.02, 6e3, 0.03, 8e3, 0.04, 10e3)),
        ("[[10, 4], [20, 6], [40, 5]]", (0.01, 4e3, 0.02, 6e3, 0.03, 5.5e3, 0.04, 5e3)),
    ],
)
def test_backbone_with_fewer_points_is_interpolated(points: str, four: tuple[float, ...]) -> None:
    assert law_with_own_stiffness(f"{MULTILINEAR}, backbone: {points}")[:8] == pytest.approx(
        four, rel=1e-14
    )


def test_multilinear_pinching_with_all_parameters() -> None:
    read = law_with_own_stiffness(
        f"{MULTILINEAR}, backbone: {POINTS}, ultimate_drift: 80, negative: {{backbone: [[8, 4], "
        "[20, 4]], pinching: {force: 0.3}}, degradation: {capacity: 10, drift: {peak: 0.1, limit: "
        "0.3}, strength: {work: 0.4, peak_exponent: 0.5, work_exponent: 0, limit: 0.9}}"
    )
    assert read[8:16] == pytest.approx((0.008, 4e3, 0.012, 4e3, 0.016, 4e3, 0.02, 4e3), rel=1e-14)
    assert read[16:23] == pytest.approx((0.5, 0.25, 0.05, 0.5, 0.3, 0.05, 0.08), rel=1e-14)
    losses = ((0.0, 0.0, 1.0, 1.0, 0.0), (0.1, 0.0, 1.0, 1.0, 0.3), (0.0, 0.4, 0.5, 0.0, 0.9))
    assert read[23:] == (*losses[0], *losses[1], *losses[2], 10.0)


BACKBONE = "backbone: [[20, 8], [40, 12], [100, 15]]"


def test_multilinear_defaults() -> None:
    read = law_with_own_stiffness_of_multilinear(f"rule: peak, {BACKBONE}")
    side = (0.02, 8e3, 0.04, 12e3, 0.1, 15e3)
    assert read[:2] == (3.0, 0.0)
    for first in (2, 82):
        assert read[first : first + 6] == pytest.approx(side, rel=1e-14)
        assert set(read[first + 6 : first + 80]) == {math.inf}
    # Slope of the other side, keys of rule peak, sides, slopes of the curve `return`
    assert read[162:172] == (0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_multilinear_with_other_side() -> None:
    read = law_with_own_stiffness_of_multilinear(
        f"rule: elastic, {BACKBONE}, last_slope: -0.2, negative: {{backbone: [[30, 0], [50, -2]]}}"
    )
    assert read[:2] == (4.0, pytest.approx(-2e5, rel=1e-14))
    assert read[82:86] == pytest.approx((0.03, 0.0, 0.05, -2e3), rel=1e-14)


def law_with_own_stiffness_of_multilinear(text: str) -> tuple[float, ...]:
    """Return the parameters of a multilinear law, in SI units."""
    story = read(f"type: multilinear, {text}")
    assert story.stiffness == pytest.approx(4e5, rel=1e-14)
    return story.law.parameters


# Law and error of the only story; a falling segment that only becomes flat also needs a spring that
# creates energy.
ERRORS = r"""
<trilinear>, unloading: 1 -> law.unloading: ... at least 0 and below 1, got '1'
type: trilinear-pinching, yield_force: 10, ultimate_force: 9, ultimate_drift: 100, pinching: 0.5, unloading: 0 -> law: ultimate_force must be at least yield_force
type: trilinear-pinching, yield_force: 10, ultimate_force: 20, ultimate_drift: 10, pinching: 0.5, unloading: 0 -> law: ultimate_drift ... 0.01 m
type: trilinear-pinching, yield_force: 10, ultimate_force: 20, ultimate_drift: 15, pinching: 0.5, unloading: 0 -> law: ... ultimate point ... below
<imk> -> law.ultimate_drift: is missing; give a positive number
<imk>, ultimate_drift: 9 -> law: ultimate_drift ... 0.01 m, got 0.009 m
<imk>, ultimate_drift: 99, negative: {yield_force: 100} -> law: negative.ultimate_drift ... 0.1 m, got 0.099 m
<imk>, ultimate_drift: 99, negative: {yeld: 1} -> law.negative.yeld: unknown key
<imk>, ultimate_drift: 99, negative: 3 -> law.negative: must be a mapping ... yield_force,
<imk>, ultimate_drift: 99, pinching: 0.5 -> law.pinching: must be a mapping ... force, drift
<imk>, ultimate_drift: 99, pinching: {force: 0.5} -> law.pinching.drift: is missing; give a number
<imk>, ultimate_drift: 99, deterioration: [1] -> law.deterioration: must be <numbers>, got a list
<imk>, ultimate_drift: 99, deterioration: 0 -> law.deterioration: must be <numbers>, got '0'
<imk>, ultimate_drift: 99, deterioration: {caping: 1} -> law.deterioration.caping: unknown key; did you mean
<pinching>, backbone: [[1, 1]] -> law.backbone: ... two to four points [drift, force]
<pinching>, backbone: [[1, 1], [2]] -> law.backbone: ... two to four points [drift, force]
<pinching>, backbone: [[1, 1], 2] -> law.backbone[2]: must be a point [drift, force], got '2'
<pinching>, backbone: [[1, 1], [2, 0]] -> law.backbone[2][2]: must be a positive number, got '0'
<pinching>, backbone: [[2, 1], [1, 2]] -> law: ... backbone must rise
<pinching>, backbone: <points>, negative: {backbone: [[2, 1], [1, 2]]} -> law: the drifts of negative.backbone must
<pinching>, ultimate_drift: 3 -> law.backbone: is missing; ... [drift, force]
<pinching>, backbone: <points>, degradation: {strength: {limit: 1}} -> law.degradation.strength.limit: must be a
<pinching>, backbone: <points>, degradation: {strength: {work: 1}} -> law.degradation.strength.limit: is missing
<pinching>, backbone: <points>, degradation: {} -> law.degradation.capacity: is missing; give a positive number
<pinching>, backbone: <points>, negative: {pinching: {forse: 1}} -> law.negative.pinching.forse: unknown key
type: multilinear-pinching, backbone: <points> -> law.pinching: ... missing; ... drift, force, unl
type: multilinear, <backbone> -> law.rule: is missing; give one of kinematic, isotropic, origin, peak, elastic
type: multilinear, rule: kinematc, <backbone> -> law.rule: unknown rule 'kinematc'; did you mean
type: multilinear, rule: peak, backbone: [] -> law.backbone: must be one to 40 points
type: multilinear, rule: peak, backbone: [[0, 0], [1, 1]] -> law.backbone[1]: must be the first corner ... not the origin
type: multilinear, rule: peak, <backbone>, negative: {backbone: [[0, 0], [20, 8]]} -> law.negative.backbone[1]: must be the first corner
type: multilinear, rule: peak, backbone: [[1, 1], [1, 2]] -> law: the drifts of backbone must ... increase
type: multilinear, rule: peak, backbone: [[-1, -1]] -> law: the drifts of backbone must be positive
type: multilinear, rule: origin, backbone: [[1, 1], [2, 0]] -> law: the forces of backbone must be positive
type: multilinear, rule: kinematic, backbone: [[1, 1], [2, 1.2], [3, 2]] -> law: rule kinematic requires slopes that decrease ... at point 2; use
type: multilinear, rule: kinematic, backbone: [[1, 1], [2, 1.2]], last_slope: 0.5 -> law: rule kinematic requires slopes that decrease ... at point 2; use
type: multilinear, rule: kinematic, backbone: [[1, 1], [2, 0.8]] -> law: rule kinematic requires slopes that decrease ... at point 2; use
type: multilinear, rule: kinematic, <backbone>, negative: {backbone: [[20, 8], [40, 11], [100, 14]]} -> law: rule kinematic requires the same slopes on both sides
type: multilinear, rule: isotropic, backbone: [[1, 1], [2, 2]] -> law: rule isotropic requires slopes below the initial stiffness
type: multilinear, rule: peak, <backbone>, negative: {backbone: [[20, 7]]} -> law: the first point of negative.backbone must be on the line of ... 400000 N/m
"""  # noqa: E501
SHORT = {
    "<trilinear>": TRILINEAR, "<imk>": IMK, "<pinching>": MULTILINEAR, "<points>": POINTS,
    "<backbone>": BACKBONE, "<numbers>": NUMBERS,
}  # fmt: skip


@pytest.mark.parametrize("line", ERRORS.strip().splitlines())
def test_errors_of_laws(line: str) -> None:
    for short, replacement in SHORT.items():
        line = line.replace(short, replacement)
    text, message = line.split(" -> ")
    with pytest.raises(ModelError) as caught:
        read(text, "" if "multilinear" in text else "stiffness: 1, ")
    assert states(str(caught.value), f"stories[1].{message}")
    # Without its capacity, a degradation has a second error.
    assert len(caught.value.faults) == 1 or "degradation" in text


def test_other_side_of_a_law_follows_a_varied_parameter() -> None:
    model = load_model(
        io.StringIO(
            "stories: [{mass: 1, stiffness: 1, law: {type: bilinear, yield_force: 3, hardening: 0}}"
            ", {mass: 1, stiffness: 1, law: {type: bilinear, yield_force: 3, hardening: 0, "
            "negative: {yield_force: 2}}}]"
        )
    )
    changed = model.replace(**{"stories.law.yield_force": 5.0})
    assert [story.law.parameters for story in changed.stories] == [(5, 0, 5), (5, 0, 2)]
    both = {"stories.law.negative.yield_force": 4.0, "stories.law.yield_force": 5.0}
    for names in (both, dict(reversed(both.items()))):
        parameters = [story.law.parameters for story in model.replace(**names).stories]
        assert parameters == [(5, 0, 4), (5, 0, 4)]


def test_return_slopes_follow_a_varied_last_slope() -> None:
    """The return slope of the negative side follows that of the positive side, which follows the
    slope of the curve; a slope that is set by its name does not."""
    law = {"type": "multilinear", "rule": "flag", "backbone": [[1, 10]], "return": [[0.4, 4]]}

    def flag(**slopes: float) -> Model:
        return load_model({"stories": [{"mass": 1, "law": {**law, **slopes}}]})

    model = flag(last_slope=2.0)
    for slope in (1.0, 3.0):
        changed = model.replace(**{"stories.law.last_slope": slope})
        assert changed.stories == flag(last_slope=slope).stories
    both = {"stories.law.return_slope": 1.0, "stories.law.last_slope": 3.0}
    for names in (both, dict(reversed(both.items()))):
        changed = model.replace(**names)
        assert changed.stories == flag(last_slope=3.0, return_slope=1.0).stories


def test_ratio_of_fracture_is_a_drift_ratio_also_for_an_inclined_element() -> None:
    """A length is along the element; a percentage is a fraction of the story height."""
    element = {"type": "bilinear", "stiffness": 1e6, "yield_force": 1e3, "hardening": 0}
    elements = [
        {**element, "name": name, "factor": 0.8, "fracture_drift": drift}
        for name, drift in (("length", 0.06), ("ratio", "2%"))
    ]
    model = load_model({"stories": [{"mass": 1e3, "height": 3.0, "elements": elements}]})
    drifts = [spring.law.fracture for spring in model.stories[0].elements]
    assert drifts == [pytest.approx((0.075, -0.075)), pytest.approx((0.06, -0.06))]


@pytest.mark.parametrize("drift", ["2%", 0.07, {"positive": "3%", "negative": 0.08}])
def test_varied_height_changes_drifts_of_fracture_like_an_edited_file(drift: object) -> None:
    law = {"type": "bilinear", "hardening": 0, "fracture_drift": drift}
    brace = {**law, "stiffness": 1e6, "yield_force": 1e3, "name": "brace", "factor": 0.8}

    def story(height: float, force: float = 1e3) -> Model:
        story = {"mass": 1e3, "height": height}
        single = {**story, "stiffness": 1e6, "law": {**law, "yield_force": force}}
        return load_model({"stories": [{**story, "elements": [brace]}, single]})

    changed = story(3.0).replace(**{"stories.height": 4.1})
    assert pickle.loads(pickle.dumps(changed)).stories == story(4.1).stories
    for names in ({"stories[2].law.yield_force": 1e5}, {"stories.height": 0.02, "mass_factor": 2}):
        if drift == 0.07 and "mass_factor" in names:
            continue
        with pytest.raises(UsageError, match=r"fracture_drift is .* at least the yield drift"):
            story(3.0).replace(**names)
    with pytest.raises(ModelError, match="at least the yield drift"):
        story(3.0, 1e5)


def test_varied_number_of_a_single_inclined_element_is_the_value_along_it() -> None:
    element = {"name": "brace", "type": "bilinear", "stiffness": 2e7, "factor": 0.8}
    element |= {"yield_force": 1e5, "hardening": 0.02}
    model = load_model({"stories": [{"mass": 1e5, "elements": [element]}]})
    for name in ("stories[1].elements[1].stiffness", "stories[1].elements[brace].yield_force"):
        key = name.rpartition(".")[2]
        changed = load_model({"stories": [{"mass": 1e5, "elements": [{**element, key: 1.5e6}]}]})
        assert model.replace(**{name: 1.5e6}).stories == changed.stories


def test_strength_factor_of_multilinear_keeps_the_slopes() -> None:
    model = load_model(
        io.StringIO(f"stories: [{{mass: 1, law: {{type: multilinear, rule: peak, {BACKBONE}}}}}]")
    )
    story = model.replace(strength_factor=2.0).stories[0]
    assert story.law.parameters[2:8] == (40, 16, 80, 24, 200, 30)
    assert story.stiffness == model.stories[0].stiffness
    with pytest.raises(UsageError, match="rule"):
        model.replace(**{"stories.law.rule": 1.0})


def own_values(parameter: LawParameter, number: int) -> list[float | str] | list[list[float]]:
    """Return values of a parameter, within its bounds, that no other parameter has."""
    low, high = max(parameter.low, -0.9), min(parameter.high, 1.5)
    count = 2 * parameter.points or (3 if parameter.many else 1)
    numbers = [
        low + (high - low) * (number + (entry + 1) / (count + 1)) / 40.0 for entry in range(count)
    ]
    if parameter.choices:
        return [parameter.choices[-1]]
    if parameter.points:
        return [numbers[i : i + 2] for i in range(0, count, 2)]
    return list(numbers)


@pytest.mark.parametrize("name", LAWS)
def test_each_parameter_is_read_from_its_own_key(name: str) -> None:
    """All parameters of a law, with different values; relations between them are not checked."""
    mapping: dict[str, Any] = {"type": name}
    expected: list[float] = []
    for number, parameter in enumerate(LAWS[name].parameters):
        values = own_values(parameter, number)
        group = mapping
        for key in filter(None, parameter.group.split(".")):
            group = group.setdefault(key, {})
        group[parameter.name] = values if parameter.many or parameter.points else values[0]
        expected += (
            [float(parameter.choices.index(str(values[0])))]
            if parameter.choices
            else [
                float(x)
                for entry in values
                for x in (entry if isinstance(entry, list) else [entry])
            ]
        )
    faults = Faults("model.yaml")
    found, _ = read_law(Value(nodes_of(mapping, faults), "law", faults), SI)
    assert found.parameters == pytest.approx(expected, rel=1e-14)


def test_the_limit_of_resistance_is_where_the_last_lines_of_the_elements_have_no_force() -> None:
    """The sum of strength (1 - hardening) and hardening times stiffness times the drift is zero."""
    elements = [
        {"type": "bilinear", "stiffness": 100, "yield_force": 1, "hardening": -0.1},
        {"type": "bilinear", "stiffness": 50, "yield_force": 2, "hardening": -0.2},
    ]
    building = assemble(load_model({"stories": [{"mass": 1, "elements": elements}]}))
    high, low = building.resistance_limits
    assert high[0] == pytest.approx((1.1 + 2.4) / (10.0 + 10.0)) and low[0] == -high[0]


@pytest.mark.parametrize(
    ("keys", "high", "low"),
    [
        ({"rule": "kinematic"}, 0.3, -0.3),
        ({"rule": "elastic"}, 0.3, -0.3),
        ({"rule": "elastic", "sides": "positive"}, 0.3, -math.inf),
        ({"rule": "peak"}, math.inf, -math.inf),
    ],
)
def test_the_limit_of_resistance_of_a_falling_curve_depends_on_its_rule_and_sides(
    keys: dict[str, Any], high: float, low: float
) -> None:
    """From 1 N at 0.1 m the curve falls by 5 N/m: it has no force at 0.3 m. A law that fails at
    zero force, and a side without a curve, have no limit."""
    law = {"type": "multilinear", "backbone": [[0.1, 1.0]], "last_slope": -5.0, **keys}
    building = assemble(load_model({"stories": [{"mass": 1, "stiffness": 10, "law": law}]}))
    assert [x[0] for x in building.resistance_limits] == pytest.approx([high, low])
