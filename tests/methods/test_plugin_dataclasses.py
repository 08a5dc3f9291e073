"""Plug-ins may inherit from the classes of the public interface with ordinary dataclasses."""

from dataclasses import FrozenInstanceError, InitVar, dataclass, field, fields, replace

import numpy as np
import pytest

import tdint
from tdint import plugin
from tdint.kernels.laws import LAWS
from tdint.methods.catalogue import catalogue

NAMES = ("Family", "Method", "DriftLaw", "Measure", "Problem", "Series", "Record")


@pytest.mark.parametrize("name", NAMES)
def test_dataclass_may_inherit_from_public_class(name):
    base = getattr(plugin, name)

    @dataclass(frozen=True)
    class Extended(base):
        """A class with an additional field."""

        remark: str = "none"
        length: InitVar[int] = 0
        doubled: int = field(init=False, default=0)

        def __post_init__(self, length):
            if hasattr(base, "__post_init__"):
                super().__post_init__()
            object.__setattr__(self, "doubled", 2 * length)

    assert Extended.__doc__ == "A class with an additional field."
    assert [attribute.name for attribute in fields(Extended)] == [
        *(attribute.name for attribute in fields(base)),
        "remark",
        "doubled",
    ]


def test_extended_method_is_used_as_method():
    @dataclass(frozen=True)
    class Extended(plugin.Method):
        """A method with a remark."""

        remark: str = ""

    method = catalogue()["impulse4"]
    values = {attribute.name: getattr(method, attribute.name) for attribute in fields(method)}
    extended = Extended(**values, remark="as published")
    assert replace(extended, remark="").order(1.0) == method.order(1.0)
    with pytest.raises(FrozenInstanceError):
        extended.remark = "changed"


def test_extended_law_and_record_keep_values():
    @dataclass(frozen=True)
    class Law(plugin.DriftLaw):
        """A law with a source."""

        origin: str = ""

    law = Law(
        **{attribute.name: getattr(LAWS[1], attribute.name) for attribute in fields(LAWS[1])},
        origin="tests",
    )
    assert (law.name, law.parameters, law.origin) == ("bilinear", LAWS[1].parameters, "tests")

    @dataclass(frozen=True, repr=False)
    class Recorded(plugin.Record):
        """A record with its instrument."""

        instrument: str = ""

    record = tdint.make_record(np.sin(np.arange(100.0)), dt=0.01, units="m/s^2")
    values = {
        attribute.name: getattr(record, attribute.name)
        for attribute in fields(record)
        if attribute.init
    }
    recorded = Recorded(**values, instrument="K2")
    model = {"stories": [{"mass": 1e3, "stiffness": 1e6}]}
    found = [tdint.run(model, attribute).stories.peak_drift for attribute in (record, recorded)]
    np.testing.assert_array_equal(*found)
