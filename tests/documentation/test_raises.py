"""Each exception of a public function is in the section Raises of its docstring: by wrong calls."""

import inspect
import re
from functools import cache

import pytest
from numpy import array, nan

import tdint
from readmes import ROOT

CALLS = """\
spectrum(R, T)
spectrum(REC, -T)
spectrum(REC, T, damping=-1)
spectrum(REC, T, method="nix")
rotated_spectrum([R, R], T)
rotated_spectrum(PAIR, T, percentiles=[-1])
rotated_spectrum([REC, REC.scaled(1.0)], T)
constant_ductility(R, T, [2.0])
constant_ductility(REC, T, [0.5])
constant_strength(R, T, [0.2])
constant_strength(REC, T, [-0.2])
drift_spectrum(R, T)
drift_spectrum(REC, -T)
fourier_spectrum(R)
fourier_spectrum(REC, 0.1)
record_info(R)
run(M)
run(BAD)
run(OK, R)
run(OK, REC, method="nix")
run(OK, REC, dt=-1.0)
run(OK, REC, tolerance=2.0)
run(OK, REC, method="central-difference", dt=0.5)
run(OK, REC, gradient="nix")
run(UNSTABLE, REC)
run_case(CASE, dt=-1.0)
run_case(3)
run_case(CASE, dt=0.003)
run_many(M, REC)
run_many(OK, R)
run_many(OK, REC, method="nix")
run_many(OK, REC, vary={"nix": [1.0]})
run_many(OK, REC, scales=[0.0])
run_many(OK, REC, method="exact")
run_many(OK, REC, dt=0.003)
run_sequence(CASE, [])
run_sequence(CASE, [REC], dt=-1.0)
run_sequence(CASE, [R])
prepare(M)
prepare(OK, R)
prepare(OK, REC, method="nix")
modes(M)
modes(BAD)
modes(UNSTABLE)
matrices(M)
matrices(UNSTABLE)
matrices("fluid-dampers.yaml")
transfer_function(M)
transfer_function(OK, source=99)
transfer_function(OK, array([-1.0]))
transfer_function("fluid-dampers.yaml")
transfer_function("two-directions.yaml")
response_spectrum_analysis(M, EC8)
response_spectrum_analysis(OK, "nix")
response_spectrum_analysis(OK, "nix.csv")
pushover(M, "2%")
pushover(OK, "4dy")
pushover(OK, "2%", pattern="nix")
pushover("frame-matrix.yaml", "2%")
cyclic_test(M, 1, ["1%"])
cyclic_test(OK, 99, ["1%"])
cyclic_test(OK, 1, ["1%"], points=10**9)
target_displacements(CURVE, EC8)
target_displacements(CURVE, "nix")
target_displacements(CURVE, "nix.csv")
floor_spectra(RESPONSE, [1], T)
floor_spectra(run(OK, REC, check=False, history=True), [99], T)
stability("nix", T)
stability("impulse4", -T)
overshoot("nix")
overshoot("exact", law="hardening")
order("nix")
order("exact", law="hardening")
order("impulse4", load="nix")
failures("nix")
failures("impulse4", ["nix"])
methods("nix")
load_model(M)
load_model(BAD)
load_plugin("nix.py")
check(M)
check(UNSTABLE)
check(WITHOUT_RECORD)
read_record(R)
read_record(MSEED, units="m/s^2")
read_record(MSEED, units="nix", component="HN1")
read_horizontals(R)
read_horizontals(MSEED, "records/soft-soil.mseed", units="m/s^2")
make_record([1.0, 2.0])
make_record([1.0], dt=0.01, units="g")
make_record([1.0, nan], dt=0.01, units="g")
process(REC, trim=(100.0, 200.0))
process(REC, baseline="nix")
process(R)
scale([R], "pga", 1.0)
scale([REC], "nix", 1.0)
scale([REC], "pga", -1.0)
scale([REC], target="nix.csv")
scale([], "pga", 1.0)
scale([REC], "sa(0.0001)", 1.0)
select([REC], EC8, 5)
select([R], EC8, 1)
select([REC], "nix.csv", 1)
match(R, EC8)
match(REC, "nix.csv")
match(REC, EC8, periods=(3.0, 1.0))
match(REC, EC8, periods=(0.0001, 1.0))
match_suite([], EC8)
ida(M, [REC])
ida({"stories": [{"mass": 1e5, "stiffness": 4e7}]}, [REC])
ida(OK, [REC, REC])
ida(OK, [R])
ida(OK, [])
sensitivity(M, REC, {"damping": (0.02, 0.05)})
sensitivity(OK, R, {"damping": (0.02, 0.05)})
sensitivity(OK, REC, {"nix": (0.02, 0.05)})
fit_capacities([1.0])
fit_capacities([-1.0, 2.0])
fit_stripes([1.0], [1], [2])
fit_stripes([1.0, 2.0], [1], [2])
fit_cloud([1.0, 2.0, 3.0], [3.0, 2.0, 1.0], [1.0])
fragility("nix.csv")
fragility("stripes.csv", fit="cloud")
inventory("nix.csv")
inventory("buildings.csv", units="nix")
inventory("buildings.csv", units="ft", rules="nix")
inventory("buildings.csv", units="ft", rules="capacity")
campaign("nix.yaml")
compare(M, "nix.yaml")
compare(OK, "nix.yaml")
compare("ten-story.yaml", "nix.yaml", method="impulse4")
chart(M)
chart(OK, R)
chart(OK, REC, method="nix")
compile_model(M)
compile_model(OK, "nix")
model_template(0)
model_template(3, units="nix")
paper_examples([9])
paper_examples([1], "nix")
plot(3)
plot(REC, units="nix")
plot(REC, file="a.xyz")
plot(RESPONSE, width=0.001)
to_dict(3)
to_dict(REC, "nix")
Stepper(M, "impulse4", 0.01)
Stepper(OK, "nix", 0.01)
Stepper(OK, "impulse4", -0.01)
Stepper(OK, "exact", 0.01)
Stepper("two-directions.yaml", "impulse4", 0.01)
Stepper("frame-matrix.yaml", "impulse4", 0.01)
design_spectrum("nix")
design_spectrum("nix.csv")
design_spectrum("ec8:ag=-1")
intensity(REC, "nix")
intensity(R, "pga")
intensity(REC, "sa(0.0001)")
intensity(REC, "sa(-1)")
law_path(OK, 99, [0.01])
law_path(OK, 1, [nan])
law_path(M, 1, [0.01])
performance_profiles()
performance_profiles([M], [REC])
performance_profiles(problems="nix.csv")
performance_profiles(models=[OK], records=[REC], method="nix")
"""
"""Wrong calls, each of which raises an exception: missing files, invalid models, unknown names,
values out of range. Capital letters are the names of `names`."""


@cache
def names():
    """Return the names in the calls: public names of tdint, a model, a motion and some results."""
    model, motion = "ten-story-bilinear.yaml", str(ROOT / "records/near-fault.mseed")
    record = tdint.read_record(motion, component="HN1", units="m/s^2")
    record = tdint.process(record, trim=(0.0, 6.0))
    stories = [{"repeat": 3, "mass": 1e5, "height": 3.5, "stiffness": 6e7}]
    return {name: getattr(tdint, name) for name in tdint.__all__} | {
        "M": "no-such-model.yaml", "R": "no-such-record.at2", "OK": model, "MSEED": motion,
        "REC": record, "EC8": "ec8:type=1,soil=B,ag=0.25g", "T": array([0.5, 1.0]),
        "PAIR": tdint.read_horizontals(motion, units="m/s^2"), "array": array, "nan": nan,
        "BAD": {"stories": [{"mass": -1.0, "stiffness": 1.0}]},
        "UNSTABLE": {"p_delta": True, "stories": [{"mass": 1e6, "height": 3.0, "stiffness": 1e6}]},
        "CASE": tdint.prepare({"stories": stories}, record),
        "WITHOUT_RECORD": {"stories": stories, "excitation": {"record": {"file": "no.at2"}}},
        "CURVE": tdint.pushover({"stories": stories}, 1e-3, points=10),
        "RESPONSE": tdint.run({"stories": stories}, record, check=False),
    }  # fmt: skip


def documented(name):
    """Return the exceptions in the section Raises of a public name, and those of other functions
    that it refers to."""
    text = inspect.getdoc(getattr(tdint, name)).partition("Raises\n------\n")[2]
    section = re.split(r"\n\n[A-Z]\w+\n-+", text)[0]
    heads = [line for line in section.splitlines() if not line.startswith(" ")]
    found = set(re.findall(r"\w+(?:Error|Run)\b", " ".join(heads)))
    for other in re.findall(r"(?:[Aa]s by|[Aa]s in|[Ss]ame as for) `(?:tdint\.)?(\w+)`", section):
        found |= documented(other) if hasattr(tdint, other) else set()
    return found


def undocumented(call):
    """Return what is wrong with a call; None if it raises a documented exception of tdint."""
    name = call.partition("(")[0]
    try:
        eval(call, names().copy())
    except tdint.TdintError as error:
        kinds = {kind.__name__ for kind in type(error).__mro__}
        if kinds & (documented(name) - {"TdintError"}):
            return None
        return f"{call} raises {type(error).__name__}: {error}"
    return f"{call} raises nothing"


@pytest.mark.filterwarnings("ignore")
def test_exceptions_of_wrong_calls_are_documented(monkeypatch):
    monkeypatch.chdir(ROOT / "configs")
    assert list(filter(None, map(undocumented, CALLS.splitlines()))) == []


def test_every_function_with_arguments_has_a_wrong_call():
    called = set(re.findall(r"^\w+", CALLS, re.MULTILINE))
    functions = {
        name
        for name in tdint.__all__
        if name[0].islower() and inspect.isfunction(inspect.unwrap(getattr(tdint, name)))
    }
    assert functions - called == {"validate"}  # no arguments


def test_an_undocumented_exception_is_found(monkeypatch):
    monkeypatch.setattr(tdint.spectrum, "__doc__", "Spectrum.\n\nRaises\n------\nUsageError\n")
    assert "raises RecordError" in undocumented('spectrum("no-such-record.at2", [0.5])')
