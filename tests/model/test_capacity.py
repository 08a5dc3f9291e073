"""Buildings from capacity curves: comparison with restated rules, periods and files."""

import math

import numpy as np
import pytest
from scipy.linalg import eigh

from tdint import load_model
from tdint.errors import ModelError, UsageError
from tdint.model.building import assemble
from tdint.model.capacity import CapacityCurve, CapacityFacts, derive_capacity, read_classes
from tdint.studies.regions.inventory import derive_all, model_text, read_inventory

DEMO = CapacityCurve(
    (0.00060789, 0.00486316, 0.0242, 0.04353684), (0.103152, 0.20630401, 0.12378241, 0.12502023)
)
THREE = CapacityCurve((0.01, 0.03, 0.12), (0.2, 0.3, 0.25))
TWO = CapacityCurve((0.02, 0.08), (0.15, 0.2))


def restated(curve, n, soft):
    """Return drifts and forces of the stories for a mass of 1 t, by matrices."""
    m = np.ones(n)
    m[-1] = 0.75 if n > 1 else 1.0
    m /= m.sum()
    k = np.array([max(1.0 - 0.3 * (2.0 * (i // 2) + 0.5) / max(n - 1, 1), 0.5) for i in range(n)])
    k[0] *= 0.35 if soft else 1.0
    stiffness = np.diag(k) + np.diag(np.append(k[1:], 0.0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    phi = eigh(stiffness, np.diag(m))[1][:, 0]
    phi /= phi[-1]
    gamma, effective = m @ phi / (m @ phi**2), (m @ phi) ** 2 / (m @ phi**2)
    drifts = gamma * np.outer(np.diff(phi, prepend=0.0), curve.displacement)
    shear = np.array([(m * phi)[i:].sum() for i in range(n)]) / (m @ phi)
    return drifts, effective * 9.81 * np.outer(shear, curve.acceleration)


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8, 12])
@pytest.mark.parametrize("soft", [False, True])
def test_derived_buildings_agree_with_restated_rules(n, soft):
    derived = derive_capacity(CapacityFacts(DEMO, n, soft_story=soft))
    drifts, forces = restated(DEMO, n, soft)
    assert derived.drifts == pytest.approx(drifts, rel=1e-12)
    assert derived.forces == pytest.approx(1000.0 * forces, rel=1e-12)
    assert derived.period == pytest.approx(DEMO.period, rel=1e-13)


def test_published_example_is_reproduced():
    derived = derive_capacity(CapacityFacts(DEMO, 3, as_published=True))
    assert derived.mass == pytest.approx([363.636, 363.636, 272.727], abs=1e-3)
    assert derived.mode == pytest.approx([0.424623, 0.755846, 1.0], abs=1e-6)
    assert derived.participation == pytest.approx(1.28560, abs=1e-5)
    assert derived.drifts[:, 0] == pytest.approx([0.000332, 0.000259, 0.000191], abs=1e-6)
    assert derived.forces[:, 0] / 9810.0 == pytest.approx([0.111129, 0.086685, 0.043174], abs=1e-6)


@pytest.mark.parametrize(
    ("n", "ordinary", "soft"),
    [
        (1, 1.0, 1.0), (2, 0.907, 0.821), (3, 0.915, 0.747), (5, 0.918, 0.674), (8, 0.921, 0.628),
        (12, 0.924, 0.601),
    ],
)  # fmt: skip
def test_published_factor_shortens_period(n, ordinary, soft):
    for is_soft, ratio in ((False, ordinary), (True, soft)):
        derived = derive_capacity(CapacityFacts(DEMO, n, soft_story=is_soft, as_published=True))
        # published with three digits
        assert derived.period / DEMO.period == pytest.approx(ratio, abs=6e-4)


def test_capacity_curves_of_two_and_three_points():
    derived = derive_capacity(CapacityFacts(TWO, 1))
    assert derived.drifts[0] == pytest.approx([0.02, 0.04, 0.06, 0.08])
    assert derived.forces[0] / 9810.0 == pytest.approx([0.15, 0.15 + 0.05 / 3, 0.15 + 0.1 / 3, 0.2])
    derived = derive_capacity(CapacityFacts(THREE, 1))
    assert derived.drifts[0] == pytest.approx([0.01, 0.03, 0.075, 0.12])
    assert (TWO.damage_begins, THREE.damage_begins) == (0.02, 0.03)


@pytest.mark.parametrize(
    ("points", "text"),
    [
        ([(0.01, 0.1)], "two to four points, got 1"),
        ([(0.01 * i, 0.1) for i in range(1, 6)], "two to four points, got 5"),
        ([(0.01, 0.1), (0.01, 0.2)], "increase from point to point"),
        ([(0.01, 0.1), (0.02, -0.2)], "must be positive"),
        ([(0.01, 0.1), (math.inf, 0.2)], "must be positive"),
    ],
)
def test_invalid_curve_points_are_refused(points, text):
    with pytest.raises(UsageError, match=text):
        CapacityCurve.of(points)


MODEL = "building: {capacity: curve.csv, stories: 3, height: 9, mass: 300, %s}\nunits: {mass: t}\n"


@pytest.fixture
def curve(tmp_path):
    (tmp_path / "curve.csv").write_text(
        "sd_m,sa_g\n" + "".join(f"{d},{a}\n" for d, a in zip(*_points(), strict=True))
    )
    return tmp_path


def _points():
    return DEMO.displacement, DEMO.acceleration


def test_model_with_capacity_curve(curve):
    (curve / "model.yaml").write_text(MODEL % "degradation: true, soft_story: true")
    model = load_model(curve / "model.yaml")
    facts = CapacityFacts(DEMO, 3, 9.0, 3e5, soft_story=True, degradation=True)
    assert model.stories == derive_capacity(facts).stories
    # The laws follow Martins and Silva: pinching on both sides, and cyclic degradation of strength
    # and stiffness.
    pinching, losses = (
        [0.5, 0.25, 0.05] * 2,
        [0.0, 0.1, 0.0, 0.0, 0.2, 0.0, 0.1, 0.0, 0.0, 0.2, 0.0, 0.4, 0.0, 0.4, 0.9],
    )
    for story, drifts in zip(model.stories, derive_capacity(facts).drifts, strict=True):
        assert story.law.parameters[16:] == (*pinching, drifts[-1], *losses, 10.0)
    intact = derive_capacity(CapacityFacts(DEMO, 1)).stories[0].law.parameters
    assert intact[23:] == (*(0.0, 0.0, 1.0, 1.0, 0.0) * 3, math.inf)
    assert assemble(model).modes().omega[0] == pytest.approx(2.0 * math.pi / DEMO.period, rel=1e-13)


@pytest.mark.parametrize("key", ["degradation", "soft_story", "as_published"])
def test_each_key_of_a_building_with_capacity_curve(curve, key):
    (curve / "model.yaml").write_text(MODEL % f"{key}: true")
    facts = CapacityFacts(DEMO, 3, 9.0, 3e5, **{key: True})
    assert load_model(curve / "model.yaml").stories == derive_capacity(facts).stories
    (curve / "model.yaml").write_text(MODEL % f"{key}: false")
    assert load_model(curve / "model.yaml").stories != derive_capacity(facts).stories


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ("type: C1", "building.type: cannot be used with a `capacity` curve"),
        ("rules: mdof-lu", "building.rules: cannot be used"),
        ("damping_ratio: 2", "building.damping_ratio"),
    ],
)
def test_errors_of_building_with_capacity_curve(curve, more, text):
    (curve / "model.yaml").write_text(MODEL % more)
    with pytest.raises(ModelError, match=text):
        load_model(curve / "model.yaml")


def test_invalid_curve_file_is_refused(curve):
    (curve / "curve.csv").write_text("sd_m,sa_g\n1,1\n")
    (curve / "model.yaml").write_text(MODEL % "soft_story: false")
    with pytest.raises(ModelError, match=r"building\.capacity: .*two to four points, got 1"):
        load_model(curve / "model.yaml")
    (curve / "other.yaml").write_text(
        "building: {rules: mdof-lu, type: C1, stories: 2, year: 1990, area: 9, mass: 1}\n"
    )
    with pytest.raises(ModelError, match=r"building\.mass: requires a `capacity` curve"):
        load_model(curve / "other.yaml")


CLASSES = """\
class,sd_m,sa_g,soft_story,degradation
MUR,0.002,0.1,false,true
MUR,0.01,0.15,,
CR/soft,0.01,0.2,true,
CR/soft,0.03,0.3,,
CR/soft,0.12,0.25,,
"""
BUILDINGS = "id,class,NumberOfStories,height,mass_kg,Latitude,Longitude\na,MUR,2,,,1,2\nb,CR/soft,5,16,8e5,1,2\n"  # noqa: E501


@pytest.fixture
def inventory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "classes.csv").write_text(CLASSES)
    (tmp_path / "buildings.csv").write_text(BUILDINGS)
    return tmp_path


def test_inventory_of_capacity_classes(inventory):
    rows, faults = read_inventory("buildings.csv", 1.0, classes=read_classes("classes.csv"))
    assert not faults
    first, second = derive_all(rows, "capacity")
    assert first.building.degradation and not second.building.degradation
    alone = CapacityFacts(THREE, 5, 16.0, 8e5, soft_story=True, name="CR/soft")
    assert second.row.facts == alone
    for derived in (first, second):
        (inventory / "m.yaml").write_text(model_text(derived.row.id, derived.building, "capacity"))
        assert load_model("m.yaml").stories == derived.building.stories
    with pytest.raises(UsageError, match="do not use the scatter"):
        derive_all(rows, "capacity", stiffness=0.1)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (("a,MUR", "a,XX"), "class: unknown 'XX'; known: MUR, CR/soft"),
        (("a,MUR,2", "a,MUR,99"), "NumberOfStories: must be a whole number from 1 to 50"),
        (("8e5", "-1"), "mass_kg"),
    ],
)
def test_errors_of_rows_with_classes(inventory, change, text):
    (inventory / "buildings.csv").write_text(BUILDINGS.replace(*change))
    rows, faults = read_inventory("buildings.csv", 1.0, classes=read_classes("classes.csv"))
    assert len(rows) == 1
    assert text in str(faults[0])


def test_invalid_class_is_refused(inventory):
    (inventory / "classes.csv").write_text(CLASSES + "lost,0.1,0.1\n")
    with pytest.raises(ModelError, match=r"classes.csv: class lost: .*got 1"):
        read_classes("classes.csv")
