"""Public functions, called with what no argument can be: each call ends in a TdintError, or in a result."""

import inspect
import warnings

import numpy as np
import pytest

import tdint
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
