"""Methods and laws from files outside the package, as described in the READMEs, and from installed
packages."""

import csv
import hashlib
import io
import json
import math
import pickle
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

import readmes
import tdint
from registered import compiled_truth, forget, forgotten, plain  # noqa: F401 (fixtures)
from selection import every
from separate_streams import runner
from tdint.assessment.chart.problem import Problem, _cache_file
from tdint.assessment.failures.failures import problems
from tdint.assessment.order import order as order_module
from tdint.assessment.order.order import check_law, check_method
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion import measures
from tdint.ground_motion.record import Record
from tdint.kernels import build
from tdint.kernels.building.compilable import ANY, FULL, Variant
from tdint.kernels.building.process import Compilation
from tdint.kernels.building.sources import CODE, closure
from tdint.kernels.laws import LAWS as NUMBERED
from tdint.kernels.laws import OURS, gap
from tdint.kernels.laws.compiled import compiled_laws
from tdint.methods import catalogue as methods
from tdint.methods import step_check
from tdint.model import story_laws
from tdint.model.definition import Link
from tdint.model.plugins import files_to_send
from tdint.model.story_laws import CODES, LINEAR, Law
from tdint.public_names import PLUGIN
from tdint.response.runs import compiled_steps
from tdint.response.runs.batch import Subject
from tdint.response.runs.prepared import PreparedBuilding
from tdint.studies.campaign.buildings import ModelBuilding, plugin_files
from tdint.studies.campaign.cluster import run_chunk_with_plugins
from tdint.studies.campaign.inputs import read_inputs
from tdint.studies.campaign.plan import make_plan
from tdint.studies.campaign.reader import load_campaign
from tdint_cli.main import cli


@pytest.fixture
def verlet(tmp_path):
    """Return the file with the example method of the README."""
    file = tmp_path / "verlet.py"
    file.write_text(readmes.block("plugin-method"))
    return file


@pytest.fixture
def hyperbolic(tmp_path):
    """Return the file with the example law of the README."""
    file = tmp_path / "hyperbolic.py"
    file.write_text(readmes.block("law-file"))
    return file


def outside(tmp_path, text, name="outside_plugin"):
    file = tmp_path / f"{name}.py"
    file.write_text(dedent(text))
    return file


@pytest.mark.usefixtures("compiled_truth")
@pytest.mark.long
def test_method_of_readme_agrees_with_its_declarations(verlet, monkeypatch):
    """`check` confirms its declarations, and reports changed declarations as wrong."""
    tdint.load_plugin(str(verlet))
    integrator = methods.parse("verlet")
    measured = check_method(integrator)
    assert measured.faults == ()
    assert math.isclose(measured.limit, 2.0, rel_tol=1e-6)
    assert abs(measured.order - 2.0) < 0.1
    # Yielding stories take longest and are tested above.
    monkeypatch.setattr(order_module, "faults_with_yielding", lambda integrator: {})
    false = replace(integrator.method, stability_limit=lambda: 2.2, order=lambda: 4)
    order_fault, limit_fault = check_method(replace(integrator, method=false)).faults
    assert re.fullmatch(r"verlet: .*\b4\b.*\b2\.00", order_fault)
    assert re.match(r"verlet: .*= 2\.2, .* 2;", limit_fault)
    assert integrator.family.step not in compiled_steps.VALIDATED_STEPS


MISTAKES = {
    "its laws are never committed": (
        "        commit(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)\n",
        "",
        "the expected order is 2",
    ),
    "dissipation is not added up": (
        "commit(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)",
        "stories.commit_without_dissipation(law_parameters, law_state, i, rows.FIRST_TRIAL)",
        "the energies are not balanced",
    ),
    "too few scratch rows": (
        "lambda modes: ROWS",
        "lambda modes: 2",
        "row 3 of scratch is used, but only 2 are declared",
    ),
    "too few rows of state": (
        "memory=(0, 1, 2)",
        "memory=(0, 1), state_rows=2",
        "row 2 of state is used, but only 2 are",
    ),
    "memory in scratch": (
        "+ 0.5 * h * state[rows.ACCELERATION, i]\n",
        "+ 0.5 * h * scratch[A + 1, i]\n",
        "the result changes if the scratch rows are cleared",
    ),
    "a name that is not there": (
        "u - linear_terms",
        "v - linear_terms",
        "NameError: name 'v' is not defined",
    ),
}


@pytest.mark.parametrize("fails", ["integrate_in_python", "faults_with_yielding"])
def test_run_after_check_with_faults_validates_the_step(verlet, monkeypatch, fails):
    """Otherwise the compiled step could write outside its arrays."""

    def fail(*_, **__):
        raise AnalysisError("row 3 of scratch is used")

    tdint.load_plugin(str(verlet))
    integrator = methods.parse("verlet")
    monkeypatch.setattr(order_module, fails, fail)
    assert check_method(integrator).faults == ("row 3 of scratch is used",)
    assert integrator.family.step not in compiled_steps.VALIDATED_STEPS


@pytest.mark.long
@pytest.mark.usefixtures("compiled_truth")
@pytest.mark.parametrize(
    "mistake", every(2, MISTAKES, ("too few rows of state", "a name that is not there"))
)
def test_usual_mistakes_of_method_are_found(tmp_path, verlet, mistake):
    """Mistakes are detected before compilation: in plain Python with checked bounds, and then with
    yielding stories."""
    before, after, message = MISTAKES[mistake]
    text = verlet.read_text().replace(
        "from tdint.plugin import (",
        "from tdint.kernels.stories import law_state as stories\nfrom tdint.plugin import (",
    )
    assert before in text
    text = text.replace(before, after)
    if mistake == "memory in scratch":
        text = text.replace("= a\n", "= scratch[A + 1, i] = a\n").replace(
            "ROWS = range(5)", "_, ROWS = range(6)"
        )
    tdint.load_plugin(str(outside(tmp_path, text)))
    integrator = methods.parse("verlet")
    try:
        step_check.integrate_in_python("linear", integrator, 1)
        # The first of the laws shows each of the mistakes.
        faults = [*step_check.faults_with_yielding(integrator, ["bilinear"]).values()]
    except AnalysisError as error:
        faults = [str(error)]
    assert sum(message in fault for fault in faults) == 1, faults
    if "of scratch is used" in message or "NameError" in message:
        assert re.match(rf"{tmp_path}/outside_plugin\.py:\d+: ", faults[0])


@pytest.mark.slow
def test_check_accepts_own_methods():
    """Methods of each type pass the check: methods with several stages, several steps, without
    iterations, of order 2 and higher."""
    for name in ("bathe", "park", "chang", "rk5", "gauss4"):
        assert step_check.faults_with_yielding(methods.parse(name)) == {}


EULER = Path(__file__).parent / "recipes/backward_euler.py"
ACCUMULATED = "commit(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)"


def euler_without(tmp_path, share):
    """Return a file with the backward Euler method, named `leaky`, that accumulates only a share of
    the dissipated energy."""
    lost = (
        "before = law_state[rows.DISSIPATED, i]\n        "
        + ACCUMULATED
        + f"\n        law_state[rows.DISSIPATED, i] -= {1.0 - share!r} * "
        "(law_state[rows.DISSIPATED, i] - before)"
    )
    text = EULER.read_text().replace(ACCUMULATED, lost).replace("backward-euler", "leaky")
    return outside(tmp_path, text, "leaky")


@pytest.mark.long
def test_energy_lost_by_numerical_damping_is_accepted_with_its_order(tmp_path):
    """The imbalance of backward Euler is 2 % with the smallest time step of the check and is halved
    with each halved step. Dissipated energy that is not accumulated remains."""
    tdint.load_plugin(str(EULER))
    tdint.load_plugin(str(euler_without(tmp_path, 0.97)))
    sound = step_check.energy_balance(methods.parse("backward-euler"), "bilinear")
    leaky = step_check.energy_balance(methods.parse("leaky"), "bilinear")
    assert sound.fault == "" and sound.imbalance > 0.01 and abs(sound.order - 1.0) < 0.1
    assert leaky.order < 0.75
    assert re.search(
        r"not balanced: .* of order 0\.\d\d in the time step .expected: 1.;", leaky.fault
    )
    # The same method as a member of the built-in family, and with larger numerical damping
    for name in ("newmark:beta=0.3025:gamma=0.6", "newmark:beta=0.5625:gamma=1"):
        assert step_check.energy_balance(methods.parse(name), "bilinear").fault == ""


@pytest.mark.long
def test_energies_are_required_only_where_stories_dissipate(tmp_path, monkeypatch):
    """A method that does not accumulate the dissipated energy can be studied with oscillators and
    integrates elastic buildings, but not yielding buildings."""
    tdint.load_plugin(str(euler_without(tmp_path, 0.0)))
    monkeypatch.setenv("TDINT_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delenv("TDINT_KERNELS", raising=False)
    integrator, features = methods.parse("leaky"), compiled_steps.LINEAR_OSCILLATORS
    compiled_steps.validate_plugin_step(integrator)
    for name in ("polynomial", "tanh"):
        laws = compiled_laws((0.0, CODES[name]))
        compiled_steps.kernels(integrator, features._replace(laws=laws))
    # The problems of `failures` are elastic.
    for problem in problems().values():
        compiled_steps.kernels(integrator, PreparedBuilding.of(problem.model).variant)
    with pytest.raises(AnalysisError, match="the energies are not balanced"):
        compiled_steps.kernels(integrator, features._replace(laws=compiled_laws((0.0, 1.0))))
    with pytest.raises(AnalysisError, match="the energies are not balanced"):
        compiled_steps.kernels(integrator, Variant(FULL, compiled_laws((0.0, 3.0))))


@pytest.mark.usefixtures("plain")
@pytest.mark.long
def test_incompletely_set_branch_is_reported(tmp_path):
    """A variant of the law `gap` does not set the lower end of a branch. Compiled code would
    continue with this error without a message."""
    text = Path(gap.__file__).read_text().replace('"gap",\n', '"half-gap",\n')
    text = (
        text.replace("set_branch(law_state, i, block, ", "half(law_state, i, block, ")
        + """
from tdint.kernels.compiling import inline

LAWS = (LAW,)


@inline
def half(law_state, i, block, slope, lower, upper, turn):
    law_state[block + rows.SLOPE, i] = slope
    law_state[block + rows.UPPER, i] = upper
"""
    )
    tdint.load_plugin(str(outside(tmp_path, text)))
    story = {
        "mass": 1e4,
        "stiffness": 3e7,
        "law": {"type": "half-gap", "gap": 0.003, "stop_stiffness": 1e8},
    }
    (fault,) = check_law(tdint.load_model({"stories": [story]}), 1)
    assert "in `enter`" in fault and "set_branch" in fault
    unchanged = tdint.load_model({"stories": [{**story, "law": {**story["law"], "type": "gap"}}]})
    assert check_law(unchanged, 1) == []


@pytest.fixture
def model_with_law(tmp_path, hyperbolic):
    """Return the model of the README with its law."""
    tdint.load_plugin(str(hyperbolic))
    file = tmp_path / "workshop.yaml"
    file.write_text(readmes.block("plugin-model"))
    return tdint.load_model(str(file))


@pytest.mark.long
@pytest.mark.usefixtures("plain")
def test_law_of_readme_agrees_with_formula(model_with_law):
    """Along cycles, its force equals its formula."""
    path = tdint.cyclic_test(model_with_law, 1, ["2%"], points=50).path
    x = 3e7 * path.drift / 3e5
    np.testing.assert_allclose(path.shear, 3e5 * x / np.sqrt(1.0 + x * x), rtol=1e-12, atol=1e-6)
    assert check_law(model_with_law, 1) == []


@pytest.mark.long
@pytest.mark.usefixtures("plain")
def test_false_tangent_and_energy_of_law_are_reported(tmp_path, hyperbolic):
    text = hyperbolic.read_text()
    for sound, false in (
        (r"root \* root \* root\)", "root)"),
        (r"\* x\s+\* x\s+/ \(1\.0", "* x / (1.0"),
        ('"hyperbolic",', '"skewed",'),
    ):
        text, changes = re.subn(sound, false, text)
        assert changes == 1
    tdint.load_plugin(str(outside(tmp_path, text)))
    story = {
        "mass": 1e4,
        "height": 4.0,
        "stiffness": 3e7,
        "law": {"type": "skewed", "strength": 3e5},
    }
    tangent, energy = check_law(tdint.load_model({"stories": [story]}), 1)
    assert "dissipated energy differ" in energy
    assert "tangent is not the slope" in tangent


def test_plugin_law_does_not_change_sources_of_other_models(hyperbolic):
    name = "tdint.methods.impulse4:step"
    before = closure(name)
    tdint.load_plugin(str(hyperbolic))
    assert closure(name) == before
    (law,) = compiled_laws([float(OURS)])
    assert law.name == "tdint_plugin_hyperbolic:law.hyperbolic"
    assert "tdint_plugin_hyperbolic" in closure(law.name)


LAWS_ELSEWHERE = {
    "built-in law with another name": (
        "from dataclasses import replace\n"
        "from tdint.kernels.laws import imk\n"
        "LAWS = (replace(imk.LAW, name='my-law'),)\n"
    ),
    "functions in another module": (
        "from dataclasses import replace\n"
        "from outside_law import LAW\n"
        "LAWS = (replace(LAW, name='my-law'),)\n"
    ),
    "changed law with the same name": (
        "from dataclasses import replace\n"
        "from outside_law import LAW\n"
        "LAW = replace(LAW, name='my-law', formula='first')\n"
        "LAWS = (replace(LAW, formula='second'),)\n"
    ),
    "values of a dictionary": (
        "from dataclasses import replace\n"
        "import outside_law\n"
        "LAWS = {'my-law': replace(outside_law.LAW, name='my-law')}.values()\n"
    ),
}


def found_by_compiling_process():
    """Return the law that the process that compiles finds for a registered law."""
    (law,) = compiled_laws([float(OURS)])
    compilation = Compilation(law, ANY, {})
    name, _, file = compilation.request
    module, _, attribute = name.partition(":")
    files = closure(name)
    forget()
    try:
        found = build._law(build._module(module, file), attribute.removeprefix("law."))
    except SystemExit as error:
        raise AnalysisError(compilation.reason([str(error)])) from None
    assert closure(name) == files
    assert "tdint_plugin_lists_laws" in files
    return found


@pytest.mark.parametrize("case", LAWS_ELSEWHERE)
def test_law_is_found_by_compiling_process(tmp_path, hyperbolic, monkeypatch, case):
    """The sources of the law include the plug-in, which can change properties of the law."""
    hyperbolic.rename(tmp_path / "outside_law.py")
    monkeypatch.syspath_prepend(str(tmp_path))
    tdint.load_plugin(str(outside(tmp_path, LAWS_ELSEWHERE[case], "lists_laws")))
    registered = NUMBERED[OURS]
    found = found_by_compiling_process()
    assert (found.name, found.formula) == ("my-law", registered.formula)


def test_law_that_no_module_contains_is_reported_in_one_line():
    story_laws.register_law(replace(story_laws.LAWS["tanh"], name="alone"))
    with pytest.raises(AnalysisError, match=r"^law 'alone' not found in .*tanh\.py; [^\n]*LAWS"):
        found_by_compiling_process()


def test_imports_of_plugin_belong_to_its_sources(tmp_path, verlet, monkeypatch):
    (tmp_path / "outside_helpers.py").write_text("ROWS = 4\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    file = outside(
        tmp_path, "from outside_helpers import ROWS as _\n" + verlet.read_text(), "helped"
    )
    tdint.load_plugin(str(file))
    assert {"outside_helpers", "tdint_plugin_helped"} < closure("tdint_plugin_helped").keys()


@pytest.mark.parametrize("line", ["from tdint.plugin import *", "import tdint.plugin"])
def test_import_of_all_public_names_belongs_to_sources(tmp_path, verlet, line):
    """A change of any module of kernels that defines a public name requires a new compilation."""
    named = verlet.read_text()
    tdint.load_plugin(str(outside(tmp_path, named + f"\n{line}\n", "imports_all")))
    expected = {home for home in PLUGIN.values() if home.startswith("tdint.kernels.")}
    assert expected <= closure("tdint_plugin_imports_all").keys()


FAULTS = {
    "def f(:\n": "outside_plugin.py:1: SyntaxError: ",
    "x = 1\ny = x / 0\n": "outside_plugin.py:2: ZeroDivisionError: division by zero",
    "x = 1\n": "outside_plugin.py: a plug-in must define a tuple METHODS, LAWS, PEERS or MEASURES",
    "METHODS = (3,)\n": "outside_plugin.py: METHODS must contain Method objects, not int",
    "METHODS = 3\n": "outside_plugin.py: TypeError: ",
    "raise SystemExit(3)\n": "outside_plugin.py:1: SystemExit: 3",
    "class Odd(BaseException): pass\nraise Odd('so')": "outside_plugin.py:2: Odd: so",
    "class Odd(Exception):\n    def __str__(self): raise KeyError(1)\nraise Odd": "outside_plugin.py:3: Odd: without a",  # noqa: E501
    "from dataclasses import replace\nfrom tdint.methods.bathe import METHODS\nMETHODS = "
    "(replace(METHODS[0]),)\n": ("a method 'bathe' already exists; choose another name"),
    "from tdint.kernels.laws.law import DriftLaw\nLAWS = (DriftLaw('tanh', '', lambda: None),)\n": (
        "a law 'tanh' already exists"
    ),
}


@pytest.mark.parametrize("text", FAULTS)
def test_invalid_plugin_file_is_reported_in_one_line(tmp_path, text):
    with pytest.raises(UsageError) as caught:
        tdint.load_plugin(str(outside(tmp_path, text)))
    assert FAULTS[text] in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path)) and "\n" not in str(caught.value)


CHANGES = {
    (
        "verlet",
        '"verlet",\n        family',
        '"Verlet 2",\n        family',
    ): "invalid name of a method: 'Verlet 2'",
    ("verlet", 'Family("verlet"', 'Family("bathe"'): "a family 'bathe' already exists",
    ("verlet", "order=lambda: 2", "order=lambda: '2'"): "order must be of type int, got '2'",
    ("verlet", "order=lambda: 2", "order=lambda x: 2"): "TypeError: ",
    ("verlet", "coefficients=lambda: ()", "coefficients=lambda: 'a'"): "ValueError: ",
    ("hyperbolic", '"hyperbolic",', '"a,b",'): "invalid name of a law: 'a,b'",
    ("hyperbolic", "    from tdint.plugin", "    from nowhere"): "ModuleNotFoundError: ",
}


@pytest.mark.parametrize("change", CHANGES)
def test_invalid_declaration_is_reported_and_not_registered(request, change):
    name, before, after = change
    file = request.getfixturevalue(name)
    assert before in file.read_text()
    file.write_text(file.read_text().replace(before, after))
    with pytest.raises(UsageError) as caught:
        tdint.load_plugin(str(file))
    assert CHANGES[change] in str(caught.value) and "\n" not in str(caught.value)
    assert len(NUMBERED) == OURS
    assert "verlet" not in methods.catalogue()


@pytest.mark.long
def test_compilation_error_contains_file_and_line(tmp_path, verlet):
    before = "n = linear_terms.shape[1] - 1"
    line = verlet.read_text().partition(before)[0].count("\n") + 1
    file = outside(tmp_path, verlet.read_text().replace(before, before[:-1] + "'a'"))
    tdint.load_plugin(str(file))
    with pytest.raises(AnalysisError, match=f": {file}:{line}: No implementation"):
        tdint.stability("verlet", [0.1])


def test_plugins_with_equal_names_are_refused(tmp_path, verlet):
    tdint.load_plugin(str(verlet))
    tdint.load_plugin(str(verlet))
    (tmp_path / "other").mkdir()
    other = tmp_path / "other" / "verlet.py"
    other.write_text(verlet.read_text())
    with pytest.raises(UsageError, match=r"verlet.*same name; rename"):
        tdint.load_plugin(str(other))


def test_law_without_file_is_refused():
    law = story_laws.LAWS["tanh"]
    alone = type(law)("alone", law.formula, eval("lambda: None", {"__name__": "__main__"}))
    with pytest.raises(UsageError, match=r"alone.*import"):
        story_laws.register_law(alone)
    with pytest.raises(UsageError, match="a law must be a tdint"):
        story_laws.register_law("tanh")
    with pytest.raises(UsageError, match="a method must be a tdint"):
        methods.register_method(law)


PACKAGE = {
    "outside_package/__init__.py": "",
    "outside_package-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: "
    "outside-package\nVersion: 1.0\n",
    "outside_package-1.0.dist-info/entry_points.txt": "[tdint.methods]\nverlet = "
    "outside_package.verlet\n"
    "wrong = outside_package.nothing\n[tdint.laws]\nhyperbolic = outside_package.hyperbolic:LAW\n",
}


def test_installed_plugins_need_no_option(tmp_path, verlet, hyperbolic, monkeypatch, caplog):
    """A faulty entry point causes a warning, and other entry points are still loaded."""
    for name, text in PACKAGE.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    for file in (verlet, hyperbolic):
        file.rename(tmp_path / "outside_package" / file.name)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    forget()
    methods.parse("impulse4")
    assert "outside_package.verlet" not in sys.modules
    story = {"mass": 1.0, "stiffness": 1.0, "law": {"type": "hyperbolic", "strength": 1.0}}
    assert tdint.load_model({"stories": [story]}).stories[0].law == Law("hyperbolic", (1.0,))
    assert (methods.parse("verlet").label, list(methods.catalogue())[-1]) == ("verlet", "verlet")
    code = {
        name: "outside-package 1.0: outside_package/" + name
        for name in ("hyperbolic.py", "verlet.py")
    }
    assert [*CODE["law hyperbolic"], *CODE["method verlet"]] == [*code.values()]
    (warning,) = caplog.messages
    assert warning.startswith(
        "plug-in skipped: outside-package 1.0, entry point wrong of tdint.methods "
        "(outside_package.nothing)"
    )


SHAKEN = """\
stories: [{mass: 1e4, height: 4, stiffness: 3e7, law: {type: hyperbolic, strength: 3e5}}]
excitation: {record: {file: motion.txt, units: m/s^2}}
"""


@pytest.fixture
def workshop(tmp_path, hyperbolic, monkeypatch):
    """Return a directory with a record and a model that uses the law of the README, and a function
    that runs a command in this directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shaken.yaml").write_text(SHAKEN)
    samples = 8.0 * np.sin(np.arange(60) * 0.07)
    (tmp_path / "motion.txt").write_text(
        "\n".join(f"{0.01 * i:.2f} {a:.9f}" for i, a in enumerate(samples)) + "\n"
    )
    (tmp_path / "campaign.yaml").write_text(
        "buildings: {models: [shaken.yaml]}\nrecords: {files: [motion.txt], units: m/s^2}\n"
        "intensity: {scales: [0.5, 1.0]}\nanalysis: {method: verlet, dt: 0.005}\n"
    )

    def run(*arguments):
        output, table = (
            ("out", "out/stories.csv") if arguments[0] == "run" else ("table.csv", "table.csv")
        )
        result = runner().invoke(cli, [*arguments, "-o", output, "--overwrite"])
        assert result.exit_code == 0, result.output
        return list(csv.DictReader(io.StringIO((tmp_path / table).read_text(encoding="utf-8"))))

    return run


@pytest.mark.long
def test_commands_use_methods_and_laws_of_files(workshop, verlet, tmp_path):
    """`run`, `stability` and `order` in one process each use only the plug-ins of their --plugin
    options."""
    plugins = ("--plugin", "verlet.py", "--plugin", "hyperbolic.py")
    (story,) = workshop("run", "shaken.yaml", *plugins, "--method", "verlet", "--dt", "0.005")
    single = tdint.run("shaken.yaml", method="verlet", dt=0.005).stories
    assert float(story["peak_drift_m"]) == pytest.approx(single.peak_drift[0], rel=1e-11)
    expected = tdint.run("shaken.yaml", method="central-difference", dt=0.005).stories
    np.testing.assert_allclose(
        single.peak_drift, expected.peak_drift, rtol=1e-9
    )  # without damping they are one
    curve = workshop(
        "stability", "--plugin", "verlet.py", "--method", "verlet", "--dt-over-t", "0.1:0.5:5"
    )
    radius = {float(row["dt_over_t"]): float(row["spectral_radius"]) for row in curve}
    assert radius[0.1] == pytest.approx(1.0) and radius[0.5] > 2.0  # the limit is 1 / pi
    # The results depend on the executed file, so that its hash is stored with the table.
    (code,) = json.loads((tmp_path / "table.json").read_text())["inputs"]
    assert code == {"file": "verlet.py", "sha256": hashlib.sha256(verlet.read_bytes()).hexdigest()}
    (observed,) = workshop(
        "order", "--plugin", "verlet.py", "--method", "verlet", "--frequency-ratio", "0.5"
    )
    assert float(observed["displacement_order"]) == pytest.approx(2.0, abs=0.1)


def test_laws_of_links_are_among_the_plugins_of_a_store(model_with_law):
    """Otherwise an interrupted campaign would continue with a changed law of a link."""
    (yielding,) = model_with_law.stories
    link = Link("brace", (0, 1), replace(yielding, mass=0.0))
    braced = replace(model_with_law, stories=(replace(yielding, law=LINEAR),), links=(link,))
    assert list(plugin_files((ModelBuilding("m", Subject(braced, "impulse4")),))) == [
        "hyperbolic.py"
    ]


@pytest.mark.usefixtures("plain")
@pytest.mark.long
def test_store_refuses_changed_plugin(workshop, verlet, hyperbolic, tmp_path, monkeypatch):
    """`campaign`, `merge` and `ida` refuse a store of runs if its law, or a module that the law
    imports, was changed; the message names the file. Other plug-ins may be changed. All plug-ins
    are unloaded before each call, as in a new process."""
    monkeypatch.syspath_prepend(str(tmp_path))
    helpers = outside(tmp_path, "FACTOR = 1.0\n", "outside_helpers")
    text = hyperbolic.read_text().replace(
        "import math\n", "import math\n\nimport outside_helpers\n"
    )
    # Force and tangent are changed equally, because a law with a wrong tangent is refused.
    text = text.replace("* drift / root", "* drift * outside_helpers.FACTOR / root")
    tangent = "/ (root * root * root)"
    assert tangent in text
    hyperbolic.write_text(text.replace(tangent, f"* outside_helpers.FACTOR {tangent}"))
    unused = outside(tmp_path, verlet.read_text().replace('"verlet"', '"unused"'), "unused")
    plugins = [
        word for name in ("verlet", "hyperbolic", "unused") for word in ("--plugin", f"{name}.py")
    ]

    def call(code, *arguments):
        forget()
        result = runner().invoke(cli, ["-q", *arguments])
        assert result.exit_code == code, result.output
        return result.stderr

    study = ("campaign", "campaign.yaml", *plugins, "-o")
    ida = ("ida", "shaken.yaml", "motion.txt", "--units", "m/s^2", *plugins)
    ida = (*ida, "--method", "verlet", "--dt", "0.01", "-o", "levels")
    call(0, *study, "out")
    call(0, *ida)
    stored_plugins = json.loads((tmp_path / "out/summary.json").read_text())["versions"]["plugins"]
    names = ("hyperbolic.py", "outside_helpers.py", "verlet.py")
    assert stored_plugins == {
        name: hashlib.sha256((tmp_path / name).read_bytes()).hexdigest() for name in names
    }
    unused.write_text(unused.read_text() + "# edited\n")
    call(0, *study, "out")
    helpers.write_text(
        "FACTOR = 0.25\n"
    )  # of another size, because Python compares the size and the time of the last edit in seconds
    for command in ((*study, "out"), ida):
        refused = call(6, *command)
        assert "plug-in outside_helpers.py: differs" in refused and "-o, or --overwrite" in refused
    call(0, *study, "new")
    first, second = (
        (tmp_path / directory / "runs.csv").read_text() for directory in ("out", "new")
    )
    assert first != second
    assert "plug-in outside_helpers.py: differs" in call(
        2, "campaign", "merge", "out", "new", "-o", "all"
    )


def test_cached_reference_depends_on_law(model_with_law, hyperbolic, tmp_path):
    """The cached reference solution is not used for another law with the same parameters, in the
    same or another file. A file that was edited after its execution in this process is not used
    under the old name."""
    text = hyperbolic.read_text()
    both = text.replace(
        "LAWS = (LAW,)", "import dataclasses\nLAWS = (LAW, dataclasses.replace(LAW, name='second'))"
    )
    tdint.load_plugin(str(outside(tmp_path, both.replace('"hyperbolic",', '"first",'))))
    files = []
    for name in ("hyperbolic", "first", "second"):
        law = replace(model_with_law.stories[0].law, name=name)
        model = replace(model_with_law, stories=(replace(model_with_law.stories[0], law=law),))
        files.append(_cache_file(Problem(model, None, 0.01, 8), 8))
    assert len(set(files)) == 3
    hyperbolic.write_text(text + "# edited\n")
    with pytest.raises(UsageError, match=r"hyperbolic\.py.* has changed"):
        tdint.load_plugin(str(hyperbolic))


@pytest.mark.usefixtures("plain")
@pytest.mark.long
def test_plugin_files_are_sent_to_workers(workshop, verlet, hyperbolic, tmp_path):
    """A process without the two plug-ins, such as a Dask worker, gives the same runs."""
    for file in (verlet, hyperbolic):
        tdint.load_plugin(str(file))
    campaign = load_campaign("campaign.yaml")
    chunk = make_plan(campaign, read_inputs(campaign)).chunk(0)
    sent = files_to_send()
    assert [name for name, _ in sent] == ["verlet.py", "hyperbolic.py"]
    worker = (
        "import pickle, sys; f, *a = pickle.load(sys.stdin.buffer); "
        "sys.stdout.buffer.write(pickle.dumps(f(*a)))"
    )
    called = pickle.dumps((run_chunk_with_plugins, sent, chunk))
    done = subprocess.run(
        [sys.executable, "-c", worker], input=called, capture_output=True, cwd="/"
    )
    assert done.returncode == 0, done.stderr
    here, there = run_chunk_with_plugins(sent, chunk).rows.runs, pickle.loads(done.stdout).rows.runs
    # The texts of numbers are exact, and those of two nan (here no isolator) are equal.
    assert repr(there) == repr(here)
    assert len(here) == 2
    with pytest.raises(UsageError, match=r"verlet\.py: .*another version"):
        run_chunk_with_plugins((("verlet.py", b"METHODS = ()"),), chunk)


AGAIN = """
import pickle, sys
with open(sys.argv[1], "rb") as stream:
    case, response = pickle.load(stream)
import tdint
print(repr(float(tdint.run_case(case, dt=0.005).stories.peak_drift[0])), repr(float(response.stories.peak_drift[0])))
"""  # noqa: E501


@pytest.mark.long
def test_case_and_result_are_read_by_new_process(workshop, verlet, hyperbolic, tmp_path):
    """The new process loads the plug-ins of the method and the law from their files if the files
    are unchanged."""
    for file in (verlet, hyperbolic):
        tdint.load_plugin(str(file))
    case = tdint.prepare("shaken.yaml", method="verlet")
    response = tdint.run_case(case, dt=0.005)
    (tmp_path / "kept").write_bytes(pickle.dumps((case, response)))

    command = [sys.executable, "-c", AGAIN, str(tmp_path / "kept")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [repr(float(response.stories.peak_drift[0]))] * 2
    for file in (verlet, hyperbolic):
        text = file.read_text()
        file.write_text(text + "# another one\n")
        forget()
        with pytest.raises(
            UsageError,
            match=f"plug-in {file}.* changed; ",
        ):
            tdint.run_case(pickle.loads((tmp_path / "kept").read_bytes())[0], dt=0.005)
        file.write_text(text)


@pytest.mark.parametrize(
    ("name", "change", "fault"),
    [
        ("few", ("FACTORS + factor_rows(modes)", "2"), "is used, but only 2 are declared"),
        pytest.param(
            "forgets",
            ("        commit(law_parameters, law_state, i, rows.SECOND_TRIAL", "        abs("),
            "state of each story",
            marks=pytest.mark.long,
        ),
        pytest.param("sound", ("", ""), "", marks=pytest.mark.long),
    ],
)
def test_plugin_is_executed_in_python_before_first_compiled_run(
    tmp_path, monkeypatch, name, change, fault
):
    """The check runs once for each state of the sources, in Python and on the command line. A
    plug-in that passed is not checked again."""
    text = (
        (Path(__file__).parent / "recipes/sdirk3.py")
        .read_text()
        .replace(change[0] or "\0", change[1])
    )
    text = (
        text.replace("abs(, rows.THIRD_TRIAL)", "abs(0)")
        .replace('"sdirk3"', f'"{name}"')
        .replace('"sdirk"', f'"{name}"')
    )
    tdint.load_plugin(str(outside(tmp_path, text, name)))
    monkeypatch.setenv("TDINT_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delenv("TDINT_KERNELS", raising=False)
    looked, integrator = [], methods.parse(name)
    real = step_check.faults_of_step
    monkeypatch.setattr(
        step_check, "faults_of_step", lambda integrator: looked.append(1) or real(integrator)
    )
    times = 1 if name == "forgets" else 2  # this check takes two seconds
    for _ in range(times):
        compiled_steps.VALIDATED_STEPS.discard(integrator.family.step)  # as another process
        if fault:
            with pytest.raises(AnalysisError, match=fault):
                tdint.run(
                    {"stories": [{"mass": 1e3, "stiffness": 1e6}]},
                    method=name,
                    dt=0.01,
                    duration=1.0,
                )
        else:
            compiled_steps.validate_plugin_step(integrator)
    assert len(looked) == (times if fault else 1)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("raise ValueError('no strong motion')", r":\d+: ValueError: no strong motion"),
        ("return None", r": measure own: the value must be a finite number.*got None for r"),
        ("return np.zeros(3)", r": measure own: .* got array\(\[0., 0., 0.\]\)"),
        ("return 1j", r": measure own: .* got 1j"),
        ("return float('inf')", r": measure own: .* got inf"),
    ],
)
def test_fault_of_a_measure_is_one_line_with_its_file(tmp_path, monkeypatch, body, message):
    monkeypatch.setattr(measures, "MEASURES", dict(measures.MEASURES))
    file = tmp_path / f"measure_{len(body)}.py"
    file.write_text(
        "import numpy as np\nfrom tdint.plugin import Measure\n\n"
        f"def value(record):\n    {body}\n\n"
        "MEASURES = (Measure('own', 's', 'own measure', value, power=None),)\n"
    )
    for _ in range(2):  # a file that is loaded again is not registered again
        methods.load_plugin(file)
    with pytest.raises(UsageError, match=rf"^\S+{file.name}{message}"):
        measures.MEASURES["own"].of(Record(np.ones(3), 0.01, "r", "", "", "r"))
