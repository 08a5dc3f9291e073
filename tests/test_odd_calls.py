"""Public functions with invalid arguments: each call raises a TdintError or returns a result."""

import inspect
import math
import warnings
from pathlib import Path

import numpy as np
import pytest

import tdint
from selection import every
from tdint.errors import TdintError
from tdint.studies.fragility.fits import fit_cloud
from tdint.studies.store.schema import refuse_network

ODD = (
    None, "", "no such thing", -1, float("nan"), 1e400, [], {}, {"a": None}, object(), b"x",
    np.empty(0), np.ones((2, 2)),
)  # fmt: skip
FUNCTIONS = {
    name: function
    for name in tdint.__all__
    if inspect.isfunction(function := getattr(tdint, name)) and not name.startswith("_")
}


def required(function):
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    parameters = inspect.signature(function).parameters.values()
    return sum(
        parameter.default is parameter.empty and parameter.kind in positional
        for parameter in parameters
    )


CLOUD = (np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 2.1, 2.9, 4.2]), [2.0])
MOTION = tdint.Record(np.sin(np.arange(50.0)), 0.02, "", "", "", "sine")
MASKED = np.ma.array([0.1, 0.2], mask=[True, False])
STORY = {"stories": [{"mass": 1e3, "stiffness": 1e6}]}


def invalid_call(call, *values):
    """Return a test parameter with a call for each of the values."""
    return [pytest.param(lambda value=value: call(value), id=repr(value)[:9]) for value in values]


@pytest.mark.parametrize(
    "call",
    [
        *invalid_call(
            lambda r: tdint.order("newmark-average", frequency_ratio=r),
            math.nan,
            math.inf,
            1e6,
            "x",
        ),
        *invalid_call(lambda s: tdint.order("newmark-average", load="record", stride=s), 1.5),
        *invalid_call(lambda d: tdint.overshoot("newmark-average", damping=d), math.nan, -1, "x"),
        *invalid_call(
            lambda h: tdint.overshoot("newmark-average", dt_over_t=h),
            -1,
            0.0,
            math.nan,
            math.inf,
            "x",
        ),
        *invalid_call(lambda n: tdint.overshoot("newmark-average", steps=n), 0),
        *invalid_call(lambda d: tdint.stability("hht", [0.1], damping=d), -1, math.nan, "x"),
        *invalid_call(
            lambda h: tdint.stability("hht", h), [], [-1.0], [math.nan], [1.0, 0.1], ["x"]
        ),
        *invalid_call(lambda x: fit_cloud(*CLOUD, dispersion=x), math.nan, "x"),
        *invalid_call(lambda b: tdint.fragility("x.csv", modeling_dispersion=b), "x", -1, math.nan),
        *invalid_call(lambda x: tdint.run_many(STORY, None, vary={"damping": x}), MASKED),
        *invalid_call(lambda x: tdint.load_model(STORY).replace(damping=x), 10**400),
        *invalid_call(lambda x: tdint.constant_ductility(MOTION, [1.0], x), 2.0, None, ["x"]),
        *invalid_call(lambda x: tdint.constant_strength(MOTION, [1.0], x), 0.2, None, ["x"]),
        *invalid_call(lambda x: tdint.drift_spectrum(MOTION, [1.0], height_period=x), 0.05, (1, 2)),
        *invalid_call(lambda name: refuse_network(Path(name)), "\0"),
    ],
)
def test_numbers_out_of_range_are_refused(call):
    """The values are refused before any computation."""
    with pytest.raises(TdintError, match=r"must be|stride|null"):
        call()


@pytest.mark.parametrize(
    "name", every(3, [name for name, function in FUNCTIONS.items() if required(function)])
)
def test_arguments_of_wrong_types_are_refused(name, tmp_path, monkeypatch):
    """All arguments have the same unusual value, or two different unusual values."""
    monkeypatch.chdir(tmp_path)
    function = FUNCTIONS[name]
    count = required(function)
    refused = 0
    for first in ODD:
        for other in (first, ODD[4]) if count > 1 else (first,):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    function(first, *[other] * (count - 1))
            except TdintError as error:
                assert str(error)
                refused += 1
    assert refused
    assert list(tmp_path.iterdir()) == []  # no file is written


@pytest.mark.parametrize("method", [lambda: "impulse4", 1, None, object()])
def test_invalid_methods_are_refused(method):
    """The arguments are refused because of their type, not because of a missing attribute."""
    for function in (tdint.order, tdint.overshoot):
        with pytest.raises(TdintError, match="method"):
            function(method)
