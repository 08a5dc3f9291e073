"""Design spectra in the terms of their code, for titles and reports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tdint.units import STANDARD_GRAVITY, parse_with_unit

_CODES = {"asce7": "ASCE 7", "mcer": "ASCE 7 MCER", "ec8": "EN 1998-1"}
"""Printed names of the codes. The command line has the keys."""

_MULTI_PERIOD = {
    "asce7-22": "ASCE 7-22 multi-period design spectrum",
    "mcer-22": "ASCE 7-22 multi-period MCER spectrum",
}
"""Printed names of spectra from a file of the USGS service."""

_PARAMETERS = {
    "sds": "SDS = {} g",
    "sd1": "SD1 = {} g",
    "tl": "TL = {} s",
    "type": "type {}",
    "soil": "soil {}",
    "ag": "ag = {}",
    "damping": "damping {}",
    "s": "S = {}",
    "tb": "TB = {} s",
    "tc": "TC = {} s",
    "td": "TD = {} s",
    "q": "q = {}",
}
"""Printed form of each parameter of a design spectrum."""


def spectrum_text(source: str) -> str:
    """Return the name of a target spectrum for titles and reports.

    Parameters
    ----------
    source : str
        File name, or building code and its parameters as on the command line
        (`asce7:sds=1.0,sd1=0.6,tl=8`).

    Returns
    -------
    str
        For example "ASCE 7, SDS = 1.0 g, SD1 = 0.6 g, TL = 8 s". A file name, and a text with an
        unknown parameter, are returned unchanged.
    """
    code, colon, listed = source.partition(":")
    if colon and code in _MULTI_PERIOD:
        return f"{_MULTI_PERIOD[code]} ({listed})"
    if not colon or code not in _CODES:
        return source
    parts = [_CODES[code]]
    for item in listed.split(","):
        key, _, value = item.partition("=")
        if key.strip() not in _PARAMETERS:
            return source
        if key.strip() == "ag":
            # The command line accepts any unit of acceleration; engineers compare ag in g.
            acceleration = parse_with_unit(value, "acceleration", "0.25g", "ag")
            value = f"{acceleration / STANDARD_GRAVITY:.4g} g"
        parts.append(_PARAMETERS[key.strip()].format(value.strip()))
    return ", ".join(parts)


def target_text(settings: Mapping[str, Any]) -> str:
    """Return the target of a scaling: a spectrum, or a measure and its value; empty if unknown."""
    if target := settings.get("target"):
        return spectrum_text(target)
    if not (measure := settings.get("measure")):
        return ""
    return f"{measure} = {settings['value']:.4g} {settings.get('unit', '')}".rstrip()
