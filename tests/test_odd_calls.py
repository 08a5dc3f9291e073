"""Public functions, called with what no argument can be: each call ends in a TdintError, or in a result."""

import inspect
import math
import warnings
from pathlib import Path

import numpy as np
import pytest

import tdint
from tdint.campaign.fragility.fits import fit_cloud
from tdint.campaign.store_schema import refuse_network
from tdint.errors import TdintError

ODD = (
    None, "", "no such thing", -1, float("nan"), 1e400, [], {}, {"a": None}, object(), b"x", np.empty(0),
    np.ones((2, 2)),
)  # fmt: skip
FUNCTIONS = {
    name: function
    for name in tdint.__all__
    if inspect.isfunction(function := getattr(tdint, name)) and not name.startswith("_")
}


def required(function):
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    parameters = inspect.signature(function).parameters.values()
    return sum(one.default is one.empty and one.kind in kinds for one in parameters)


CLOUD = (np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 2.1, 2.9, 4.2]), [2.0])
MASKED = np.ma.array([0.1, 0.2], mask=[True, False])
STORY = {"stories": [{"mass": 1e3, "stiffness": 1e6}]}
CALLS = {
    **{
        f"order at {r}": lambda r=r: tdint.order("newmark-average", frequency_ratio=r)
        for r in (math.nan, math.inf, 1e6)
    },
    "order of a text": lambda: tdint.order("newmark-average", frequency_ratio="x"),
    "order with half a stride": lambda: tdint.order("newmark-average", load="record", stride=1.5),
    **{f"overshoot damped {d}": lambda d=d: tdint.overshoot("newmark-average", damping=d) for d in (math.nan, -1, "x")},
    **{
        f"overshoot at {h}": lambda h=h: tdint.overshoot("newmark-average", dt_over_t=h)
        for h in (-1, 0.0, math.nan, math.inf, "x")
    },
    "overshoot of no steps": lambda: tdint.overshoot("newmark-average", steps=0),
    **{f"stability damped {d}": lambda d=d: tdint.stability("hht", [0.1], damping=d) for d in (-1, math.nan, "x")},
    **{f"stability at {h}": lambda h=h: tdint.stability("hht", h) for h in ([], [-1.0], [math.nan], [1.0, 0.1], ["x"])},
    "a cloud lighter than nan": lambda: fit_cloud(*CLOUD, lightest=math.nan),
    "a cloud lighter than a text": lambda: fit_cloud(*CLOUD, lightest="x"),
    **{f"fragility of {b}": lambda b=b: tdint.fragility("x.csv", beta_model=b) for b in ("x", -1, math.nan)},
    "masked numbers": lambda: tdint.run_many(STORY, None, vary={"damping": MASKED}),
    "a number beyond floats": lambda: tdint.load_model(STORY).replace(damping=10**400),
    "a folder that can be none": lambda: refuse_network(Path("\0")),
}


@pytest.mark.parametrize("name", CALLS)
def test_numbers_out_of_range_are_refused_in_words(name):
    """At once: none is computed with."""
    with pytest.raises(TdintError, match=r"must be|stride|no null"):
        CALLS[name]()


@pytest.mark.parametrize("name", [name for name, function in FUNCTIONS.items() if required(function)])
def test_odd_arguments_are_refused_in_words(name, tmp_path, monkeypatch):
    """All arguments of one odd kind, then each of two kinds."""
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
    assert list(tmp_path.iterdir()) == []  # and nothing is written
