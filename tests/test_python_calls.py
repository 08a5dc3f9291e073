"""Calls of the Python interface with arguments of wrong types raise a UsageError that contains the
parameter."""

import inspect
import logging
import multiprocessing
import pickle

import numpy as np
import pytest

import tdint
from tdint import errors
from tdint.errors import TdintError, UsageError
from tdint.response.runs.outcome import FailedRun
from tdint.studies.store.schema import UntrustedStoreError
from tdint.validated_calls import validated_call

MODEL = {"stories": [{"mass": 1.0, "height": 3.0, "stiffness": 100.0}]}
RECORD = tdint.make_record(np.sin(0.1 * np.arange(100)), dt=0.01, units="m/s^2")


@pytest.mark.parametrize(
    ("name", "arguments", "parameter"),
    [
        ("stability", {"dt_over_t": 0.1}, "method"),
        ("stability", {"method": {"bathe"}, "dt_over_t": np.array([0.1])}, "method"),
        ("stability", {"method": "bathe", "dt_over_t": np.ones((2, 2))}, "dt_over_t"),
        ("scale", {"motions": 0.1}, "motions"),
        ("model_template", {"stories": None}, "stories"),
        ("inventory", {"source": None}, "source"),
        ("methods", {"specifications": 0}, "specifications"),
        ("load_plugin", {"file": None}, "file"),
        ("fit_capacities", {"capacity": "x"}, "capacity"),
        (
            "run",
            {"model": MODEL, "record": RECORD, "until_rest": np.array([1.0, 2.0])},
            "until_rest",
        ),
        ("run", {"model": MODEL, "record": RECORD, "dt": np.ones((2, 2))}, "dt"),
        ("scale", {"motions": RECORD}, "motions"),
    ],
)
def test_argument_of_wrong_type_is_reported_by_name(name, arguments, parameter):
    with pytest.raises(TdintError) as caught:
        getattr(tdint, name)(**arguments)
    assert parameter in str(caught.value) and "\n" not in str(caught.value)


def test_validation_applies_only_to_failed_calls():
    def call(number: float, flag: bool = False) -> float:
        if flag:
            raise ValueError("a bug")
        return number * 2

    validated = validated_call(call, "call")
    assert validated("a") == "aa"
    with pytest.raises(ValueError, match="a bug"):
        validated(1.0, flag=True)
    with pytest.raises(UsageError, match=r"call: number .*got 'a'"):
        validated("a", flag=True)
    with pytest.raises(UsageError, match="call: missing a required argument: 'number'"):
        validated()
    with pytest.raises(TypeError, match="unexpected"):  # as for any function
        validated(1.0, other=2)
    assert inspect.signature(validated) == inspect.signature(call)


def test_public_functions_are_picklable():
    for name in ("run", "spectrum", "cyclic_test", "compare"):
        function = getattr(tdint, name)
        assert pickle.loads(pickle.dumps(function)) is function


def test_the_logger_silences_remarks(tmp_path, caplog):
    """As the page of Python states; all loggers of tdint are children of this logger."""
    file = tmp_path / "pulse.csv"
    file.write_text("time_s,acceleration_m_s2\n" + "".join(f"{0.01 * i},{i}\n" for i in range(30)))
    logger = logging.getLogger("tdint")
    level = logger.level
    try:
        tdint.read_record(file)
        assert "no sample is below zero" in caplog.text
        caplog.clear()
        logger.setLevel("ERROR")
        tdint.read_record(file)
        assert not caplog.records
    finally:
        logger.setLevel(level)


@pytest.mark.parametrize(
    "error",
    [
        errors.UsageError("no"),
        errors.ModelError([errors.ModelFault("a.yaml", 1, 2, "k", "bad")]),
        UntrustedStoreError("a.sqlite", "why"),
        FailedRun("ran away", "diverged", "newmark", 0.1, time=2.0, notes=("a",)),
    ],
)
def test_errors_are_picklable(error):
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))


@pytest.mark.long
def test_error_in_spawned_process_is_returned():
    """The function is part of tdint, because new processes may not find the tests, whose path is
    not inherited from `pytest`."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        waiting = pool.apply_async(tdint.load_model, ("none.yaml",))
        with pytest.raises(errors.ModelError, match=r"none\.yaml: file not found"):
            waiting.get(timeout=120.0)
