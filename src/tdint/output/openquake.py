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

_FAR = 4.0  # standard deviations beyond the medians at which the intensities end
_IMT = re.compile(r"(sa)\(([0-9.eE+-]+)\)|(pga)|(pgv)")
_VELOCITY = {"m/s": 100.0, "cm/s": 1.0}
"""Units of PGV in cm/s."""


def fragility_model(functions: Sequence[Fragility], name: str, states: Sequence[str] = ()) -> bytes:
    """The fragility model of functions of one intensity measure, a function for each state of the building before.

    Parameters
    ----------
    name : str
        Taxonomy of the building: the function's id.
    states : sequence of str
        Limit states, by rising thresholds; by default ds1, ds2, ...

    Raises
    ------
    UsageError
        The measure is none that OpenQuake knows; as many states as thresholds are not given.
    """
    thresholds = sorted({one.threshold for one in functions})
    states = list(states) or [f"ds{number}" for number in range(1, len(thresholds) + 1)]
    if len(states) != len(thresholds) or any(not re.fullmatch(r"\w+", state) for state in states):
        listed = ", ".join(f"{one:g}" for one in thresholds)
        raise UsageError(
            f"the functions have {len(thresholds)} thresholds ({listed}): name as many states, a word each"
        )
    named = dict(zip(thresholds, states, strict=True))
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<nrml xmlns="http://openquake.org/xmlns/nrml/0.5">',
        '  <fragilityModel id="tdint" assetCategory="buildings" lossCategory="structural">',
        f"    <description>{escape(name)}, {functions[0].fit}, made by tdint</description>",
        f"    <limitStates>{' '.join(states)}</limitStates>",
    ]
    for damage in dict.fromkeys(str(one.damage) for one in functions):
        of_one = sorted((one for one in functions if str(one.damage) == damage), key=lambda one: one.threshold)
        if [one.threshold for one in of_one] != thresholds:
            raise UsageError(f"damage {damage}: not every threshold has a function; choose some with --threshold")
        suffix = "" if damage in ("nan", "0.0") else f"-damaged-{float(damage):g}"
        lines += _function(of_one, f"{name}{suffix}", named)
    return "\n".join([*lines, "  </fragilityModel>", "</nrml>", ""]).encode()


def _function(functions: Sequence[Fragility], name: str, states: dict[float, str]) -> list[str]:
    imt, factor = _measure(functions[0])
    far = [one.theta * factor * math.exp(sign * _FAR * one.beta_total) for one in functions for sign in (-1.0, 1.0)]
    lines = [
        f'    <fragilityFunction id={quoteattr(name)} format="continuous" shape="logncdf">',
        f'      <imls imt="{imt}" minIML="{min(far):.6g}" maxIML="{max(far):.6g}"/>',
    ]
    for one in functions:
        mean = one.theta * factor * math.exp(0.5 * one.beta_total**2)
        deviation = mean * math.sqrt(math.expm1(one.beta_total**2))
        lines.append(f'      <params ls="{states[one.threshold]}" mean="{mean:.9g}" stddev="{deviation:.9g}"/>')
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
