"""Tests of weights, percentages, damping in one word, misspelled sections, and models without a
file."""

import io
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from facts import each_states, states
from json_schema import tree, valid
from tdint.errors import ModelError
from tdint.kernels.laws import OTHER_NAMES
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model, model_schema
from tdint.model.definition import ModalDamping, Model
from tdint.model.plausibility import plausibility_warnings, study_plausibility_warnings
from tdint.model.story_laws import LAWS
from tdint.units import STANDARD_GRAVITY

THREE = "stories: [{repeat: 3, mass: 2, stiffness: 5}]\n"
SHIPPED = sorted(Path(__file__).parents[2].joinpath("configs").glob("*.yaml"))


def load(text: str) -> Model:
    return load_model(io.StringIO(text))


def faults(source: object) -> list[str]:
    with pytest.raises(ModelError) as caught:
        load_model(source)  # type: ignore[arg-type]
    return [str(problem).removeprefix("<stream>:") for problem in caught.value.faults]


def test_weight_is_mass_times_standard_gravity() -> None:
    weights = load("units: {length: in, force: kip}\nstories: [{weight: 100, stiffness: 10}]")
    masses = load(
        "units: {length: in, force: kip, mass: kip*s^2/in}\n"
        f"stories: [{{mass: {100.0 / (STANDARD_GRAVITY / 0.0254)!r}, stiffness: 10}}]"
    )
    assert weights.stories[0].mass == pytest.approx(masses.stories[0].mass, rel=1e-14)
    assert load("stories: [{weight: 9.80665, stiffness: 1}]").stories[0].mass == pytest.approx(
        1.0, rel=1e-15
    )


@pytest.mark.parametrize("unit", ["kip", "lbf", "kN"])
def test_unit_of_force_for_mass_is_refused_with_remedy(unit: str) -> None:
    (fault,) = faults(io.StringIO(f"{THREE}units: {{mass: {unit}}}"))
    assert fault.startswith(f"2:15: units.mass: {unit} is a unit of force; give the `weight`")
    assert "mass = W/g, in kip*s^2/in" in fault


@pytest.mark.parametrize(("stories", "modes"), [(2, (1, 2)), (7, (1, 3))])
def test_damping_ratio_applies_to_first_and_third_mode(
    stories: int, modes: tuple[int, int]
) -> None:
    model = load(f"stories: [{{repeat: {stories}, mass: 2, stiffness: 5}}]\ndamping: 5%")
    building = assemble(model)
    ratios = building.modes().damping_ratios(building.damping_matrix())
    assert ratios is not None
    for mode in modes:
        assert ratios[mode - 1] == pytest.approx(0.05, rel=1e-12)
    assert 0.0 < ratios[modes[1] - 2] < 0.05 or stories == 2  # between the two it is less


def test_damping_of_one_story_is_half_mass_half_stiffness_proportional() -> None:
    building = assemble(load("stories: [{mass: 2, stiffness: 50}]\ndamping: 5%"))
    omega, critical = 5.0, 2.0 * math.sqrt(2.0 * 50.0)
    assert building.first_mode() == (pytest.approx(omega), pytest.approx(0.05))
    assert building.damping_matrix()[0, 0] == pytest.approx(0.05 * critical)
    chain = building.linear_terms
    from tdint.kernels import layout as rows

    assert (
        chain[rows.FLOOR_DAMPER, 0]
        == pytest.approx(chain[rows.STORY_DAMPER, 0])
        == pytest.approx(0.5 * 0.05 * critical)
    )


def test_ratios_may_be_percentages() -> None:
    text = (
        "stories: [{repeat: 2, mass: 1, stiffness: 1, law: {type: bilinear, yield_force: 1, "
        "hardening: 3%}}]\n"
        "damping: {modal: [2%, 0.03]}\ncollapse_drift: 8%"
    )
    model = load(text)
    assert model.stories[0].law.parameters[1] == 0.03
    assert model.damping == ModalDamping((0.02, 0.03))
    assert model.collapse_drift == 0.08


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_mapping_equals_model_file(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(path.parent)
    file, mapping = load_model(path.name), load_model(tree(path.read_text()))  # type: ignore[arg-type]
    assert path.read_text().startswith("# ")
    assert file.excitation.record or file.excitation.has_forces or any(file.initial.displacement)
    assert mapping.source == "model" and mapping.text != file.text
    # Compared as text, because the stiffness of a story of a matrix model is nan.
    assert repr(mapping.stories) == repr(file.stories)
    assert (mapping.damping, mapping.excitation) == (file.damping, file.excitation)
    assert (mapping.initial, mapping.analysis, mapping.p_delta) == (
        file.initial,
        file.analysis,
        file.p_delta,
    )


def test_numpy_numbers_and_sequences_are_accepted() -> None:
    """Sequences other than lists are accepted as well."""
    stories = tuple({"mass": np.float32(2.0), "stiffness": k} for k in np.array([3.0, 4.0]))
    model = load_model(
        {"stories": stories, "initial": {"velocity": np.ones(2)}, "p_delta": np.False_}
    )
    assert [story.stiffness for story in model.stories] == [3.0, 4.0]
    assert model.initial.velocity == (1.0, 1.0)
    assert (
        load_model({"stories": stories}).text
        != load_model({"stories": stories, "damping": 0.05}).text
    )


def test_errors_of_mapping_have_no_line() -> None:
    story: dict[str, object] = {"mass": "a", "stiffness": math.nan, "height": "3"}
    assert each_states(
        faults({"stories": [story], "p_delta": "true", "dampng": None}),
        [
            "model: dampng: unknown key; did you mean 'damping'?",
            "model: p_delta: ... true or false, got 'true' in quotes; remove the quotes",
            "model: stories[1].height: ... got '3' in quotes; remove the quotes",
            "model: stories[1].mass: ... got 'a'",
            "model: stories[1].stiffness: ... got 'nan'; ... finite",
            "model: dampng: ... 5%, {rayleigh: ...} or {modal: ...}, got nothing",
        ],
    )


def test_cyclic_and_unsupported_values_are_refused() -> None:
    loop: dict[str, object] = {}
    loop["stories"] = loop
    assert each_states(faults(loop), ["model: more than 32 nested levels"])
    assert each_states(faults({"stories": {1, 2}}), ["model: ... mappings, lists ... not set"])


@pytest.mark.parametrize(
    "units",
    [
        "in, force: kip", "m, force: kip", "ft", "m, force: kN", "m, force: MN", "mm, force: N",
        "mm, force: kN", "cm, force: kN",
    ],
)  # fmt: skip
def test_unit_of_mass_is_required_for_other_units_than_m_and_n(units: str) -> None:
    """A mass of 200 with forces in kN would be 200 kg, which gives a period of 0.01 s. The unit of
    a weight is the unit of force."""
    stories = "stories: [{mass: 0.25, stiffness: 1000}]"
    with pytest.raises(ModelError, match=r"stories\[1\]\.mass: .*add mass to `units`.*weight"):
        load(f"units: {{length: {units}}}\n{stories}")
    model = load(f"units: {{length: {units}, mass: kip*s^2/in}}\n{stories}")
    assert model.stories[0].mass == pytest.approx(0.25 * 4448.2216152605 / 0.0254)
    load(f"units: {{length: {units}}}\nstories: [{{weight: 200, stiffness: 1000}}]")


@pytest.mark.parametrize("report", ["{}", "no name", "': text'", "{a: [1]}", "{a: b, a: c}"])
def test_lines_of_a_report_have_names(report: str) -> None:
    (fault,) = faults(io.StringIO(f"{THREE}report: {report}"))
    assert ": report" in fault


UNUSUAL = {
    # 2 pi sqrt(200 / 4e7) = 0.014 s
    "fundamental period": "stories: [{mass: 200, height: 3, stiffness: 4.0e+7}]",
    # c / (2 sqrt(k m)) = 0.21
    "damping ratio": "stories: [{mass: 2e5, height: 3, stiffness: 4e7, dashpot: 1.2e+6}]",
    "story height": "stories: [{mass: 2e5, height: 3000, stiffness: 4e7}]",
    "ratio of the yield force": "stories: [{mass: 2e5, height: 3, stiffness: 4e7, law: "
    "{type: bilinear, yield_force: 9e+3, hardening: 0}}]",  # 0.46 % of the weight
    "collapse_drift": "stories: [{mass: 2e5, height: 3, stiffness: 4e7}]\ncollapse_drift: 0.5",
}


@pytest.mark.parametrize("warning", UNUSUAL)
def test_implausible_value_is_reported_with_usual_range(warning: str) -> None:
    model = load(UNUSUAL[warning])
    (line,) = plausibility_warnings(model, assemble(model))
    assert line.startswith(f"unusual {warning}") and "; usual values are " in line
    usual = load("stories: [{mass: 2e5, height: 3, stiffness: 4e7}]")
    assert plausibility_warnings(usual, assemble(usual), 9.0) == ()
    light = load("stories: [{mass: 200, height: 3, stiffness: 4e4}]")  # 0.44 s, as 200 t have it
    (line,) = plausibility_warnings(light, assemble(light))
    assert states(line, "unusual mass of a floor: 200 kg ... story 1; ")
    bare = load("stories: [{mass: 200, stiffness: 4e4}]")
    assert plausibility_warnings(bare, assemble(bare)) == ()
    # c = 2 zeta sqrt(k m): 0.02 % warns, 0.51 % does not; without any damping there is no warning.
    for ratio, count in ((0.0002, 1), (0.0051, 0), (0.0, 0)):
        dashpot = 2.0 * ratio * math.sqrt(2e5 * 4e7)
        slight = load(f"stories: [{{mass: 2e5, height: 3, stiffness: 4e7, dashpot: {dashpot!r}}}]")
        lines = plausibility_warnings(slight, assemble(slight))
        assert len(lines) == count
        assert all("of the first mode: 0.0002; usual values are 0.005 to 0.2" in x for x in lines)
    for pga in (0.9e-4 * 9.80665, 1.6 * 9.80665):
        (line,) = plausibility_warnings(usual, assemble(usual), pga)
        assert line.startswith("unusual peak ground acceleration") and "0.0001 g to 1.5 g" in line


def test_equal_warnings_of_several_models_are_merged() -> None:
    """If there are many warnings, only the first ones are printed, with the number of the
    others."""
    light = load("stories: [{mass: 200, height: 3, stiffness: 4e4}]\ndamping: 5%")
    usual = load("stories: [{mass: 2e5, height: 3, stiffness: 4e7}]\ndamping: 5%")
    models = [replace(light, source="a.yaml"), replace(light, source="b.yaml"), usual]
    (line,) = study_plausibility_warnings((model, assemble(model)) for model in models)
    assert states(line, "a.yaml and 1 more: ... 200 kg ... story 1; ")
    varied = [
        load(f"stories: [{{mass: {200 + n}, height: 3, stiffness: 4e4}}]\ndamping: 5%")
        for n in range(14)
    ]
    lines = study_plausibility_warnings((model, assemble(model)) for model in varied)
    assert len(lines) == 11 and lines[-1].startswith("4 more warnings on the buildings")


_LB = 0.45359237 * STANDARD_GRAVITY
"""Pound-force, N, by definition (1959)."""


@pytest.mark.parametrize(
    ("unit", "size"),
    [
        ("lbf*s^2/in", _LB / 0.0254), ("blob", _LB / 0.0254), ("slug", _LB / 0.3048),
        ("kN*s^2/m", 1e3), ("N*s^2/mm", 1e3), ("kgf*s^2/m", STANDARD_GRAVITY),
        ("tonf*s^2/m", 1e3 * STANDARD_GRAVITY),
    ],
)  # fmt: skip
def test_masses_may_be_in_products_of_force_and_length(unit: str, size: float) -> None:
    model = load(f"units: {{mass: {unit}}}\nstories: [{{mass: 2, stiffness: 1}}]")
    assert model.stories[0].mass == pytest.approx(2.0 * size, rel=1e-14)


@pytest.mark.parametrize(("unit", "factor"), [("kgf", 1.0), ("tf", 1e3), ("tonf", 1e3)])
def test_metric_gravitational_forces(unit: str, factor: float) -> None:
    """A weight in kgf has the same number as its mass in kg."""
    model = load(f"units: {{force: {unit}}}\nstories: [{{weight: 7, stiffness: 3}}]")
    assert model.stories[0].mass == pytest.approx(7.0 * factor, rel=1e-14)
    assert model.stories[0].stiffness == pytest.approx(3.0 * factor * STANDARD_GRAVITY, rel=1e-14)


@pytest.mark.parametrize(
    ("key", "text", "expected"),
    [
        ("mass", "lb-sec²/in", "lbf*s^2/in"), ("mass", "kips*s2/in", "kip*s^2/in"),
        ("mass", "lbf*s**2/ft", "slug"), ("mass", "N*s^2/m", "kg"), ("mass", "kN-s^2/mm", None),
        ("mass", "MN*s^2/m", None), ("mass", "Mg", "t"), ("mass", "mg", None),
        ("mass", "ton", None), ("force", "KN", "kN"), ("force", "mN", None),
        ("force", "kp", "kgf"), ("force", "lbs", "lbf"), ("force", "kNm", None),
        ("length", "inches", "in"), ("length", "km", None),
    ],
)  # fmt: skip
def test_suggested_unit_has_the_size_of_the_unknown_unit(
    key: str, text: str, expected: str | None
) -> None:
    (fault,) = faults(io.StringIO(f"{THREE}units: {{{key}: '{text}'}}"))
    assert f"unknown {key} unit '{text}'" in fault
    assert fault.endswith(f"; did you mean '{expected}'?") or (
        expected is None and "did you mean" not in fault and "; known: " in fault
    )


@pytest.mark.parametrize("inclination", [{"angle": 60.0}, {"factor": 0.5}])
def test_inclined_element_has_the_square_of_the_cosine(inclination):
    """The drift along the element and its force are both multiplied by cos 60 degrees = 0.5."""
    elements = [{"type": "linear", "stiffness": 400.0, **inclination}]
    elements.append({"type": "linear", "stiffness": 10.0})
    building = assemble(load_model({"stories": [{"mass": 1.0, "elements": elements}]}))
    assert building.modes().omega[0] == pytest.approx(110.0**0.5, rel=1e-12)


ELEMENTS = "stories: [{mass: 2, height: 3, elements: [%s, {type: linear, stiffness: 1}]}]\n"


@pytest.mark.parametrize(
    ("usual", "other"),
    [
        (
            "{type: bilinear, yield_force: 3, hardening: 0.1, stiffness: 5}",
            "{stiffness: 5, law: {type: bilinear, yield_force: 3, hardening: 0.1}}",
        ),
        ("{type: linear, stiffness: 5, name: a}", "{law: linear, stiffness: 5, name: a}"),
        (
            "{type: linear, stiffness: 5, fracture_drift: 1%}",
            "{law: {type: linear, fracture_drift: 1%}, stiffness: 5}",
        ),
    ],
)
def test_an_element_may_have_the_form_of_a_story(usual: str, other: str) -> None:
    assert load(ELEMENTS % usual).stories == load(ELEMENTS % other).stories
    assert valid(tree(ELEMENTS % other), model_schema())


def test_a_mapping_is_a_list_of_one_force() -> None:
    force = "{floor: 1, amplitude: 2, omega: 3}"
    many, one = (load(f"{THREE}excitation: {{forces: {text}}}") for text in (f"[{force}]", force))
    assert many.excitation == one.excitation


@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("elastoplastic", "bilinear with hardening 0"),
        ("Elastic-Perfectly-Plastic", "bilinear with hardening 0"),
        ("takeda", "peak-oriented with unloading"),
        ("origin-oriented", "multilinear with rule: origin"),
        ("friction_pendulum", "bilinear with hardening"),
        ("Kent-Park", "multilinear with rule: peak"),
    ],
)
def test_other_names_of_laws_are_translated(name: str, law: str) -> None:
    (fault,) = faults(io.StringIO(f"stories: [{{mass: 2, stiffness: 5, law: {{type: {name}}}}}]"))
    assert f"unknown law '{name}'; write {law}" in fault


def test_other_names_lead_to_laws_of_tdint() -> None:
    """No law has one of the other names, and each answer begins with a law, or with a dashpot."""
    laws = {name.replace("-", "") for name in LAWS}
    assert not laws & OTHER_NAMES.keys()
    for answer in OTHER_NAMES.values():
        assert re.split(r"[ ,]", answer)[0] in {*LAWS, "a"}, answer
        if rule := re.search(r"rule: ([a-z]+)", answer):
            assert rule[1] in ("kinematic", "isotropic", "origin", "peak", "elastic", "flag")
