"""No constant of a kernel has a unit of length or force: if all lengths and forces are multiplied
by a power of two, and masses, stiffnesses and times remain, all results are multiplied by it, bit
by bit; also the forces of laws alone. Powers of a dashpot force are rounded."""

from dataclasses import replace

import numpy as np
import pytest

import tdint
from law_examples import example
from law_paths import FY, K, follow, law_table, random_path
from tdint.ground_motion.record import Record
from tdint.kernels import layout as rows
from tdint.model.definition import simple_model
from tdint.model.story import PowerDashpot, Relief, simple_story
from tdint.model.story_laws import LAWS, Law
from tdint.response.spectra.inelastic import constant_ductility

FACTORS = (2.0**20, 2.0**-20)


def record(factor, component="HNE"):
    samples = factor * np.random.default_rng(ord(component[-1])).normal(size=150) * 8.0
    return Record(samples, 0.01, "", f"N.S..{component}", component, "a")


def falling(_, stiffness, strength):
    """Return a law with a backbone curve that rises, and falls."""
    drift, rest = strength / stiffness, (np.inf,) * 74
    side = (drift, strength, 3.0 * drift, 1.4 * strength, 4.0 * drift, 1.3 * strength, *rest)
    return Law("multilinear", (0.0, -0.01 * stiffness, *side, *side))


@pytest.mark.parametrize("lengths", [True, False])
@pytest.mark.parametrize("name", [*LAWS, "falling"])
def test_forces_and_energies_of_laws(name, lengths):
    """With equal stiffnesses, lengths change with the forces; with equal lengths, stiffnesses."""

    def results(factor):
        stiffer, longer = (1.0, factor) if lengths else (factor, 1.0)
        law = (falling if name == "falling" else example)(name, stiffer * K, factor * FY)
        table = law_table(law.name, *law.parameters)
        table[rows.STIFFNESS, 0] *= stiffer
        forces, strain, hysteretic = follow(table, longer * random_path(3))
        return np.array([*forces, strain / longer, hysteretic / longer]) / factor

    expected = results(1.0)
    for factor in FACTORS:
        assert np.array_equal(results(factor), expected)


DAMPERS = {
    "linear": lambda _: {"dashpot": 2e3},
    "power": lambda s: {"power_dashpot": PowerDashpot(3e3 * s**0.5, 0.5, 1e-3 * s)},
    "brace": lambda s: {"power_dashpot": PowerDashpot(3e3 * s**0.5, 0.5, 0.0, brace=4e6)},
    "relief": lambda s: {
        "power_dashpot": PowerDashpot(5e3, 1.0, 0.0, brace=4e6, relief=Relief(800.0 * s, 0.05))
    },
}
CASES = [
    *((name, "linear", "impulse4") for name in LAWS),
    *((name, "linear", "moment4") for name in LAWS),
    *(("bilinear", damper, method) for damper in DAMPERS for method in ("impulse4", "moment4")),
    *(("bilinear", "brace", method) for method in ("newmark-average", "gauss4")),
]
QUANTITIES = (
    *("peak_drift", "peak_displacement", "peak_velocity", "peak_absolute_acceleration"),
    *("peak_shear", "peak_total_shear", "peak_damper_force", "residual_drift"),
)


@pytest.mark.parametrize(("law", "damper", "method"), CASES)
def test_peaks_of_runs(law, damper, method):
    def results(factor):
        stories = []
        for share in (1.0, 0.8, 0.6):
            of_story = example(law, 1e6 * share, 2e4 * share * factor)
            story = simple_story(1e3, of_story, stiffness=1e6 * share)
            stories.append(replace(story, **DAMPERS[damper](factor)))
        response = tdint.run(
            simple_model("one", stories), record(factor), method=method, check=False
        )
        return [np.array(getattr(response.stories, name)) / factor for name in QUANTITIES]

    expected = results(1.0)
    assert np.max(expected[0]) > 0.02  # yielding
    for factor in FACTORS:
        for found, one in zip(results(factor), expected, strict=True):
            np.testing.assert_allclose(
                found, one, rtol=0.0 if damper in ("linear", "relief") else 1e-10
            )


@pytest.mark.parametrize("method", ["impulse4", "moment4"])
def test_peaks_with_attachments_and_a_load(method):
    """A tree of stories, whose peaks are searched in another way, with a force on a floor."""

    def results(factor):
        story = {"mass": 1e3, "stiffness": 1e6, "dashpot": 2e3}
        law = {"type": "bilinear", "yield_force": 2e4 * factor, "hardening": 0.1}
        model = tdint.load_model(
            {
                "stories": [{**story, "law": law}, story, {**story, "stiffness": 5e5}],
                "attachments": [
                    {"name": name, "floor": floor, "mass": 50.0, "stiffness": stiffness}
                    for name, floor, stiffness in (("a", 3, 9e3), ("b", 2, 4e4))
                ],
                "excitation": {
                    "forces": [{"floor": 3, "amplitude": 900.0 * factor, "omega": 20.0}]
                },
            }
        )
        response = tdint.run(model, record(factor), method=method, check=False)
        tables = response.stories, response.devices.stories
        return [np.array(getattr(one, name)) / factor for one in tables for name in QUANTITIES]

    expected = results(1.0)
    for factor in FACTORS:
        for found, one in zip(results(factor), expected, strict=True):
            assert np.array_equal(found, one, equal_nan=True)


PERIODS = np.array([0.02, 0.05, 0.1, 0.3, 1.0, 3.0])
SPECTRA = {
    "elastic": lambda one, _: tdint.spectrum(one, PERIODS, 0.05).sd,
    "undamped": lambda one, _: tdint.spectrum(one, PERIODS, 0.0).sa,
    "rotated": lambda one, two: tdint.rotated_spectrum((one, two), PERIODS).psa,
    "ductility": lambda one, _: constant_ductility(one, PERIODS[2:], (3.0,), hardening=0.02)[0].sd,
    "sums of modes": lambda one, _: tdint.drift_spectrum(one, PERIODS[3:]).peak_drift_ratio,
}


@pytest.mark.parametrize("kind", SPECTRA)
def test_spectra(kind):
    expected = SPECTRA[kind](record(1.0), record(1.0, "HNN"))
    for factor in FACTORS:
        found = np.array(SPECTRA[kind](record(factor), record(factor, "HNN"))) / factor
        assert np.array_equal(found, np.array(expected))
