"""Questions about unusual buildings: periods, masses, stiffnesses, drifts and dampers."""

from __future__ import annotations

import io
import math
from itertools import pairwise

import numpy as np
import pytest

from tdint.model.building import assemble
from tdint.model.config.model_file import load_model
from tdint.model.plausibility import plausibility_warnings, unusual_ductility
from tdint.units import FORCE, LENGTH, MASS, STANDARD_GRAVITY


def warnings_of(text: str) -> tuple[str, ...]:
    model = load_model(io.StringIO(text))
    return plausibility_warnings(model, assemble(model))


def uniform_frame(count: int, height: float, period: float, mass: float = 2e5) -> str:
    """Return a model of equal stories with a first period, s.

    The frequency of n equal stories is 2 sqrt(k / m) sin(pi / (2 (2 n + 1))).
    """
    angle = math.pi / (2 * (2 * count + 1))
    stiffness = mass * (math.pi / period / math.sin(angle)) ** 2
    return (
        f"stories: [{{repeat: {count}, mass: {mass!r}, height: {height / count!r}, "
        f"stiffness: {stiffness!r}}}]\ndamping: 3%"
    )


PUBLISHED = [
    # stories, height (m), period (s)
    # Gupta and Krawinkler (1999), SAC steel frames of Los Angeles and Seattle, centerline models
    (3, 11.89, 1.03),
    (3, 11.89, 1.36),
    (9, 37.19, 2.34),
    (9, 37.19, 3.17),
    (20, 80.77, 3.98),
    (20, 80.77, 3.46),
    # Ohtori et al. (2004), benchmark control problem
    (3, 11.89, 1.01),
    (9, 37.19, 2.27),
    (20, 80.77, 3.83),
    # Chopra, section 13.2.6 (4 m) and 12.8 (12 ft)
    (5, 20.0, 2.0),
    (5, 18.29, 2.0),
    # Hazus types W1, S1L, S1H, C1M, C2L, URML, MH: typical height and period
    (1, 4.27, 0.35),
    (2, 7.32, 0.50),
    (13, 47.5, 2.21),
    (5, 15.2, 0.75),
    (2, 6.1, 0.35),
    (1, 4.57, 0.35),
    (1, 3.05, 0.35),
    # Taipei 101, the World Trade Center of 1973
    (101, 508.0, 6.8),
    (110, 417.0, 11.2),
]


@pytest.mark.parametrize(("count", "height", "period"), PUBLISHED)
def test_periods_of_published_buildings_are_usual(count: int, height: float, period: float) -> None:
    assert warnings_of(uniform_frame(count, height, period, mass=2e6)) == ()


@pytest.mark.parametrize(
    ("count", "height", "period", "limits"),
    [
        (3, 10.97, 9.41, "0.05 s to 1.43 s"),  # 0.42 + 0.092 * 10.97
        (3, 10.98, 1.50, "0.05 s to 1.43 s"),
        (10, 35.0, 0.13, "0.167 s to 3.64 s"),  # 10 / 60
        (10, 30.0, 0.13, "0.15 s to 3.18 s"),  # 30 / 200
        (1, 3.5, 1.3, "0.03 s to 1.2 s"),
    ],
)
def test_period_is_compared_with_height_and_stories(
    count: int, height: float, period: float, limits: str
) -> None:
    (line,) = warnings_of(uniform_frame(count, height, period))
    name = f"unusual fundamental period of {count} stor{'y' if count == 1 else 'ies'} and "
    assert line.startswith(name) and f"{period:.3g} s; usual values are {limits}" in line


@pytest.mark.parametrize(
    ("length", "force", "mass", "factor"),
    [
        ("m", "kN", "t", 9.80665), ("m", "N", "kg", 9.80665),
        ("in", "kip", "kip*s^2/in", 386.0886), ("ft", "kip", "kip*s^2/ft", 32.17405),
        ("in", "lbf", "blob", 386.0886), ("mm", "N", "N*s^2/mm", 9806.65),
        ("m", "kN", "kg", 0.00980665),
    ],
)  # fmt: skip
def test_weights_entered_as_masses_are_named_with_the_resulting_period(
    length: str, force: str, mass: str, factor: float
) -> None:
    """Three stories of 3.66 m and 1780 kN, with a period of 0.479 s; the numbers of the weights are
    at the key `mass`."""
    weight, stiffness, height = 1780e3 / FORCE[force], 1.576e8, 3.66 / LENGTH[length]
    units = f"units: {{length: {length}, force: {force}, mass: '{mass}'}}\n"
    story = (
        f"repeat: 3, height: {height!r}, stiffness: {stiffness * LENGTH[length] / FORCE[force]!r}"
    )
    head = f"{units}damping: 3%\nstories: [{{{story}, "
    assert warnings_of(f"{head}weight: {weight!r}}}]") == ()
    (line,) = warnings_of(f"{head}mass: {weight!r}}}]")
    assert MASS[mass] * STANDARD_GRAVITY / FORCE[force] == pytest.approx(factor, rel=1e-6)
    times = f"{factor:.4g} times too large" if factor > 1 else f"{1 / factor:.4g} times too small"
    assert f"; probable cause: weights were entered as masses, which are then {times};" in line
    assert line.endswith("the period 0.479 s")
    if force == "kN":
        assert "the mass of floor 1 would be 181.5 t " in line


def test_weights_as_masses_reduce_the_strength_ratio() -> None:
    """0.15 of the weight and a period of 0.25 s: the period alone, 0.78 s, would be usual."""
    mass = 1e5
    stiffness = mass * (2.0 * math.pi / 0.25) ** 2
    law = f"{{type: bilinear, yield_force: {0.15 * mass * STANDARD_GRAVITY!r}, hardening: 0}}"
    story = f"height: 3.5, stiffness: {stiffness!r}, law: {law}"
    assert warnings_of(f"stories: [{{mass: {mass!r}, {story}}}]") == ()
    (line,) = warnings_of(f"stories: [{{mass: {mass * STANDARD_GRAVITY!r}, {story}}}]")
    assert line.startswith("unusual ratio of the base shear at yield to the weight: 0.0153;")
    assert line.endswith("the mass of floor 1 would be 1e+05 kg and the period 0.25 s")
    # A file with weights cannot have this cause.
    weak = f"stories: [{{weight: {mass * STANDARD_GRAVITY**2!r}, {story}}}]"
    assert "probable cause" not in warnings_of(weak)[0]


FRAME = "repeat: 3, mass: 2e5, height: 3.5, stiffness: 2e8"
IMK = (
    "type: imk, yield_force: 400e3, plastic_drift: 0.049, post_capping_drift: 0.1085, "
    "capping_ratio: 1.162, residual_ratio: 0.01, ultimate_drift: 0.189"
)
ONE = "mass: 3e5, height: 3.5, stiffness: 3e7, law"


@pytest.mark.parametrize(
    ("usual", "implausible", "warning"),
    [
        # Mass over story height: 2e7 / 3.5 kg/m; a tower of 300 m with 1.05 t in each floor.
        (
            "repeat: 3, mass: 2e6, height: 3.5, stiffness: 2e9",
            "repeat: 3, mass: 2e7, height: 3.5, stiffness: 2e10",
            "mass of a floor over the story height: 5.71e+06 kg/m in story 1",
        ),
        (
            "repeat: 80, mass: 1.05e6, height: 3.75, stiffness: 5e9",
            "repeat: 80, mass: 1.05e4, height: 3.75, stiffness: 5e7",
            "mass of a floor over the story height: 2.8e+03 kg/m in story 1",  # below .16 * 300^2
        ),
        # A digit too many, above and below
        (
            f"{FRAME}}}, {{mass: 2e5, height: 3.5, stiffness: 4e7",
            f"{FRAME}}}, {{mass: 2e5, height: 3.5, stiffness: 2e7",
            "ratio of the stiffness of neighboring stories: 10 in stories 3 and 4",
        ),
        (
            f"{FRAME}}}, {{mass: 2e5, height: 3.5, stiffness: 1.5e9",
            f"{FRAME}}}, {{mass: 2e5, height: 3.5, stiffness: 2e9",
            "ratio of the stiffness of neighboring stories: 10 in stories 3 and 4",
        ),
        # Drifts: 0.4 m of 3.5 m; ultimate drifts of 3.6 m
        (
            f"{ONE}: {{type: bilinear, yield_force: 4e5, hardening: 0.02}}",
            f"{ONE}: {{type: bilinear, yield_force: 1.2e7, hardening: 0.02}}",
            "ratio of the yield force to the weight above: 4.08",
        ),
        (f"{ONE}: {{{IMK}}}", f"{ONE}: {{{IMK[:-5]}3.6}}", "ratio of the ultimate drift"),
        (
            f"{ONE}: {{{IMK}}}",
            f"{ONE}: {{{IMK}, negative: {{ultimate_drift: 3.6}}}}",
            "ratio of the ultimate drift to the story height: 1.03 in story 1",
        ),
        # Dampers: c / (2 sqrt(k m)) with k = 3e7, m = 3e5, critical 6e6
        (
            f"{ONE}: {{type: linear}}, dashpot: 1.1e6",
            f"{ONE}: {{type: linear}}, dashpot: 1.8e7",
            "ratio of the damper coefficient to the critical coefficient: 3 in story 1",
        ),
        (
            f"{ONE}: {{type: linear}}, dashpot: {{coefficient: 6e5, brace: 1e8}}",
            f"{ONE}: {{type: linear}}, dashpot: {{coefficient: 6e8, brace: 1e8}}",
            "ratio of the damper coefficient to the critical coefficient: 100 in story 1",
        ),
        # kN instead of N: rate 10 * .01 * 3.5 = .35 m/s, 900 * .35^-.65 / 6e6 = 3e-4
        (
            f"{ONE}: {{type: linear}}, dashpot: {{coefficient: 9e5, exponent: 0.35, brace: 1e8}}",
            f"{ONE}: {{type: linear}}, dashpot: {{coefficient: 900, exponent: 0.35, brace: 1e8}}",
            "ratio of the damper coefficient to the critical coefficient: 0.000297 in story 1",
        ),
    ],
)
def test_values_are_compared_with_the_story(usual: str, implausible: str, warning: str) -> None:
    assert warnings_of(f"stories: [{{{usual}}}]") == ()
    assert any(warning in line for line in warnings_of(f"stories: [{{{implausible}}}]"))


@pytest.mark.parametrize(
    ("deterioration", "is_usual"),
    # 65.1 is lambda; as a length it is 1329 plastic drifts, and as 65.1 mm 1.33 plastic drifts.
    [("65.1", False), ("0.0651", False), ("3.19", True), ("{capping: 65.1}", False)],
)
def test_deterioration_is_a_length(deterioration: str, is_usual: bool) -> None:
    lines = warnings_of(f"stories: [{{{ONE}: {{{IMK}, deterioration: {deterioration}}}}}]")
    assert (lines == ()) is is_usual
    assert all("is a length, lambda times plastic_drift" in line for line in lines)


def test_questions_are_independent_of_the_hysteretic_law() -> None:
    """A linear building gets the same questions as a building that yields."""
    story = "repeat: 3, mass: 1.78e6, height: 3.66, stiffness: 1.576e8"
    soft = "mass: 1.78e6, height: 3.66, stiffness: 1.576e7"
    yielding = ", law: {type: bilinear, yield_force: 8e6, hardening: 0.02}"
    linear = warnings_of(f"stories: [{{{story}}}, {{{soft}}}]\ndamping: 3%")
    assert [line.partition(":")[0] for line in linear] == [
        "unusual fundamental period of 4 stories and 14.64 m",
        "unusual ratio of the stiffness of neighboring stories",
    ]
    nonlinear = warnings_of(f"stories: [{{{story}{yielding}}}, {{{soft}{yielding}}}]\ndamping: 3%")
    assert set(linear) <= set(nonlinear)


@pytest.mark.long
def test_limits_of_the_period_increase_with_height() -> None:
    """A story more does not make a usual period unusual."""
    limits = []
    for count in range(1, 120):
        (line,) = warnings_of(uniform_frame(count, 3.0 * count, 20.0, mass=1e7))[:1]
        low, high = line.partition("usual values are ")[2].partition(" (")[0].split(" to ")
        limits.append((float(low[:-2]), float(high[:-2])))
    for lower, higher in pairwise(limits):
        assert lower[0] <= higher[0] and lower[1] <= higher[1]


@pytest.mark.parametrize(
    "text",
    [
        # Corrected floors of 300 kg.
        "units: {length: m, force: kgf, mass: t}\nstories: [{repeat: 3, mass: 300, height: 3.5, "
        "stiffness: 30000}]\ndamping: 5%",
        # The yield force is 11 times the weight already; a lighter building would be less likely.
        "stories: [{repeat: 3, mass: 3.0e+5, height: 3.5, stiffness: 3.0e+7, law: {type: bilinear, "
        "yield_force: 1.0e+8, hardening: 0.05}}]\ndamping: 5%",
    ],
)
def test_weights_are_not_the_cause_if_the_corrected_masses_are_unusual(text: str) -> None:
    """A usual period with the corrected masses does not suffice."""
    warnings = warnings_of(text)
    assert warnings[0].startswith("unusual fundamental period of 3 stories")
    assert "probable cause" not in "".join(warnings)


_STORY = "{repeat: 3, mass: 100, height: 3.5, stiffness: 1.0e5}"
_DAMPED = "{repeat: 3, mass: 100, height: 3.5, stiffness: 1.0e5, dashpot: "
_BEARING = "{mass: 100, isolator: true, stiffness: "
_ELEMENTS = (
    "{repeat: 3, mass: 100, height: 3.5, elements: [{name: a, type: bilinear, stiffness: 1e5, "
    "yield_force: 500, hardening: 3%}, "
)
_STOP = (
    "{mass: 100, isolator: true, elements: [{name: b, type: bilinear, stiffness: 2e4, yield_force: "
    "200, hardening: 10%}, {name: w, type: gap, gap: "
)
DEVICES = [
    # warning, device with a wrong unit, same device as meant
    (
        "brace",
        f"{_DAMPED}{{coefficient: 800, brace: 25}}}}",
        f"{_DAMPED}{{coefficient: 800, brace: 25000}}}}",
    ),
    (
        "angle",
        f"{_DAMPED}{{coefficient: 800, angle: 0.6}}}}",
        f"{_DAMPED}{{coefficient: 800, angle: 34}}}}",
    ),
    ("damper", f"{_DAMPED}0.8}}", f"{_DAMPED}800}}"),
    (
        "yield force of the isolator",
        f"{_BEARING}2e4, law: {{type: bilinear, yield_force: 6000, hardening: 10%}}}}, {_STORY}",
        f"{_BEARING}2e4, law: {{type: bilinear, yield_force: 200, hardening: 10%}}}}, {_STORY}",
    ),
    (
        "period of the rigid building on the isolator",
        f"{_BEARING}2e7, law: {{type: bilinear, yield_force: 200, hardening: 10%}}}}, {_STORY}",
        f"{_BEARING}2e4, law: {{type: bilinear, yield_force: 200, hardening: 10%}}}}, {_STORY}",
    ),
    (
        "clearance",
        f"{_STOP}100, stop_stiffness: 1e5}}]}}, {_STORY}",
        f"{_STOP}0.3, stop_stiffness: 1e5}}]}}, {_STORY}",
    ),
    (
        "gap to the story height",
        f"{_ELEMENTS}{{name: g, type: gap, gap: 20, stop_stiffness: 1e5}}]}}",
        f"{_ELEMENTS}{{name: g, type: gap, gap: 0.02, stop_stiffness: 1e5}}]}}",
    ),
    (
        "part of an element",
        f"{_ELEMENTS}{{name: b, type: linear, stiffness: 25}}]}}",
        f"{_ELEMENTS}{{name: b, type: linear, stiffness: 25000}}]}}",
    ),
]


@pytest.mark.parametrize(("warning", "wrong", "meant"), DEVICES)
def test_devices_are_compared_with_their_purpose(warning, wrong, meant):
    head = "units: {length: m, force: kN, mass: t}\ndamping: {modal: 4%}\nstories: "
    assert any(warning in text for text in warnings_of(f"{head}[{wrong}]"))
    assert warnings_of(f"{head}[{meant}]") == ()


@pytest.mark.parametrize("key", ["drift_ratio", "residual_drift_ratio"])
@pytest.mark.parametrize(("limit", "count"), [("0.5", 1), ("0.5%", 0), ("3%", 0)])
def test_limits_of_drift_ratios_are_questioned(key, limit, count):
    text = f"stories: [{{mass: 2e5, height: 3, stiffness: 4e7}}]\nlimits: {{{key}: {limit}}}"
    assert len(warnings_of(text)) == count


@pytest.mark.parametrize(
    ("item", "key", "value", "warning"),
    [
        ("tank", "mass", 2000, "ratio of an attached mass"),
        ("tank", "stiffness", 0.008, "period of an attachment"),
        ("tank", "dashpot", 500, "ratio of the damper coefficient"),
        ("tie", "stiffness", 1, "ratio of the stiffness of a link"),
        ("tie", "dashpot", 1e6, "ratio of the damper coefficient"),
    ],
)
def test_attachments_and_links_are_compared_with_their_purpose(item, key, value, warning):
    """A unit that is wrong by a factor of 1000 causes a warning; the model as meant, none."""
    tank = {"name": "tank", "floor": 2, "mass": 2, "stiffness": 80, "dashpot": 0.5}
    tie = {"name": "tie", "from": "ground", "to": 2, "stiffness": 1000, "dashpot": 500}
    for change in ({}, {key: value}):
        model = load_model(
            {
                "units": {"length": "m", "force": "kN", "mass": "t"},
                "stories": [{"repeat": 2, "mass": 100, "height": 3, "stiffness": 5e4}],
                "damping": "5%",
                "attachments": [tank | (change if item == "tank" else {})],
                "links": [tie | (change if item == "tie" else {})],
            }
        )
        texts = plausibility_warnings(model, assemble(model))
        assert any(warning in text for text in texts) == bool(change), texts


def test_an_unusual_ductility_is_judged_by_the_yield_point():
    """The first point of a backbone is the crack at a tenth of the strength. The secant at 60 % of
    the strength gives the yield point: the drift .01 m at 300 kN extends to 1/60 m at 500 kN."""
    points = [(0.0001, 50e3), (0.01, 300e3), (0.03, 500e3), (0.2, 100e3)]
    pinching = {"drift": 0.5, "force": 0.5, "unloading": 0.0}
    backbones = {
        "multilinear-pinching": {
            "pinching": pinching,
            "backbone": [[drift, force] for drift, force in points],
        },
        "multilinear": {"rule": "kinematic", "backbone": [list(point) for point in points[:3]]},
    }
    for name, law in backbones.items():
        story = {"mass": 1e5, "height": 3.0, "law": {"type": name} | law}
        model = load_model({"stories": [story]})
        first = assemble(model).yield_drift
        assert first == pytest.approx([0.0001])

        def warned(drift, model=model, first=first):
            return unusual_ductility(model, first, np.array([drift]) / first)

        limit = 50.0 / 60.0  # m, 50 times the yield point
        assert warned(0.999 * limit) == []  # a ductility of 8325 by the first point
        (text,) = warned(1.001 * limit)
        assert "in story 1" in text and "8.34e+03" in text
    # Without a backbone, the yield drift is the yield point.
    law = {"type": "bilinear", "yield_force": 50e3, "hardening": 0.0}
    model = load_model({"stories": [{"mass": 1e5, "stiffness": 5e8, "height": 3.0, "law": law}]})
    first = assemble(model).yield_drift
    assert unusual_ductility(model, first, np.array([49.9])) == []
    assert unusual_ductility(model, first, np.array([50.1])) != []
