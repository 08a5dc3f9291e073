"""Buildings from an inventory: comparison of the rules with hand calculations, and errors of
rows."""

import io
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from facts import each_states, states
from tdint import load_model
from tdint.errors import ModelError, UsageError
from tdint.model.building import assemble
from tdint.model.definition import RayleighCoefficients, RayleighRatio
from tdint.model.mdof_lu import (
    LEVELS,
    STRUCTURES,
    BuildingFacts,
    derive,
    design_level,
    hazus_type,
    hazus_types,
)
from tdint.studies.regions.inventory import derive_all, model_text, read_inventory
from tdint.units import LENGTH

HEADER = "id,NumberOfStories,YearBuilt,StructureType,PlanArea"


def test_one_story_building_agrees_with_hand_calculation():
    """PC1, high code: a period of 0.35 s per story, yielding at 0.6 g and twice this strength at
    the end; 3000 m^2 have a mass of 3000 t."""
    row = hazus_types()["high", "PC1"]
    derived = derive(BuildingFacts("PC1", 1, 1978, 3000.0))
    stiffness = 4.0 * math.pi**2 * (0.4053 + 0.405 + 0.1869) * 3e6 / row.period_per_story_s**2
    strength = row.yield_acceleration_g * 3e6 * 9.8
    drift = strength / stiffness * (1.0 + (row.overstrength - 1.0) / row.post_yield_ratio)
    assert (derived.design_level, derived.type, derived.height.tolist()) == ("high", "PC1", [3.6])
    assert derived.stiffness[0] == pytest.approx(stiffness, rel=1e-14)
    assert derived.yield_force[0] == pytest.approx(strength, rel=1e-14)
    assert derived.ultimate_force[0] == pytest.approx(row.overstrength * strength, rel=1e-14)
    assert derived.ultimate_drift[0] == pytest.approx(drift, rel=1e-14)
    assert derived.yield_drift[0] == pytest.approx(strength / stiffness, rel=1e-14)
    assert derived.period == pytest.approx(2.0 * math.pi * math.sqrt(3e6 / stiffness), rel=1e-13)


@pytest.mark.parametrize("stories", [1, 2, 5, 12, 50])
def test_building_has_period_of_its_type(stories):
    """lambda(n) is fitted to the first period of a chain of n equal masses and springs."""
    derived = derive(BuildingFacts("S1", stories, 1990, 800.0))
    assert derived.period == pytest.approx(derived.rule_period, rel=2e-3)
    shares = derived.yield_force / derived.yield_force[0]
    load = np.arange(1, stories + 1)
    assert shares == pytest.approx(np.cumsum(load[::-1])[::-1] / load.sum(), rel=1e-12)


@pytest.mark.parametrize("stories", [2, 3, 5, 12, 50])
def test_strength_follows_from_mass_of_first_mode(stories):
    """alpha1(n) is fitted to the mass of the first mode of a chain of n equal masses and springs,
    over the total mass; its limit for large n is 8 / pi^2."""
    derived = derive(BuildingFacts("S1", stories, 1990, 800.0))
    row = hazus_types()[derived.design_level, derived.type]
    chain = 2.0 * np.eye(stories) - np.eye(stories, k=1) - np.eye(stories, k=-1)
    chain[-1, -1] = 1.0
    share = np.sum(np.linalg.eigh(chain)[1][:, 0]) ** 2 / stories
    assert derived.yield_force[0] / (
        row.yield_acceleration_g * 9.8 * np.sum(derived.mass)
    ) == pytest.approx(share, rel=2e-3)


@pytest.mark.parametrize(
    ("structure", "year", "zone", "level"),
    [
        ("C1", 1976, "Z4", "high"), ("C1", 1975, "Z4", "moderate"), ("C1", 1941, "Z4", "moderate"),
        ("C1", 1940, "Z4", "pre"), ("W1", 1940, "Z4", "moderate"), ("W1", 1990, "Z4", "high"),
        ("C1", 1990, "Z3", "moderate"), ("C1", 1940, "Z3", "pre"), ("W1", 1900, "Z3", "moderate"),
        ("C1", 1976, "Z2B", "moderate"), ("C1", 1941, "Z2B", "low"), ("W1", 1900, "Z2B", "low"),
        ("C1", 1941, "Z2A", "low"), ("C1", 1940, "Z2A", "pre"), ("C1", 1976, "Z1", "low"),
        ("C1", 1975, "Z1", "pre"), ("W1", 2000, "Z0", "low"), ("C1", 2000, "Z0", "pre"),
    ],
)  # fmt: skip
def test_design_level_by_type_year_and_zone(structure, year, zone, level):
    assert design_level(structure, year, zone) == level


def test_every_building_type_has_hazus_parameters():
    for structure in STRUCTURES:
        for stories in (1, 2, 3, 4, 7, 8, 50):
            building_type = hazus_type(structure, stories)
            for level in LEVELS:
                row = hazus_types()[level, building_type]
                assert row.min_stories <= stories <= row.max_stories
                # The law does not return more energy than it received.
                slope = (row.overstrength - 1.0) / row.post_yield_ratio
                assert row.overstrength <= (1.0 + slope) ** (1.0 - row.unloading_exponent)
    assert len(hazus_types()) == 144
    assert {hazus_type("URM", n) for n in (2, 3)} == {"URML", "URMM"}


def test_damping_ratio_applies_to_first_and_third_mode():
    assert derive(BuildingFacts("C1", 8, 1990, 100.0)).damping == RayleighRatio(
        (0.07, 0.07), (1, 3)
    )
    assert derive(BuildingFacts("C1", 2, 1990, 100.0)).damping == RayleighRatio(
        (0.07, 0.07), (1, 2)
    )
    single = derive(BuildingFacts("C1", 1, 1990, 100.0, damping_ratio=0.05))
    omega = 2.0 * math.pi / single.period
    assert isinstance(single.damping, RayleighCoefficients)
    assert (single.damping.mass, single.damping.stiffness) == pytest.approx(
        (0.05 * omega, 0.05 / omega), rel=1e-12
    )
    lost = derive(BuildingFacts("C1", 8, 1990, 100.0, mass_only=True)).damping
    assert isinstance(lost, RayleighCoefficients)
    assert lost.stiffness == 0.0
    derived = derive(BuildingFacts("C1", 8, 1990, 100.0))
    springs = np.diag(derived.stiffness) + np.diag([*derived.stiffness[1:], 0.0])
    springs -= np.diag(derived.stiffness[1:], 1) + np.diag(derived.stiffness[1:], -1)
    first, _, third, *_ = np.sqrt(np.sort(np.linalg.eigvals(springs / derived.mass[:, None])))
    assert lost.mass == pytest.approx(2.0 * 0.07 * first * third / (first + third), rel=1e-9)


def test_model_with_building_equals_written_out_model():
    short = "building: {rules: mdof-lu, type: C1, stories: 4, year: 1985, area: 600, height: 16}\n"
    derived = derive(BuildingFacts("C1", 4, 1985, 600.0, height=16.0))
    models = [
        load_model(io.StringIO(text))
        for text in (short, model_text("a 'b' \"c\"", derived, "mdof-lu"))
    ]
    assert models[1].name == "a 'b' \"c\""
    assert models[0].stories == models[1].stories
    assert models[0].damping == models[1].damping
    periods = [2.0 * math.pi / assemble(model).modes().omega[0] for model in models]
    assert periods == pytest.approx([derived.period] * 2, rel=1e-13)
    other = load_model(io.StringIO(short + "damping: {modal: 0.02}\nunits: {length: ft}"))
    assert other.damping.ratios == (0.02,)
    assert other.stories[0].mass == pytest.approx(derived.mass[0] * LENGTH["ft"] ** 2, rel=1e-14)
    assert other.stories[0].height == pytest.approx(4.0 * LENGTH["ft"], rel=1e-14)


@pytest.mark.parametrize(
    ("key", "fact"),
    [
        ("zone: Z1", {"zone": "Z1"}),
        ("design_level: pre", {"design_level": "pre"}),
        ("damping: mass-only", {"mass_only": True}),
    ],
)
def test_keys_of_a_building(key, fact):
    text = f"building: {{rules: mdof-lu, type: C1, stories: 4, year: 1985, area: 600, {key}}}\n"
    facts = BuildingFacts("C1", 4, 1985, 600.0)
    derived, plain = derive(replace(facts, **fact)), derive(facts)
    found = load_model(io.StringIO(text))
    assert found.stories == derived.stories
    assert found.damping == derived.damping
    assert (found.stories, found.damping) != (plain.stories, plain.damping)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("building: {}", "building.type: is missing; give one of W1, W2, "),
        ("building: 3", "building: must be a mapping ... rules, capacity, type, "),
        (
            "building: {rules: mine, type: C1, stories: 5}",
            "building.rules: unknown set of rules 'mine'",
        ),
        (
            "building: {type: C1, stories: 51, year: 1985, area: 1}",
            "building.stories: must be a whole number",
        ),
        (
            "stories: [{mass: 1, stiffness: 1}]\nbuilding: {rules: mdof-lu, type: C1, stories: 1, "
            "year: 1985, area: 1}",
            "building: cannot be used with `stories`",
        ),
    ],
)
def test_errors_of_building(text, message):
    with pytest.raises(ModelError) as caught:
        load_model(io.StringIO(text))
    assert states(str(caught.value), message)


def inventory(tmp_path, *rows, header=HEADER, **more):
    file = tmp_path / "b.csv"
    file.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return read_inventory(str(file), 1.0, **more)


def test_rows_of_inventory(tmp_path):
    header = f"{HEADER},Latitude,seismiczone,height,DampingRatio,DesignLevel"
    rows, faults = inventory(
        tmp_path, "a,3,1990,c1,600,37.8,z2a,12,0.03,", "", "b,1,1950,W1,90,,,,,HC", header=header
    )
    assert not faults
    assert [row.id for row in rows] == ["a", "b"]
    assert rows[0].facts == BuildingFacts("C1", 3, 1990, 600.0, 12.0, "Z2A", None, 0.03)
    assert rows[1].facts == BuildingFacts("W1", 1, 1950, 90.0, design_level="high")
    feet, _ = read_inventory(str(tmp_path / "b.csv"), LENGTH["ft"])
    assert feet[0].facts.area == pytest.approx(600.0 * 0.3048**2, rel=1e-14)
    assert feet[0].facts.height == pytest.approx(12.0 * 0.3048, rel=1e-14)


def test_digest_depends_on_names_and_borders_of_columns(tmp_path):
    """Equal cells in another column, or divided at another place, are another inventory."""
    digests = set()
    for optional, cells in (
        ("height,DampingRatio", ("12,0.3", "12,0.3")),
        ("DampingRatio,height", ("0.3,12", "0.3,12")),
        ("height,note", ("0.3,12", "0.3,12")),
        ("DampingRatio,note", ("0.3,12", "0.3,12")),
        ("note,remark", ("a,b", "b,c")),
        ("note,remark", ("a,bb", "b,c")),
    ):
        lines = [f"{name},3,1990,C1,600,{text}" for name, text in zip("ab", cells, strict=True)]
        rows, _ = inventory(tmp_path, *lines, header=f"{HEADER},{optional}")
        digests.add((optional, rows.digest(carried=False), rows.digest(carried=True)))
    defining = {optional: digest for optional, digest, _ in digests}
    assert defining["height,DampingRatio"] == defining["DampingRatio,height"]
    assert defining["height,note"] != defining["DampingRatio,note"]
    assert len({digest for *_, digest in digests}) == 6


CELLS = {
    "id": st.sampled_from(["a", "b", "c", "d", " e ", ""]),
    "NumberOfStories": st.sampled_from(["1", "3", "2.5", "51", "3.0", "", "x"]),
    "YearBuilt": st.sampled_from(["1990", "1985", "19 90", "900", ""]),
    "StructureType": st.sampled_from(["C1", "w1", "S9"]),
    "PlanArea": st.sampled_from(["600", "6e2", "0", "-1", "1_0", "nan", ""]),
    "height": st.sampled_from(["", "12", "0", "x"]),
    "Latitude": st.sampled_from(["", "38", "91", "-90"]),
}


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cells=st.lists(st.tuples(*CELLS.values()), min_size=1, max_size=9))
@pytest.mark.long
def test_rows_are_read_independently(tmp_path: Path, cells: list[tuple[str, ...]]) -> None:
    """Valid rows and errors do not depend on the number of rows. If an id is repeated, the first
    valid row counts."""
    header, lines = ",".join(CELLS), [",".join(row) for row in cells]
    together, faults = inventory(tmp_path, *lines, header=header)
    rows, messages = {}, []
    for number, line in enumerate(lines, start=2):
        alone, wrong = inventory(tmp_path, line, header=header)
        messages += [(number, fault.column, fault.message) for fault in wrong]
        for row in alone:
            twice = f"{row.id!r} is already on line {rows[row.id][1]}" if row.id in rows else ""
            messages += [(number, 1, f"{twice}; use a different id for each building")] * bool(
                twice
            )
            rows.setdefault(row.id, (row, number))
    assert list(together) == [row for row, _ in rows.values()]
    assert [(fault.line, fault.column, fault.message) for fault in faults] == sorted(
        messages, key=lambda entry: entry[:2]
    )


def test_all_invalid_rows_are_reported(tmp_path):
    rows, faults = inventory(
        tmp_path,
        "a,3,1990,C1,600",
        "b,2.5,1990,C1,0",
        ",1,1990,S9,5",
        "a,1,1990,C1,5",
        "c,1,,C1",
        "d,1,1990,C1,5,6",
    )
    assert [row.id for row in rows] == ["a"]
    messages = [str(fault).partition("b.csv:")[2] for fault in faults]
    expected = [
        "3:2: NumberOfStories: ... 1 to 50, got '2.5'",
        "3:5: PlanArea: ... got '0'",
        "4:1: id: is missing",
        f"4:4: StructureType: unknown 'S9'; ... {', '.join(STRUCTURES)}",
        "5:1: id: 'a' ... line 2",
        "6:3: YearBuilt: is missing; ... 1000 to 2200",
        "6:5: PlanArea: is missing",
        "7:6: ... 6 cells, ... 5 columns",
    ]
    assert each_states(messages, expected)


def test_file_without_required_column_is_refused(tmp_path):
    with pytest.raises(ModelError, match="no column NumberOfStories among 5 columns; rename"):
        inventory(tmp_path, header="id,NumberOfStorys,YearBuilt,StructureType,PlanArea")


def test_scatter_is_sampled_by_building_id(tmp_path):
    rows, _ = inventory(tmp_path, *(f"b{i},3,1990,C1,600" for i in range(400)))
    plain = derive_all(rows[:1], "mdof-lu")[0].building
    many = [
        derived.building
        for derived in derive_all(rows, "mdof-lu", stiffness=0.2, damping=0.1, seed=5)
    ]
    factors = np.array([sample.stiffness[0] / plain.stiffness[0] for sample in many])
    assert np.mean(factors) == pytest.approx(1.0, abs=4.0 * 0.2 / 20.0)
    assert np.std(factors) == pytest.approx(0.2, rel=0.15)
    assert np.std([sample.damping_ratio / 0.07 for sample in many]) == pytest.approx(0.1, rel=0.15)
    assert {sample.yield_force[0] for sample in many} == {plain.yield_force[0]}
    # Studies that are continued, divided or repeated with another version need the same samples:
    # two normal numbers for each seed and id.
    first, second = np.random.default_rng([5, *b"b7"]).standard_normal(2)
    assert factors[7] == pytest.approx(1.0 + 0.2 * first, rel=1e-12)
    assert many[7].damping_ratio == pytest.approx(0.07 * (1.0 + 0.1 * second), rel=1e-12)
    alone = derive_all(rows[7:8], "mdof-lu", stiffness=0.2, damping=0.1, seed=5)[0].building
    assert alone.stiffness[0] == many[7].stiffness[0]
    unsaid, zero = (
        derive_all(rows[:1], "mdof-lu", stiffness=0.2, **seed) for seed in ({}, {"seed": 0})
    )
    assert unsaid[0].building.stiffness[0] == zero[0].building.stiffness[0]
    with pytest.raises(UsageError, match="scatter of the stiffness"):
        derive_all(rows, "mdof-lu", stiffness=0.6)


@pytest.mark.parametrize(
    ("column", "sound", "wrong", "message"),
    [
        ("NumberOfStories", (1, 50), (0, 51), "1 to 50"),
        ("YearBuilt", (1000, 2200), (999, 2201), "1000 to 2200"),
        ("PlanArea", (1e-3, 1e9), (0, -1), "positive"),
        ("height", (1e-3, 1e3), (0, -3), "positive"),
        ("DampingRatio", (0, 0.99), (-0.01, 1), "at least 0 and below 1"),
        ("Latitude", (-90, 90), (-90.01, 90.01), "at least -90 ... at most 90"),
        ("Longitude", (-360, 360), (-360.01, 360.01), "at least -360 ... at most 360"),
    ],
)
def test_bounds_of_numbers_in_rows(tmp_path, column, sound, wrong, message):
    cells = dict(zip(HEADER.split(","), ("a", "3", "1990", "W1", "90"), strict=True))

    def read(value):
        row = cells | {column: str(value)}
        return inventory(tmp_path, ",".join(row.values()), header=",".join(row))

    for value in sound:
        rows, faults = read(value)
        assert len(rows) == 1 and not faults
    for value in (*wrong, "nan", "inf", "x"):
        rows, (fault,) = read(value)
        assert not rows
        assert states(str(fault), f"{column}: ... {message} ... got '{value}'")
