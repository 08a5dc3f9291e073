"""`import tdint`: public names, their documentation, and a typed program that uses all of them."""

import ast
import builtins
import dataclasses
import functools
import inspect
import json
import os
import pydoc
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import tdint
import tdint.plugin
from selection import every
from tdint.public_names import DEFINED_AS, PUBLIC
from tdint.response.runs.outcome import StoryValues

FUNCTIONS = sorted(
    name for name in tdint.__all__ if callable(getattr(tdint, name)) and name[0].islower()
)
FUNCTIONS_OF_TDINT = {f"tdint.{name}" for name in FUNCTIONS}

PROGRAM = '''
import copy
import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np

import tdint

content: dict[str, Any] = {"stories": [{"mass": 1e5, "height": 3.0, "stiffness": 1e8}], "damping": "5%"}
model: tdint.Model = tdint.load_model(content)
record: tdint.Record = tdint.make_record(np.zeros(100), dt=0.01, units="g")
periods = np.geomspace(0.1, 2.0, 10)


class Trace:
    """As ObsPy has one."""

    stats: Any = None


def buildings() -> None:
    tdint.run_many([content, model, "a.yaml", Path("a.yaml")], [record, "a.mseed", Trace()], scales=[1, 2])
    for given in (content, model, "a.yaml", Path("a.yaml"), io.StringIO("")):
        tdint.modes(given)
    response: tdint.Response = tdint.run(content, "a.mseed", method="impulse4", check=True)
    response.stories.peak_drift.max()
    of_methods: tdint.ResultList[tdint.Response] = tdint.run(model, record, method=["hht", "impulse4"])
    of_steps: tdint.ResultList[tdint.Response] = tdint.run(model, record, dt=[0.01, 0.02])
    of_both: tdint.ResultList[tdint.Runs] = tdint.run_many(model, [record], method=("hht",), dt=periods)
    of_many: tdint.Runs = tdint.run_many(
        [model, model], [record], history=["drift"], vary={"damping": [0.02, 0.05], "mass_factor": 1.0}
    )
    derivatives: tdint.Gradient | None = tdint.run(model, record, gradient=["damping"]).gradient
    history: tdint.History | None = response.history
    print(of_methods[0].dt, of_steps[0].steps, of_both[0].status, of_many.scale, derivatives, history)
    case: tdint.Case = tdint.prepare(content, Trace())
    tdint.run_case(case.scaled(2.0), tolerance="1%")
    whole: tdint.ResponseWithHistory = tdint.run(model, record, history=True)
    print(whole.history.drift.max(), tdint.run_case(case, history=True).history.time[-1])
    after: tdint.Response = tdint.run(model, record, initial=whole.final_state)
    stepper = tdint.Stepper(content, "impulse4", 0.01)
    stepper.step(0.1, [1e3])
    stepper.step(np.array([0.1]), np.zeros(1))
    stepper.copy().reset()
    state: tdint.RunState = stepper.state
    particle: tdint.RunState = state.replace([1e-3], velocity=state.velocity, laws=state.laws.copy())
    copy.copy(stepper).reset(particle)
    copy.deepcopy(stepper).step(0.1)
    other: tdint.Stepper = pickle.loads(pickle.dumps(stepper))
    print(other.time, tdint.run(model, initial=particle, duration=1.0).steps)
    if of_many.devices and derivatives and derivatives.devices and derivatives.devices.errors:
        strokes = of_many.devices.peak_drift, of_many.history["device_drift"]
        print(strokes, derivatives.devices.errors.peak_shear, of_many.gradient and of_many.gradient.devices)
    print(state.velocity[0], state.history.energy.kinetic, after.final_state.time)
    tdint.run_sequence(case, [record, record], rest=1.0)
    print(tdint.run_sequence(case, [record], history=True, rest=1.0).history.drift)
    tdint.pushover(content, "2%").to_dict("kip,in,g")
    tdint.target_displacements(tdint.pushover(model, 0.02), "ec8:ag=0.3,soil=B")
    tdint.cyclic_test(content, 1, ["1%", 0.02]), tdint.law_path(content, 1, [0.0, 0.01]).path.shear.max()
    tdint.run(model, record, method=["hht"], dt=[0.01]).to_pandas()
    print(tdint.matrices(model).state_space().a, tdint.transfer_function(model, source="roof").maxima)
    tdint.response_spectrum_analysis(model, "ec8:ag=0.3,soil=B")
    tdint.matrices(model)
    transfer: tdint.TransferFunction = tdint.transfer_function(model, source=1)
    print(transfer.maxima)
    tdint.compare(content, "event.yaml", method="impulse4")
    tdint.check("a.yaml").to_dict()
    tdint.compile_model(content, "impulse4")
    text: str = tdint.model_template(3, period=0.4)
    for building in tdint.inventory(Path("a.csv"), units="ft"):
        print(building, text)


def motions() -> None:
    curve: tdint.Spectrum = tdint.spectrum(record, [0.1, 1])
    curves: tdint.ResultList[tdint.Spectrum] = tdint.spectrum([record, "b.mseed"], list(periods), "5%")
    dampings: tdint.ResultList[tdint.Spectrum] = tdint.spectrum(record, [0.1, 1], damping=[0.02, 0.05])
    target: tdint.TargetSpectrum = tdint.design_spectrum("ec8:type=1,soil=B,ag=0.25g")
    value: float = tdint.intensity((record, "b.mseed"), "sa(1.0)", pairs="rotd50")
    print(dampings[0].psa, target.at([0.1]), value)
    for one in curves:
        print(one.psa + curve.psa)
    tdint.drift_spectrum(record, (0.5, 1.0), height_period=tdint.HeightPeriod())
    pair: tdint.Horizontals = tdint.read_horizontals("a.mseed", units="g", layout=tdint.TextLayout())
    tdint.process(tdint.read_record(Path("a.mseed")), trim=(0.0, None), pad=10.0)
    tdint.rotated_spectrum(pair, periods, percentiles=[50]), tdint.rotated_spectrum([record, "b.mseed"], periods)
    tdint.constant_ductility("a.mseed", periods, [2.0]), tdint.constant_strength(record, periods, [0.1])
    tdint.drift_spectrum(Trace(), periods)
    tdint.fourier_spectrum("b.mseed"), tdint.fourier_spectrum(record, smoothing=None)
    tdint.floor_spectra(tdint.run(model, record, history=True), ["roof", 1], periods)
    tdint.record_info(Trace())
    figure = tdint.spectrum(record, periods).plot()
    axes = figure.add_subplot()
    tdint.plot(tdint.spectrum(record, periods), ax=axes).set_xlabel("T")
    tdint.plot([tdint.spectrum(record, periods)], file="a.png", width=0.09, title=False).savefig("b.png")
    columns: dict[str, Any] = tdint.to_dict(tdint.spectrum(record, periods), units="g")
    print(columns)


def studies() -> None:
    tdint.campaign(Path("campaign.yaml"), "folder", jobs=2).to_dict()
    tdint.scale([record, (record, "b.mseed")], "pga", 1.0, periods=[0.1, 1.0])
    tdint.select([record, "b.mseed"], "asce7:sds=1,sd1=0.6,tl=8", 1, scatter=0.3).factors.max()
    tdint.match("b.mseed", "asce7:sds=1,sd1=0.6,tl=8", periods=(0.1, 1.0)).record
    tdint.match_suite([record, "b.mseed"], "asce7:sds=1,sd1=0.6,tl=8", periods=(0.1, 1.0))[0].record
    tdint.ida(content, [record, "b.mseed", (record, record)], jobs=2).plot()
    study: tdint.IdaStudy = tdint.ida(
        content, [record], "pgv", tdint.IdaSettings(precision=0.1, thresholds=(0.01,)), folder="folder"
    )
    print(study.curves)
    tdint.fit_stripes(np.array([1.0, 2.0]), np.array([1, 2]), [3, 3])
    tdint.sensitivity(content, [record], {"damping": (0.02, 0.05)})
    tdint.fragility(Path("a.csv"), [0.01, 0.02]).plot()
    tdint.fit_stripes([1.0, 2.0], [1, 2], [3, 3]), tdint.fit_capacities([1.0, 2.0], [False, True])
    tdint.fit_cloud(np.ones(3), np.ones(3), [0.01])


def methods() -> None:
    for method in tdint.methods(["impulse4"]):
        tdint.stability(method, np.array([0.1])), tdint.overshoot(method), tdint.order(method)
    tdint.stability(method="hht", dt_over_t=np.array([0.1])), tdint.overshoot(method="hht"), tdint.order(method="hht")
    many: tdint.ResultList[tdint.StabilityCurve] = tdint.stability(["hht", "impulse4"], [0.1, 0.2])
    tdint.order(["hht", "impulse4"]).to_dict(), tdint.overshoot(tdint.methods()).plot()
    print(many[0].spectral_radius)
    for trial in tdint.failures("hht", ["large-step"]):
        print(trial)
    tdint.paper_examples([1], ["wilson"], dt=0.02).to_dict()
    tdint.chart(content, "a.mseed", method=["impulse4"]).plot()
    tdint.performance_profiles([content], ["a.mseed"], method=["impulse4"], repeats=1).plot()
    for result in tdint.validate():
        print(result)
    tdint.load_plugin(Path("mine.py"))
    try:
        runs: tdint.Runs = tdint.run_many(model, record)
        runs.stories.peak_drift.max()
    except tdint.FailedRun as failure:
        print(failure.status)
    except tdint.TdintError as error:
        print(error)


PLUGIN_NAMES
TYPE_NAMES

tdint.nothing
'''  # noqa: E501


def test_public_names_do_not_shadow_builtins():
    everything: dict[str, object] = {}
    exec("from tdint import *", everything)
    names = set(everything) - {"__builtins__"}
    assert names == set(tdint.__all__) and not names & set(dir(builtins))
    assert issubclass(tdint.FailedRun, tdint.TdintError)
    assert isinstance(tdint.make_record([0.0, 1.0], dt=0.01, units="g"), tdint.Record)
    with pytest.raises(AttributeError, match="no attribute 'init'"):
        tdint.init  # noqa: B018


@pytest.mark.parametrize("file", ["__init__.pyi", "plugin.pyi"])
def test_names_of_stub_are_sorted_and_public_for_type_checkers(file):
    """Type checkers treat only `import NAME as NAME` and assignments as public."""
    text = Path(tdint.__file__).with_name(file).read_text(encoding="utf-8")
    _, imports, assignments = text.split("\n\n")
    lines = imports.splitlines()
    assert lines == sorted(lines)
    renamed = dict(line.split(" = ") for line in assignments.splitlines())
    for line in lines:
        module, names = line.removeprefix("from ").split(" import ")
        name, _, alias = names.partition(" as ")
        assert alias == name or (not alias and name in renamed.values())
        defined = import_module(module)
        assert hasattr(defined, name)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_public_functions_document_parameters_returns_and_errors(name):
    function = inspect.unwrap(getattr(tdint, name))
    signature = inspect.signature(function)
    if not inspect.isfunction(function):  # a loaded package has a docstring of its own
        function = getattr(import_module(PUBLIC[name]), DEFINED_AS.get(name, name))
    text = inspect.getdoc(function)
    sections = [
        title
        for title in ("Parameters", "Returns", "Raises")
        if f"{title}\n{'-' * len(title)}\n" in text
    ]
    expected = ["Parameters"] * bool(signature.parameters) + ["Returns", "Raises"]
    assert sections == expected
    section = text.partition("Parameters\n")[2].partition("Returns\n")[0]
    heads = [line for line in section.splitlines()[1:] if line and not line.startswith(" ")]
    described = {
        parameter_name.strip(" *")
        for line in heads
        for parameter_name in line.partition(" : ")[0].split(",")
    }
    assert described == set(signature.parameters)
    assert all(
        parameter.annotation is not parameter.empty for parameter in signature.parameters.values()
    )
    assert signature.return_annotation not in (signature.empty, "Any")


@pytest.mark.parametrize("name", ["methods"])
def test_help_of_callable_package_shows_parameters(name):
    import_module(f"tdint.{name}")
    text = pydoc.render_doc(getattr(tdint, name), renderer=pydoc.plaintext)
    function = tdint.__getattr__(name)
    assert "Parameters" in text and inspect.getdoc(function).splitlines()[0] in text
    assert all(parameter in text for parameter in inspect.signature(function).parameters)


def test_help_of_plugin_interface_shows_functions():
    text = pydoc.render_doc(tdint.plugin, renderer=pydoc.plaintext)
    for name in ("accumulate_dissipation", "hysteretic_energy", "resume", "solve_blocks_damped"):
        assert f"\n    {name}(" in text and inspect.getdoc(getattr(tdint.plugin, name)) is not None
    assert "import_module" not in text


PUBLIC_OBJECTS = {
    f"{module.__name__}.{name}": getattr(module, name)
    for module in (tdint, tdint.plugin)
    for name in module.__all__
}
CLASSES = {name: value for name, value in PUBLIC_OBJECTS.items() if inspect.isclass(value)}


def documented(text, section):
    """Return the names in a section of a docstring."""
    found = re.search(
        rf"^{section}\n-+\n(.*?)(?=^\w[\w ]*\n-+\n|\Z)", text, re.MULTILINE | re.DOTALL
    )
    lines = found[1].splitlines() if found else ()
    heads = [line for line in lines if re.match(r"[\w*, ]+( : |$)", line) and line[0] != " "]
    return [name.strip(" *") for head in heads for name in head.partition(" : ")[0].split(",")]


def fields_of(public_class):
    """Return the names of the public fields of a dataclass or of a named tuple."""
    if dataclasses.is_dataclass(public_class):
        names = [field.name for field in dataclasses.fields(public_class)]
    else:
        names = list(getattr(public_class, "_fields", ()))
    return [name for name in names if not name.startswith("_")]


def members_of(public_class):
    """Return the public methods and properties of a class by name."""
    return {
        member: getattr(public_class, member)
        for base in public_class.__mro__
        if base.__module__.startswith("tdint")
        for member, value in vars(base).items()
        if not member.startswith("_")
        and member not in (*fields_of(public_class), "tables", "figures")  # described in `Tabular`
        and (inspect.isroutine(value) or isinstance(value, property | functools.cached_property))
    }


@pytest.mark.parametrize("name", every(4, CLASSES))
def test_public_classes_document_fields_and_members(name):
    """Each field is in the section of attributes, and each attribute there exists. Derivatives and
    errors have the names of the peaks. No docstring refers to a private name."""
    public_class = CLASSES[name]
    members, fields = members_of(public_class), fields_of(public_class)
    texts = {member: inspect.getdoc(value) for member, value in members.items()}
    assert inspect.getdoc(public_class) and not [
        member for member, text in texts.items() if not text
    ]
    attributes = documented(inspect.getdoc(public_class), "Attributes")
    peaks = fields_of(StoryValues) if "`StoryPeaks`" in inspect.getdoc(public_class) else []
    assert [field for field in fields if field not in (*attributes, *peaks)] == []
    unknown = [
        member_name
        for member_name in attributes
        if member_name not in (*fields, *members, *vars(public_class))
    ]
    source = inspect.getsource(public_class)
    assert [member_name for member_name in unknown if f"self.{member_name} =" not in source] == []
    private = [
        text
        for text in (inspect.getdoc(public_class), *texts.values())
        if re.search(r"`(\w+\.)*_[a-z]\w*`", text)
    ]
    assert private == []


@pytest.mark.parametrize(
    "name", every(4, [name for name in PUBLIC_OBJECTS if name not in FUNCTIONS_OF_TDINT])
)
def test_documented_parameters_agree_with_signature(name):
    """The test covers functions of `tdint.plugin` and methods of public classes."""
    value = PUBLIC_OBJECTS[name]
    functions = members_of(value) if inspect.isclass(value) else {name: value}
    for called, function in functions.items():
        if inspect.isfunction(function) or inspect.ismethod(function):
            parameters = inspect.signature(function).parameters
            names = [parameter for parameter in parameters if parameter != "self"]
            assert documented(inspect.getdoc(function), "Parameters") == names, called


def program() -> str:
    """Return the program with each plug-in name imported and each public class annotated."""
    classes = [name for name in tdint.__all__ if inspect.isclass(getattr(tdint, name))]
    plugin = ", ".join(dir(tdint.plugin))
    types = "\n".join(
        f"    of_{name}: Any | tdint.{name}{'[Any]' * (name == 'ResultList')}" for name in classes
    )
    return PROGRAM.replace(
        "PLUGIN_NAMES", f"from tdint.plugin import {plugin}\nfrom tdint.plugin import no_such_name"
    ).replace("TYPE_NAMES", f"class Annotated:\n{types}")


def faults_of_program(tmp_path, *command):
    """Run a type checker on the program, and return the lines of its report about the program."""
    file = tmp_path / "program.py"
    file.write_text(program(), encoding="utf-8")
    source = Path(tdint.__file__).parents[1]
    (tmp_path / "pyrightconfig.json").write_text(
        json.dumps({"extraPaths": [str(source)], "typeCheckingMode": "standard"})
    )
    # mypy finds an installed package, and rejects its directory in MYPYPATH.
    search_path = {} if source.name == "site-packages" else {"MYPYPATH": str(source)}
    checked = subprocess.run(
        [*command, str(file)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, **search_path},
    )
    lines = [line.strip() for line in checked.stdout.splitlines()]
    return [
        line for line in lines if "program.py:" in line and "error" in line
    ], checked.stdout + checked.stderr


@pytest.mark.slow
def test_mypy_accepts_program_of_all_public_names(tmp_path):
    """The only two errors are names that do not exist."""
    pytest.importorskip("mypy")
    tree = ast.parse(program())
    named = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    assert set(tdint.__all__) - {"__version__"} <= named
    command = [
        sys.executable, "-m", "mypy", "--strict", f"--cache-dir={tmp_path}", "--config-file=",
    ]  # fmt: skip
    faults, output = faults_of_program(tmp_path, *command)
    assert len(faults) == 2, output
    assert 'has no attribute "no_such_name"' in faults[0], output
    assert 'Module has no attribute "nothing"' in faults[1], output


@pytest.mark.slow
def test_pyright_accepts_program_of_all_public_names(tmp_path):
    """basedpyright is pyright with its node as a wheel, so that it can be installed from PyPI
    alone."""
    checker = pytest.importorskip("basedpyright").__file__
    faults, output = faults_of_program(tmp_path, sys.executable, "-m", "basedpyright")
    assert checker and len(faults) == 2, output
    assert '"no_such_name" is unknown import symbol' in faults[0], output
    assert '"nothing" is not a known attribute' in faults[1], output
