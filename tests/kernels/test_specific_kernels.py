"""The kernels of a form give the results of the kernels with all features.

Here the functions of a form are executed in plain Python: each kernel from a copy of the modules
that was imported for its form (TDINT_KERNELS_FORM).
"""

import importlib
import sys
from functools import cache

import numpy as np
import pytest

import tdint
from small_buildings import LAWS, MASS, MOTION, STIFFNESS
from tdint.kernels.building.load_or_compile import _python_function
from tdint.methods.catalogue import parse
from tdint.response.runs.compiled_steps import kernels
from tdint.response.runs.prepared import PreparedBuilding

PACKAGES = ("tdint.kernels", "tdint.methods")
BRACED = {"dashpot": {"coefficient": 1e6, "brace": 2.0 * STIFFNESS}}
POWER = {"dashpot": {"coefficient": 2e5, "exponent": 0.5, "linear_below": 0.01}}
TANGENT = {"damping": {"rayleigh": {"ratio": 0.03, "modes": [1, 2], "tangent": True}}}
MODAL = {"damping": {"modal": 0.03}}
ATTACHED = {
    "attachments": [{"name": "t", "floor": 1, "mass": 0.05 * MASS, "stiffness": 0.05 * STIFFNESS}]
}
CASES = {
    "plain": ({}, {}),
    "braces": (BRACED, {}),
    "power": (POWER, {}),
    "modal-attachment": ({}, {**MODAL, **ATTACHED}),
}


def building(law, of_story, of_model):
    """Return two stories with a law; the first story has the keys `of_story` as well."""
    common = {"height": 3.0, "stiffness": STIFFNESS, **({"law": LAWS[law]} if law else {})}
    return {
        "stories": [{"mass": MASS, **common, **of_story}, {"mass": 0.8 * MASS, **common}],
        "collapse_drift": 0.9,
        **({} if "damping" in of_model else {"damping": 0.03}),
        **of_model,
    }


@cache
def kernel_of_form(form, module, name):
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


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("law", [None, "bilinear", "bouc-wen"])
def test_specific_kernels_give_the_results_of_kernels_with_all_features(law, case):
    of_story, of_model = CASES[case]
    model = building(law, of_story, of_model)
    variant = PreparedBuilding.of(tdint.load_model(model)).variant
    for method in ("impulse4", "moment4", "newmark-average"):
        peaks = []
        for specific in (False, True):
            for kernel, required in kernels(parse(method), variant):
                function = kernel.function
                if specific:
                    names = function.__module__, function.__name__
                    function = kernel_of_form(required.form, *names)
                kernel._loaded[kernel.form(required)] = _python_function(function)
            stories = tdint.run(model, MOTION, method=method).stories
            peaks.append([stories.peak_drift, stories.peak_total_shear, stories.peak_damper_force])
            for kernel, _ in kernels(parse(method), variant):
                kernel._loaded.clear()
                kernel._last = None
        np.testing.assert_allclose(peaks[1], peaks[0], rtol=1e-7)
