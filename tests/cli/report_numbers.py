"""Printed values of a report, and the values in the tables and summaries of the same command."""

import csv
import json
import math
import re
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, suppress
from itertools import pairwise, permutations
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from tdint.errors import RecordError
from tdint.ground_motion.reading.read import read_record
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model
from tdint.response.static.pushover import pushover
from tdint.units import STANDARD_GRAVITY

INCH, KIP = 0.0254, 4448.2216152605
FACTORS = {
    "": 1.0, "%": 0.01, "m": 1.0, "mm": 1e-3, "in": INCH, "s": 1.0, "Hz": 1.0,
    "g": STANDARD_GRAVITY, "m/s²": 1.0, "N": 1.0, "kN": 1e3, "kip": KIP, "t": 1e3,
    "kg": 1.0, "kip·s²/in": KIP / INCH, "kN/m": 1e3, "kip/in": KIP / INCH, "kN·m": 1e3,
}  # fmt: skip
"""SI value of the units of reports."""

NUMBER = re.compile(
    r"(?<![\w.#/-])(-?\d+(?:\.\d+)?)(?![\w.]*\d)\s?"
    r"(%|mm|m/s²|m|in|s|Hz|g|kN·m|kN/m|kN|kip/in|kip|kg|t|N)?(?![\w])"
)
_SMALL = 1e-4  # cells below this fraction of the maximum of their column are printed as 0


def printed(text: str) -> Iterator[tuple[str, str]]:
    """Yield each number in a text with its unit."""
    for match in NUMBER.finditer(text):
        yield match[1], match[2] or ""


def spread(text: str) -> float:
    """Return half of the last digit of a number, which its rounding can change."""
    return 0.5001 * 10.0 ** -len(text.partition(".")[2])


def rounding(text: str) -> float:
    """Return the maximum rounding error; integers of at least five digits have four significant
    digits."""
    digits = len(text.lstrip("-").rstrip("0"))
    zeros = len(text) - len(text.rstrip("0"))
    is_integer = "." not in text and digits <= 4 and len(text.lstrip("-")) > 4
    return 0.5001 * 10.0**zeros if is_integer else spread(text)


class Known:
    """Values in the tables, summaries and models of a command, SI units."""

    def __init__(self, files: Iterable[Path], models: Iterable[Path]) -> None:
        self.values: list[float] = []
        for file in files:
            if file.suffix == ".csv":
                self._add_table(file)
            elif file.suffix == ".json":
                self._add(json.loads(file.read_text(encoding="utf-8")))
            elif file.suffix == ".sqlite":
                with closing(sqlite3.connect(file)) as store:
                    query = "SELECT ductility FROM story_rows WHERE ductility IS NOT NULL"
                    self.values += [value for (value,) in store.execute(query)]
        models = list(models)
        for model in models:
            self._add_model(model)
        # A building is described by the masses that differ from those of another one, as multiples.
        masses = [load_model(model).stories[0].mass for model in models]
        self.values += [one / other for one, other in permutations(masses, 2)]

    def _add(self, item: Any) -> None:
        if isinstance(item, dict):
            for key, value in item.items():
                self._add(value)
                if key.endswith("_g") and isinstance(value, float):
                    self.values.append(value * STANDARD_GRAVITY)
        elif isinstance(item, list):
            for value in item:
                self._add(value)
        elif isinstance(item, int | float) and not isinstance(item, bool) and math.isfinite(item):
            self.values.append(float(item))

    def _add_table(self, file: Path) -> None:
        """Add the cells of a table, and its errors divided by the values."""
        with file.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        if rows and "time_s" in rows[0]:
            # A report states the times of the maxima of a history; the peaks are in other tables.
            times = [float(row["time_s"]) for row in rows]
            for name in rows[0]:
                values = [abs(float(row[name] or 0.0)) for row in rows]
                self.values.append(times[values.index(max(values))])
            return
        for row in rows:
            cells = {}
            for name, text in row.items():
                try:
                    cells[name] = float(text)
                except (TypeError, ValueError):
                    continue
            factors = {name: _factor(name) for name in cells}
            self.values += [value * factors[name] for name, value in cells.items()]
            for name, error in cells.items():
                value = cells.get(name.removesuffix("_error"))
                if not name.endswith("_error") or not value:
                    continue
                self.values.append(abs(error / value))
                drift = next((cells[key] for key in cells if key.startswith("peak_drift_")), None)
                if name.startswith("residual_drift") and drift:
                    self.values += [abs(error / cells[key]) for key in cells if _is_drift(key)]

    def _add_model(self, file: Path) -> None:
        """Add masses, heights, stiffnesses, parameters and limits of a model."""
        model = load_model(file)
        for story in model.stories:
            power = story.power_dashpot
            self.values += [story.mass, story.stiffness, story.height or 0.0, story.dashpot]
            self.values += [*story.law.parameters, *((power.coefficient,) if power else ())]
        # The force of a dashpot is written as a number times the drift rate, in kN.
        self.values += [story.dashpot / 1e3 for story in model.stories]
        omega, damping = assemble(model).first_mode()
        # Damping proportional to mass, 1/s.
        self.values.append(2.0 * damping * omega)
        self.values += [2.0 * math.pi / omega, damping, model.collapse_drift, STANDARD_GRAVITY]
        self.values += [value for limit in model.limits for value in limit.values]

    def add_record(self, file: Path, component: str | None) -> None:
        """Add duration, sampling interval and peak of a record, m/s^2 by default."""
        for units in (None, "m/s^2"):
            with suppress(RecordError):
                record = read_record(file, component=component, units=units)
                peak = int(np.argmax(np.abs(record.acceleration)))
                self.values += [record.duration, record.dt, record.pga, peak * record.dt]
                return

    def add_functions(self, file: Path) -> None:
        """Add the bounds of 95 % of the fragility functions in a table: theta exp(-1.96 e) to
        theta exp(1.96 e), and beta plus or minus 1.96 standard errors."""
        with file.open(encoding="utf-8", newline="") as stream:
            for row in csv.DictReader(stream):
                names = ("theta", "theta_error", "beta", "beta_error")
                theta, theta_error, beta, beta_error = (float(row[name]) for name in names)
                self._add_bounds(theta, theta_error, beta, beta_error)

    def add_means(self, file: Path, models: Iterable[Path]) -> None:
        """Add what a comparison states beside a table of profiles: the mean residual drift ratio of
        each story, and the mean drift ratio of each building (that of its worst story) over that of
        the first building."""
        heights: dict[tuple[str, str], float] = {}
        for model in map(load_model, models):
            for number, story in enumerate(model.stories, start=1):
                heights[model.name, str(number)] = story.height or math.nan
        drifts: dict[tuple[str, str], float] = {}
        with file.open(encoding="utf-8", newline="") as stream:
            for row in csv.DictReader(stream):
                if row["quantity"] not in ("peak_drift", "residual_drift"):
                    continue
                ratio = float(row["mean"]) / heights[row["building"], row["story"]]
                key = row["scale"], row["building"]
                if row["quantity"] == "peak_drift":
                    drifts[key] = max(drifts.get(key, 0.0), ratio)
                else:
                    self.values.append(ratio)
        first = next(building for _, building in drifts)
        self.values += [drift / drifts[scale, first] for (scale, _), drift in drifts.items()]

    def add_region(self, folder: Path) -> None:
        """Add what the first page of a region states beside the tables of its types: the mean loss
        ratio and the expected number of damaged buildings of each level."""
        with (folder / "losses.csv").open(encoding="utf-8", newline="") as stream:
            losses = [row for row in csv.DictReader(stream) if not row["building"]]
        with (folder / "damage-types.csv").open(encoding="utf-8", newline="") as stream:
            undamaged = [row for row in csv.DictReader(stream) if row["state"] == "none"]
        for level in {row["level"] for row in losses}:
            of_level = [row for row in losses if row["level"] == level]
            buildings = sum(float(row["buildings"]) for row in of_level)
            total = sum(float(row["buildings"]) * float(row["loss_ratio"]) for row in of_level)
            self.values.append(total / buildings)
            self.values.append(
                sum(
                    float(row["buildings"]) * (1.0 - float(row["probability"]))
                    for row in undamaged
                    if row["level"] == level
                )
            )

    def add_capacities(self, file: Path) -> None:
        """Add the fractiles of the capacities of a study, and the fitted fragility functions.

        Fractiles are interpolated between the logarithms of the sorted capacities, at the
        thresholds and at the tenths of the last threshold, the collapse. theta is the median and
        beta the standard deviation of a lognormal distribution; their standard errors are
        beta / sqrt(n) and beta / sqrt(2 n) of n capacities, and the bounds of theta are those of
        Student's distribution. No capacity may be censored.
        """
        with file.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        assert all(row["censored"] == "false" for row in rows)
        with (file.parent / "ida.csv").open(encoding="utf-8", newline="") as stream:
            runs = list(csv.DictReader(stream))
        intensities = {row["record"]: float(row["im"]) / float(row["scale"]) for row in runs}
        collapse = max(float(row["threshold"]) for row in rows)
        for drift in np.linspace(0.1 * collapse, collapse, 10):
            crossings = [
                _crossing([row for row in runs if row["record"] == name], drift)
                for name in intensities
            ]
            self._add_fractiles(np.log(crossings))
        # Scale factors of the capacities.
        self.values += [float(row["capacity"]) / intensities[row["record"]] for row in rows]
        for threshold in {row["threshold"] for row in rows}:
            logarithms = np.log(
                [float(row["capacity"]) for row in rows if row["threshold"] == threshold]
            )
            n, beta = logarithms.size, float(np.std(logarithms, ddof=1))
            self._add_fractiles(logarithms)
            theta = math.exp(np.mean(logarithms))
            for unit in (1.0, STANDARD_GRAVITY):
                errors = beta / math.sqrt(n), beta / math.sqrt(2 * n)
                quantile = float(stats.t.ppf(0.975, n - 1))
                self._add_bounds(theta / unit, errors[0], beta, errors[1], quantile)
            # Mean of beta in samples of this size, as a fraction of the actual value
            gammas = math.gamma(n / 2), math.gamma((n - 1) / 2)
            self.values.append(math.sqrt(2 / (n - 1)) * gammas[0] / gammas[1])

    def _add_fractiles(self, logarithms: Any) -> None:
        fractiles = np.exp(np.quantile(logarithms, (0.16, 0.5, 0.84)))
        # The first of two numbers has no unit: "0.23 and 0.39 g".
        self.values += [*fractiles.tolist(), *(fractiles / STANDARD_GRAVITY).tolist()]

    def _add_bounds(
        self,
        theta: float,
        theta_error: float,
        beta: float,
        beta_error: float,
        quantile: float = 1.96,
    ) -> None:
        """Add a fragility function and its bounds of 95 %; the `quantile` is that of theta."""
        self.values += [theta, beta]
        for sign in (-1.0, 1.0):
            self.values += [theta * math.exp(sign * quantile * theta_error)]
            self.values += [max(beta + sign * 1.96 * beta_error, 0.0)]

    def add_pushover(self, file: Path, roof_target: float) -> None:
        """Add the maximum of a pushover and its last step, also over the target displacement (m) of
        the roof."""
        model = load_model(file)
        curve = pushover(model, 0.04)
        height = sum(story.height or 0.0 for story in model.stories)
        roof_at_maximum = float(np.sum(curve.drift_at_largest))
        self.values += [curve.largest_applied_force, roof_at_maximum, roof_at_maximum / height]
        self.values += [
            float(np.max(curve.drift[-1])),
            float(np.sum(curve.drift[-1])) / roof_target,
        ]

    def holds(self, text: str, unit: str, largest: float = 0.0) -> bool:
        """Return True if a printed number equals a known value within its printed digits.

        Parameters
        ----------
        text : str
            The number.
        unit : str
            Its unit.
        largest : float
            Maximum of the column, in the unit; 0 for numbers in sentences.
        """
        factor, value = FACTORS[unit], float(text)
        error = rounding(text)
        if value == 0.0:
            error = max(error if "." in text else 0.0, _SMALL * largest)
        return any(
            abs(abs(value) - abs(known) / factor) <= error + 1e-9 * abs(value)
            for known in self.values
        )


def _crossing(runs: list[dict[str, str]], drift: float) -> float:
    """Return the intensity where the runs of a motion, in the order of intensity, first reach a
    drift ratio: on logarithmic axes between two runs, or the middle of the last run below collapse
    and the first collapse."""
    for before, after in pairwise(runs):
        low, high = float(before["im"]), float(after["im"])
        if after["status"] == "collapsed":
            return math.sqrt(low * high)
        drifts = [math.log(float(run["peak_drift_ratio"])) for run in (before, after)]
        if drifts[0] < math.log(drift) <= drifts[1]:
            share = (math.log(drift) - drifts[0]) / (drifts[1] - drifts[0])
            return low * (high / low) ** share
    raise AssertionError(drift)


def _is_drift(name: str) -> bool:
    return bool(re.fullmatch(r"peak_drift_(m|in|ft)", name))


def _factor(name: str) -> float:
    """Return the SI value of the unit at the end of the name of a column."""
    name = name.removesuffix("_error")
    ends = {"_kip": KIP, "_kN": 1e3, "_in": INCH, "_g": STANDARD_GRAVITY}
    return next((factor for end, factor in ends.items() if name.endswith(end)), 1.0)
