"""Drift laws of stories from curves of shear over drift, as a pushover of another program has them."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize

from tdint.arrays import Array
from tdint.csv_table import CsvTable, read_table
from tdint.errors import ModelError
from tdint.model.first_model import FittedLaw
from tdint.units import FORCE, LENGTH

_NEEDS = "story curves are a CSV file with the columns story, drift_m and shear_N (or drift_mm, shear_kN, ...)"
_FEWEST = 4
_STARTS = (0.15, 0.3, 0.5, 0.7, 0.85)
"""Where the corners of a law are looked for, over the largest drift."""
_GAP = 1e-3  # between the points of a law, over the largest drift
_LEAST_SHEAR = 1e-6  # over the largest


@dataclass(frozen=True)
class CurveFit:
    """A law that was fitted to the curve of a story.

    Attributes
    ----------
    story : int
        From 1 at the ground.
    law : FittedLaw
        The law.
    misfit : float
        Root mean square of the differences between the law and the curve, over the curve's largest shear.
    """

    story: int
    law: FittedLaw
    misfit: float


def read_story_curves(source: str) -> dict[int, tuple[Array, Array]]:
    """Drift (m) and shear (N) of each story from 1, from a CSV file whose columns say their units.

    Raises
    ------
    ModelError
        It is no such file, or a story is missing, has too few points, or drifts that do not grow.
    """
    table = read_table(source, _NEEDS)
    drift, length = _column(table, "drift", LENGTH)
    shear, force = _column(table, "shear", FORCE)
    table.need("story")
    stories = np.array(table.numbers("story"))
    values = np.array([np.array(table.numbers(drift)) * length, np.array(table.numbers(shear)) * force])
    count = int(stories.max()) if stories.size else 0
    curves = {story: values[:, stories == story] for story in range(1, count + 1)}
    if not curves or stories.size != sum(part.shape[1] for part in curves.values()):
        raise ModelError(f"{source}: story: numbers from 1 at the ground are needed")
    for story, (drifts, shears) in curves.items():
        if (
            drifts.size < _FEWEST
            or np.any(np.diff(drifts) < 0.0)
            or drifts[0] < 0.0
            or np.max(shears, initial=0.0) <= 0
        ):
            raise ModelError(
                f"{source}: story {story}: a curve has {_FEWEST} points at least, positive shears, and drifts that "
                "grow from zero"
            )
    return {story: (part[0], part[1]) for story, part in curves.items()}


def _column(table: CsvTable, name: str, units: dict[str, float]) -> tuple[str, float]:
    """The column of a quantity by its name with a unit, and that unit in SI."""
    known = {f"{name}_{re.sub(r'[^a-z]', '', unit.lower())}": factor for unit, factor in units.items()}
    for column, factor in known.items():
        if table.has(column):
            return column, factor
    table.need(f"{name}_{'m' if name == 'drift' else 'N'}".lower())
    raise AssertionError  # need has raised


def fit_story(story: int, drift: Array, shear: Array, kind: str) -> CurveFit:
    """The law of a kind that comes closest to a curve by least squares of the shear.

    Parameters
    ----------
    kind : str
        `bilinear`; `trilinear`: a law `trilinear-pinching` without pinching, flat beyond its largest force; or
        `multilinear`: a law `multilinear-pinching` without pinching, with four points, which may fall.
    """
    fit, model = _KINDS[kind]
    scale, top = float(drift[-1]), float(np.max(shear))
    d, f = drift / scale, shear / top
    best = min((fit(d, f, start) for start in _STARTS), key=lambda found: found[1])
    law = model(best[0], scale, top)
    return CurveFit(story, law, float(np.sqrt(best[1] / d.size)))


Corners = tuple[Array, float]


def _least_squares(d: Array, f: Array, corners: Array, *, flat: bool) -> tuple[Array, Array]:
    """Slopes between corners, none negative, and the shears they leave; `flat`: no slope after the last corner."""
    from scipy.optimize import nnls

    edges = np.concatenate([[0.0], np.sort(corners), [max(1.0, float(np.max(corners)) + 1e-9)]])
    parts = [np.clip(d - low, 0.0, high - low) for low, high in pairwise(edges)]
    base = np.column_stack(parts[:-1] if flat else parts)
    slopes, _ = nnls(base, f)
    return np.asarray(slopes), np.asarray(f - base @ slopes)


def _search(d: Array, f: Array, start: Array, *, flat: bool) -> tuple[Array, Array, float]:
    low = 0.5 * float(d[d > 0.0][0])

    def squares(corners: Array) -> float:
        inside = np.clip(corners, low, 1.0)
        return float(np.sum(_least_squares(d, f, inside, flat=flat)[1] ** 2))

    found = np.clip(minimize(squares, start, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-14}).x, low, 1.0)
    corners = np.sort(found)
    return corners, _least_squares(d, f, corners, flat=flat)[0], squares(corners)


def _broken_line(parts: tuple[float, ...], flat: bool, d: Array, f: Array, start: float) -> Corners:
    """Corners, looked for from parts of `start` on, and the slopes between them."""
    corners, slopes, squares = _search(d, f, start * np.array(parts), flat=flat)
    return np.concatenate([corners, slopes]), squares


def _multilinear(d: Array, f: Array, start: float) -> Corners:
    """Drifts of four points, the last one that of the curve, and the shears there by least squares, none negative."""
    from scipy.optimize import nnls

    low = 0.5 * float(d[d > 0.0][0])

    def points(corners: Array) -> Array:
        inside = np.sort(np.clip(corners, low, 1.0))
        return np.append(np.minimum(inside + _GAP * np.arange(3), 1.0 - _GAP * np.arange(3, 0, -1)), 1.0)

    def shears(x: Array) -> tuple[Array, float]:
        hats = np.eye(5)[1:]
        found, rest = nnls(np.column_stack([np.interp(d, np.append(0.0, x), hat) for hat in hats]), f)
        return np.asarray(found), float(rest**2)

    begin = np.array([0.3 * start, start, 0.5 * (1.0 + start)])
    search = {"xatol": 1e-7, "fatol": 1e-14, "maxiter": 2000}
    best = points(minimize(lambda x: shears(points(x))[1], begin, method="Nelder-Mead", options=search).x)
    return np.concatenate([best, shears(best)[0]]), shears(best)[1]


def _bilinear_law(found: Array, scale: float, top: float) -> FittedLaw:
    corner, first, second = found
    hardening = float(np.clip(second / first, 0.0, 0.999))
    yield_force = ("yield_force", float(first * corner * top), "force")
    return FittedLaw("bilinear", float(first * top / scale), (yield_force, ("hardening", hardening, "")))


def _trilinear_law(found: Array, scale: float, top: float) -> FittedLaw:
    first_corner, last_corner, first, second = found
    yield_force = float(first * first_corner * top)
    largest = yield_force + float(second * (last_corner - first_corner) * top)
    parameters = (
        ("yield_force", yield_force, "force"),
        ("ultimate_force", largest, "force"),
        ("ultimate_drift", float(last_corner * scale), "length"),
        ("pinching", 1.0, ""),
        ("unloading", 0.0, ""),
    )
    return FittedLaw("trilinear-pinching", float(first * top / scale), parameters)


def _multilinear_law(found: Array, scale: float, top: float) -> FittedLaw:
    drifts, shears = scale * found[:4], top * np.maximum(found[4:], _LEAST_SHEAR)
    backbone = tuple(zip(drifts.tolist(), shears.tolist(), strict=True))
    return FittedLaw("multilinear-pinching", float(shears[0] / drifts[0]), (), backbone)


_KINDS: dict[str, tuple[Callable[[Array, Array, float], Corners], Callable[[Array, float, float], FittedLaw]]] = {
    "bilinear": (partial(_broken_line, (1.0,), False), _bilinear_law),
    "trilinear": (partial(_broken_line, (0.4, 1.0), True), _trilinear_law),
    "multilinear": (_multilinear, _multilinear_law),
}
"""The laws that curves are fitted by."""
