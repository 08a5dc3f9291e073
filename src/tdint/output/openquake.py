"""Fragility functions as OpenQuake reads them: NRML 0.5, lognormal, with mean and standard deviation of the intensity
itself."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from xml.sax.saxutils import escape, quoteattr

from tdint.campaign.fragility.fits import Fragility
from tdint.errors import UsageError
from tdint.units import ACCELERATION
from tdint.written_numbers import how_many

_FAR = 4.0  # standard deviations beyond the medians at which the intensities end
_IMT = re.compile(r"(sa)\(([0-9.eE+-]+)\)|(pga)|(pgv)")
_VELOCITY = {"m/s": 100.0, "cm/s": 1.0}
"""Units of PGV in cm/s."""


def fragility_model(functions: Sequence[Fragility], name: str, states: Sequence[str] = ()) -> bytes:
    """The fragility model of functions of one intensity measure: one for each state of the building before, or for each
    type of buildings, under whose name it stands.

    Parameters
    ----------
    name : str
        Taxonomy of the building, where the functions are of no type: the function's id.
    states : sequence of str
        Limit states, by rising thresholds; by default ds1, ds2, ...; those of the types where they are of some.

    Raises
    ------
    UsageError
        The measure is none that OpenQuake knows; as many states as thresholds are not given.
    """
    named = {} if functions[0].type else _named(functions, states)
    every = list(dict.fromkeys(named[one] for one in sorted(named)) or dict.fromkeys(one.state for one in functions))
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<nrml xmlns="http://openquake.org/xmlns/nrml/0.5">',
        '  <fragilityModel id="tdint" assetCategory="buildings" lossCategory="structural">',
        f"    <description>{escape(name)}, {functions[0].fit}, made by tdint</description>",
        f"    <limitStates>{' '.join(every)}</limitStates>",
    ]
    for of_one in _grouped(functions):
        told = [one.state or named[one.threshold] for one in of_one]
        first = of_one[0]
        if told != every:
            missing = ", ".join(one for one in every if one not in told)
            what = first.type or f"damage {first.damage:g}"
            raise UsageError(
                f"{what}: no function of {missing}, and OpenQuake needs one of every state of all; more levels of "
                "intensity tell it, or leave it out with --threshold"
            )
        suffix = f"-damaged-{first.damage:g}" if first.damage > 0.0 else ""
        lines += _function(of_one, first.type or f"{name}{suffix}", told)
    return "\n".join([*lines, "  </fragilityModel>", "</nrml>", ""]).encode()


def whole_types(functions: Sequence[Fragility]) -> tuple[list[Fragility], list[str]]:
    """The functions of the types that have one of every state, and the names of the others."""
    most = max(len(of_one) for of_one in _grouped(functions))
    partial = [of_one[0].type for of_one in _grouped(functions) if len(of_one) < most]
    return [one for one in functions if one.type not in partial], partial


def _named(functions: Sequence[Fragility], states: Sequence[str]) -> dict[float, str]:
    """The limit states by their thresholds.

    Raises
    ------
    UsageError
        There are not as many.
    """
    thresholds = sorted({one.threshold for one in functions})
    states = list(states) or [f"ds{number}" for number in range(1, len(thresholds) + 1)]
    if len(states) != len(thresholds) or any(not re.fullmatch(r"\w+", state) for state in states):
        listed = ", ".join(f"{one:g}" for one in thresholds)
        raise UsageError(
            f"the functions have {how_many(len(thresholds), 'threshold')} ({listed}): name as many states, a word each"
        )
    return dict(zip(thresholds, states, strict=True))


def _grouped(functions: Sequence[Fragility]) -> list[list[Fragility]]:
    """The functions of each building or type, by rising thresholds."""
    groups: dict[tuple[str, str], list[Fragility]] = {}
    for one in functions:
        groups.setdefault((str(one.damage), one.type), []).append(one)
    return [sorted(of_one, key=lambda one: one.threshold) for of_one in groups.values()]


def _function(functions: Sequence[Fragility], name: str, states: Sequence[str]) -> list[str]:
    imt, factor = _measure(functions[0])
    far = [one.theta * factor * math.exp(sign * _FAR * one.beta_total) for one in functions for sign in (-1.0, 1.0)]
    lines = [
        f'    <fragilityFunction id={quoteattr(name)} format="continuous" shape="logncdf">',
        f'      <imls imt="{imt}" minIML="{min(far):.6g}" maxIML="{max(far):.6g}"/>',
    ]
    for one, state in zip(functions, states, strict=True):
        mean = one.theta * factor * math.exp(0.5 * one.beta_total**2)
        deviation = mean * math.sqrt(math.expm1(one.beta_total**2))
        lines.append(f'      <params ls="{state}" mean="{mean:.9g}" stddev="{deviation:.9g}"/>')
    return [*lines, "    </fragilityFunction>"]


def _measure(function: Fragility) -> tuple[str, float]:
    """What OpenQuake calls the intensity measure, and the factor to its unit."""
    found = _IMT.fullmatch(function.im.lower())
    if found and found[1] and function.unit in ACCELERATION:
        return f"SA({float(found[2]):.6g})", ACCELERATION[function.unit] / ACCELERATION["g"]
    if found and found[3] and function.unit in ACCELERATION:
        return "PGA", ACCELERATION[function.unit] / ACCELERATION["g"]
    if found and found[4] and function.unit in _VELOCITY:
        return "PGV", _VELOCITY[function.unit]
    measure = f"{function.im or 'untold'} {function.unit}".rstrip()
    raise UsageError(f"OpenQuake knows Sa at a period, PGA and PGV, with their units; the table's measure is {measure}")
