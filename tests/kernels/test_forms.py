"""Every form of the time loops that a user can get gives the results of the interpreted loops.

The building selects the form of the kernels: PLAIN without optional features, otherwise FULL. A run
of a user is one of these:

    compiled    the form is loaded from its object, as all commands do
    first run   interpreted through memory views, while the objects are compiled

With TDINT_KERNELS=python nothing is compiled. A third way then shows a wrong constant of a form:

    own         the functions that the compiler would see, in plain Python: each kernel is executed
                from a copy of the modules that was imported for the form (TDINT_KERNELS_FORM)

`feature_buildings.py` has a building for each feature and for each pair of features. `function_of`
is the only part of this file that knows how a form is executed.
"""

import importlib
import os
import sys
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import tdint
from building_cases import noise
from feature_buildings import CASES, building, two_stories
from registered import forget
from selection import every
from small_buildings import LAWS, STRENGTH
from tdint.kernels.building.load_or_compile import _python_function, as_views
from tdint.methods.catalogue import parse
from tdint.response.runs.compiled_steps import kernels
from tdint.response.runs.prepared import PreparedBuilding

FORMS = ("first run", "own" if os.environ.get("TDINT_KERNELS") == "python" else "compiled")
METHODS = ("impulse4", "moment4", "newmark-average", "gauss4")
MOTION = noise(samples=31, dt=0.02, peak=12.0)
PACKAGES = ("tdint.kernels", "tdint.methods")


@cache
def own_function(form, module, name):
    """Return the Python function of a kernel from modules that were imported for a form.

    The modules of the process are restored at the end.
    """
    own = {key: value for key, value in sys.modules.items() if key.startswith(PACKAGES)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TDINT_KERNELS_FORM", form)
        for package in ("kernels", "methods"):
            patch.setattr(tdint, package, getattr(tdint, package))
        for key in own:
            del sys.modules[key]
        sys.modules.update(_copies.get(form, {}))
        try:
            return getattr(importlib.import_module(module), name).function
        finally:
            copies = [key for key in sys.modules if key.startswith(PACKAGES)]
            _copies[form] = {key: sys.modules.pop(key) for key in copies}
            sys.modules.update(own)


_copies = {}
"""Modules by form."""


def function_of(way, kernel, variant):
    """Return the function of a kernel for a building, executed in a way."""
    if way == "first run":
        return as_views(kernel.function, kernel.form(variant))
    if way == "own":
        names = kernel.function.__module__, kernel.function.__name__
        return _python_function(own_function(variant.form, *names))
    return _python_function(kernel.function)


def results(model, method, way):
    """Return the arrays of a run in a way, by name."""
    with pytest.MonkeyPatch.context() as patch:
        variant = PreparedBuilding.of(tdint.load_model(model)).variant
        for kernel, required in kernels(parse(method), variant):
            patch.setattr(kernel, "_last", None)
            if way != "compiled":
                function = function_of(way, kernel, required)
                patch.setattr(kernel, "_loaded", {kernel.form(required): function})
        run = tdint.run(model, MOTION, method=method, history=True, check=False)
    arrays = {"iterations": np.array([run.iterations], float)}
    for part in ("stories", "elements", "devices", "history", "energy"):
        collect(arrays, part, getattr(run, part, None))
    return arrays


def collect(arrays, name, value):
    """Add the arrays and numbers of a result with its parts to `arrays`."""
    if isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype == float):
        arrays[name] = np.atleast_1d(value)
    elif is_dataclass(value):
        for field in fields(value):
            collect(arrays, f"{name}.{field.name}", getattr(value, field.name))
    elif hasattr(value, "_asdict"):
        for key, part in value._asdict().items():
            collect(arrays, f"{name}.{key}", part)


def assert_equal(found, expected, form):
    """Compare the arrays of two runs, relative to the largest number of each array. The error of
    the energy balance, a fraction that consists of rounding errors, is compared relative to 1. By
    rounding, a few steps may end an iteration earlier or later; another path of the loops showed in
    5 % more iterations."""
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        smallest = 1.0 if name.endswith("energy.error") else 0.0
        scale = np.max(np.abs(values), initial=smallest, where=np.isfinite(values))
        rtol = 0.04 if name == "iterations" else 1e-9
        np.testing.assert_allclose(
            found[name], values, rtol=rtol, atol=1e-9 * scale, err_msg=f"{form}: {name}"
        )


EXPECTED = "interpreted" if "own" in FORMS else "first run"
"""Way with which the forms are compared. The compiled loops are compared with the first run, which
is interpreted, too. The interpreted loops with arrays take half of the time of all ways, and
`test_arrays` compares them for each method."""


def compare_forms(model, method, expected_way=EXPECTED):
    """Compare all forms of a run with the interpreted loops."""
    expected = results(model, method, expected_way)
    assert expected["stories.peak_drift"].min() > 0.0
    for form in FORMS:
        if form != expected_way:
            assert_equal(results(model, method, form), expected, form)


def methods_of(features):
    """Return the methods that support the features: only two methods have attachments or links
    together with dampers with a brace or tangent damping. A contact is a link with both."""
    is_tree = {"attachments", "links", "contact"} & {*features}
    is_braced = {"brace", "power-brace", "relief", "tangent", "contact"} & {*features}
    return METHODS[:2] if is_tree and is_braced else METHODS


SINGLE = [(case, method) for case in CASES if len(case) == 1 for method in methods_of(case)]
PAIRS = [
    (case, methods[i % len(methods)])
    for i, case in enumerate(case for case in CASES if len(case) == 2)
    for methods in [methods_of(case)]
]
OTHERS = [
    (case, method)
    for case in CASES
    for method in methods_of(case)
    if (case, method) not in {*SINGLE, *PAIRS}
]
FEATURES = [*SINGLE, *every(2, PAIRS), *every(10_000, [SINGLE[0], *OTHERS])[1:]]
"""A feature by itself with all methods, and a pair of features with one method in turn; the long
tests are the other methods of a pair."""


@pytest.mark.parametrize(("features", "method"), FEATURES, ids=str)
def test_features(features, method):
    compare_forms(building(features), method)


@pytest.mark.parametrize("method", METHODS)
def test_arrays(method):
    for model in (two_stories(None, "bilinear"), building(("attachments",))):
        compare_forms(model, method, "interpreted")


@pytest.mark.parametrize(
    ("restitution", "method"), [(0.6, "impulse4"), (1.0, "moment4"), (1.0, "newmark-average")]
)
def test_contact_of_hertz(restitution, method):
    model = building(("contact",))
    law = model["links"][-1]["law"]
    del law["dashpot"]
    law.update(type="hertz", restitution=restitution)
    law["stop_stiffness"] /= law["gap"] ** 0.5
    compare_forms(model, method)


@pytest.mark.parametrize(
    ("law", "method"), every(2, [(law, method) for law in [None, *LAWS] for method in METHODS])
)
def test_laws(law, method):
    compare_forms(two_stories(law, law), method)


PLUGIN_LAWS = {
    "flag": {"type": "flag", "yield_force": 0.6 * STRENGTH, "hardening": 0.05, "loss": 0.6},
    "menegotto_pinto": {"type": "menegotto-pinto", "yield_force": STRENGTH, "hardening": 0.03},
}
"""Laws of plug-ins by the name of their file: with lines, and with curves from a reversal."""


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", PLUGIN_LAWS)
def test_laws_of_plugins(request, name, method):
    request.addfinalizer(forget)
    tdint.load_plugin(Path(__file__).parents[1] / f"methods/recipes/{name}.py")
    model = two_stories(None, "bilinear")
    model["stories"][0]["law"] = PLUGIN_LAWS[name]
    compare_forms(model, method)
    compare_forms({**model, "damping": {"modal": 0.03}}, method)
