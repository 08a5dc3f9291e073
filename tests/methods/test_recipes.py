"""Plug-ins of published papers that use only `tdint.plugin`: tests/methods/recipes and the
READMEs."""

import ast
import math
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import readmes
import tdint
from building_cases import noise
from registered import compiled_truth, forgotten, plain  # noqa: F401 (fixtures)
from selection import every
from tdint import plugin
from tdint.assessment.chart.problem import pose
from tdint.assessment.order.order import check_law, check_method
from tdint.methods import catalogue as methods
from tdint.methods import step_check
from tdint.methods.exact_step import oscillator
from tdint.model.plugins import peers
from tdint.output.tables.spectra import info_table, record_info
from tdint.studies.fragility.measures import run_measure
from tdint_cli.main import cli

RECIPES = Path(__file__).parent / "recipes"
METHODS = {
    "rho_inf_bathe": ("rho-inf-bathe", "rho-inf-bathe:rho_inf=0.2,gamma=0.7"),
    "two_parameter_bathe": (
        "two-parameter-bathe",
        "two-parameter-bathe:beta1=0.4",
        "two-parameter-bathe:beta1=0.5:beta2=0.6",
    ),
    "explicit_alpha": ("explicit-alpha", "explicit-alpha:rho_b=0.3"),
    "rosenbrock": ("ros2",),
    "sdirk3": ("sdirk3",),
    "backward_euler": ("backward-euler",),
}
STORIES = {
    "menegotto_pinto": {"type": "menegotto-pinto", "yield_force": 3e5, "hardening": 0.03},
    "flag": {"type": "flag", "yield_force": 3e5, "hardening": 0.05, "loss": 0.6},
}


def test_plugins_import_only_public_names():
    assert {
        "EffectiveCoefficients",
        "rows",
        "solve_equilibrium",
        "Family",
        "Measure",
        "Problem",
        "reader",
        "STEP",
        # of the record format in src/README.md
        *("NUMBER", "Lines", "RecordError", "Series", "recognizes", "required_units"),
    } < set(dir(plugin))
    assert all(getattr(plugin, name) is not None for name in dir(plugin))
    with pytest.raises(AttributeError, match="did you mean 'restoring_force'"):
        plugin.restorin  # noqa: B018
    blocks = ("plugin-method", "plugin-peer", "plugin-measure", "law-file")
    for text in (*map(readmes.block, blocks), *(file.read_text() for file in RECIPES.glob("*.py"))):
        nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)]
        assert {node.module for node in nodes if node.module.startswith("tdint")} <= {
            "tdint.plugin"
        }


def loaded(name):
    tdint.load_plugin(RECIPES / f"{name}.py")


def model_of(law, stories=1):
    story = {"mass": 6e4, "height": 4.0, "stiffness": 3e7, "law": law}
    return tdint.load_model({"stories": [story] * stories, "damping": "5%"})


@pytest.mark.usefixtures("compiled_truth")
@pytest.mark.parametrize("name", METHODS)
@pytest.mark.long
def test_recipe_method_is_accurate_with_yielding_stories(name):
    """Order, energy balance, fresh scratch and halved steps are checked in plain Python with
    checked bounds. Only bilinear stories are used here; the check of the declarations uses
    others."""
    loaded(name)
    assert step_check.faults_with_yielding(methods.parse(METHODS[name][0]), ["bilinear"]) == {}


def test_composite_method_is_defined_by_its_tableau():
    """With beta1 = 1/3, beta2 = 2/3 and gamma = 1/2 the method is that of Bathe and Baig (2005).

    The spectral radius at infinite frequency is measured at omega h = 1e5, where the remaining
    difference is of the order of 1 / (omega h).
    """
    loaded("two_parameter_bathe")
    own = methods.parse("two-parameter-bathe")
    bathe = methods.parse("bathe:gamma=0.5")
    np.testing.assert_allclose(
        own.coefficients(None, None, 1.0), bathe.coefficients(None, None, 1.0), rtol=1e-15
    )
    assert (own.order, own.rho_inf) == (2, pytest.approx(0.0, abs=1e-15))
    for text, order in (("beta1=0.4", 2), ("beta1=0.25", 2), ("beta1=0.5:beta2=0.6", 1)):
        method = methods.parse(f"two-parameter-bathe:{text}")
        assert method.order == order
        measured = tdint.stability(method.label, np.array([1e5 / (2.0 * np.pi)]), damping=0.0)
        assert measured.spectral_radius[0] == pytest.approx(method.rho_inf, abs=1e-4)
    for text in ("bathe:rho_inf=0.3:gamma=0.4", "bathe:rho_inf=0.8"):
        method = methods.parse(text)
        assert methods.parse(text).family.step is own.family.step
        assert tableau_of(method).rho_inf == pytest.approx(method.rho_inf, abs=1e-14)


def tableau_of(integrator):
    """Return the tableau of a composite method."""
    return plugin.ImplicitTableau(*integrator.coefficients(None, None, 1.0))


@pytest.mark.slow
@pytest.mark.parametrize("name", METHODS)
def test_recipe_method_agrees_with_its_declarations(name):
    loaded(name)
    for specification in METHODS[name]:
        assert check_method(methods.parse(specification)).faults == ()


@pytest.mark.usefixtures("plain")
@pytest.mark.parametrize("name", STORIES)
@pytest.mark.long
def test_recipe_law_passes_check(name):
    loaded(name)
    assert check_law(model_of(STORIES[name]), 1) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", STORIES)
def test_run_of_recipe_law_conserves_energy_for_every_method(name):
    loaded(name)
    record = tdint.make_record(5.0 * np.sin(np.arange(500) * 0.07), dt=0.01, units="m/s^2")
    model = model_of(STORIES[name], 2)
    fine, coarse = (
        tdint.run(model, record, method=method, dt=dt)
        for method, dt in (("moment4", 0.01), ("newmark-average", 0.001))
    )
    assert fine.stories.ductility.max() > 2.0
    assert abs(fine.energy.error) < 1e-5
    np.testing.assert_allclose(fine.stories.peak_drift, coarse.stories.peak_drift, rtol=1e-3)


@pytest.mark.usefixtures("plain")
def test_recipe_laws_agree_with_published_formulas():
    """Slopes, widths and asymptotes of the papers' formulas."""
    for name in STORIES:
        loaded(name)
    k, fy, a, beta = 3e7, 3e5, 0.05, 0.6
    path = tdint.cyclic_test(model_of(STORIES["flag"]), 1, ["1%"], points=400).path
    sliding = np.abs(path.drift) > 1.5 * fy / k
    upper = fy + a * k * (np.abs(path.drift) - fy / k)
    size = np.abs(path.shear)
    between = (size > upper - beta * fy - 1e-6) & (size < upper + 1e-6)
    assert between[sliding].all() and abs(path.shear[-1]) < 1e-6 * fy
    # One cycle: both loops have the width beta Fy over the plateau, less the ends that k cuts off.
    largest, cut = 0.04 - fy / k, beta * fy / ((1.0 - a) * k)
    assert path.hysteretic_energy[-1] == pytest.approx(
        2.0 * beta * fy * (largest + cut - 0.5 * cut - 0.5 * cut), rel=1e-9
    )
    path = tdint.cyclic_test(model_of(STORIES["menegotto_pinto"]), 1, ["1%"], points=400).path
    rows = path.drift.argmax()
    x, b = path.drift[rows] * k / fy, 0.03
    assert path.shear[rows] == pytest.approx(
        fy * (b * x + (1.0 - b) * x / (1.0 + x**20) ** 0.05), rel=1e-12
    )
    assert np.all(
        np.abs(path.shear) <= fy * (1.0 - b) + b * k * np.abs(path.drift) + 1e-6 * fy + b * fy
    )


def test_recipe_program_for_charts_is_exact():
    """For an oscillator: SciPy's exponential against the formula of Nigam and Jennings."""
    loaded("state_space")
    ((_, _, function),) = peers()
    record = tdint.make_record(np.sin(np.arange(200) * 0.3), dt=0.02, units="m/s^2")
    model = tdint.load_model(
        {"stories": [{"mass": 1.0, "stiffness": 100.0}], "damping": {"modal": 0.05}}
    )
    times, u = function(pose(model, record))
    step = oscillator(np.array([10.0 * 0.02]), np.array([0.05]))[0]
    state, motion = np.zeros(2), [0.0]
    for j in range(199):
        state = step @ np.concatenate([state, -(0.02**2) * record.acceleration[j : j + 2]])
        motion.append(state[0])
    np.testing.assert_allclose(u[:, 0], motion, atol=1e-12)
    assert times[-1] == pytest.approx(199 * 0.02)


def test_measure_of_readme_is_found_by_name(tmp_path):
    file = tmp_path / "bracketed.py"
    file.write_text(readmes.block("plugin-measure"))
    tdint.load_plugin(file)
    tdint.load_plugin(file)
    samples = np.zeros(101)
    samples[[20, 70]] = 0.6, -0.4
    record = tdint.make_record(samples, dt=0.01, units="m/s^2")
    assert run_measure("bracketed").of(record, 1.0, math.nan) == 0.0
    assert run_measure("bracketed").of(record, 2.0, math.nan) == pytest.approx(0.5)
    assert run_measure("d5_75").column == run_measure("d5-75").column == "d5_75"
    strong = tdint.make_record(2.0 * samples, dt=0.01, units="m/s^2")
    table = info_table([record_info(strong)])
    assert float(table.rows[0][table.columns.index("bracketed_s")]) == pytest.approx(0.5)
    assert table.columns[-1] == "notes"


def test_check_suggests_public_name_of_import(tmp_path):
    """If such an import fails, the message states the replacement."""
    file = tmp_path / "old.py"
    file.write_text(
        "from tdint.kernels import layout as rows\nfrom tdint.kernels.stepping import "
        "Memory\nMETHODS = ()\n"
    )
    output = CliRunner().invoke(cli, ["check", "--plugin", str(file)]).output
    # The replacement is code that a user copies.
    for line, module, name in (
        (1, "tdint.kernels", "rows"),
        (2, "tdint.kernels.stepping", "Memory"),
    ):
        expected = rf"{file}:{line}: {module} .*; .*from tdint\.plugin import {name}\b"
        assert re.search(expected, output), output
    gone = tmp_path / "gone.py"
    gone.write_text("from tdint.kernels.bundles import Memory, Scene\nMETHODS = ()\n")
    result = CliRunner().invoke(cli, ["check", "--plugin", str(gone)])
    assert result.exit_code == 2
    assert f"{gone}:1: ModuleNotFoundError: " in result.output
    assert "from tdint.plugin import Memory, Scene" in result.output


@pytest.mark.long
@pytest.mark.usefixtures("plain", "forgotten")
@pytest.mark.parametrize("method", every(4, ["impulse4", "moment4", "gauss4", "newmark-average"]))
def test_law_with_linear_and_curved_branches(method):
    """The story moves from a linear to a curved branch in each quarter of a cycle. Errors relative
    to impulse4 with 64 time steps per sample."""
    loaded("linear_then_tanh")
    law = {"type": "linear-then-tanh", "strength": 4.0, "limit": 0.002}
    model = tdint.load_model(
        {
            "units": {"length": "m", "force": "N", "mass": "kg"},
            "stories": [{"mass": 1.0, "height": 4.0, "stiffness": 1000.0, "law": law}],
            "damping": "2%",
        }
    )
    motion = noise(samples=61, peak=4.0)

    def displacements(name, steps):
        dt = motion.dt / steps
        response = tdint.run(model, motion, method=name, dt=dt, history=True, check=False)
        assert math.isfinite(response.stories.peak_shear[0])
        return response.history.displacement[::steps, 0]

    expected = displacements("impulse4", 64)
    coarse, fine = (
        np.max(np.abs(displacements(method, steps) - expected)) / np.max(np.abs(expected))
        for steps in (2, 8)
    )
    assert fine < 0.25 * coarse
    limits = {"impulse4": 2e-4, "moment4": 1e-4, "gauss4": 1e-2, "newmark-average": 4e-2}
    assert coarse < limits[method]
