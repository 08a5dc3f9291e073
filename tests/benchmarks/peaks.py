"""Reported peaks, beside the largest values at the steps and the method's own error: python
tests/benchmarks/peaks.py [TABLE]...

Tables: runs (every method of `tdint methods` on four configurations and 20 random buildings, at dt
to dt/8: how far off the peaks of five quantities are, the share of runs within the limit, the
observed order), beyond (the runs that are not within it). Both if none is named.

A run of a quantity is within the limit if no story's peak errs by more than 1.1 times the larger of
the error of the largest value at the steps and the method's own error in time, the largest of the
history over the peak, plus 1e-4. The truth is impulse4 at dt/64, confirmed by gauss4.
"""

import sys
from collections import defaultdict

import numpy as np
from common import ROOT

from random_buildings import piecewise_building, shaken_building
from tdint import load_model, run
from tdint.analysis.run.outcome import FailedRun
from tdint.analysis.run.run import model_record
from tdint.errors import AnalysisError
from tdint.methods.catalogue import catalogue, parse

NAMED = ("ten-story", "ten-story-bilinear", "fluid-dampers", "base-isolated")
MORE = ("hht:alpha=-0.3", "newmark:gamma=0.6", "impulse4:rho_inf=0.5", "moment4:rho_inf=0.5")
QUANTITIES = ("drift", "displacement", "velocity", "absolute_acceleration", "shear")
PARTS = (1, 2, 4, 8)
FINE = 64
SURE = 2e-5


class Truth:
    """A building under a motion: its peaks, and its history at dt/8."""

    def __init__(self, name, building, record):
        self.name, self.building, self.record = name, building, record
        fine = run(building, record, method="impulse4", dt=record.dt / FINE, history=True)
        other = run(building, record, method="gauss4", dt=record.dt / FINE).stories
        self.done = fine.status == "done"
        self.peaks = {one: getattr(fine.stories, f"peak_{one}") for one in QUANTITIES}
        self.doubt = max(
            np.max(np.abs(getattr(other, f"peak_{one}") / self.peaks[one] - 1.0))
            for one in QUANTITIES
        )
        self.history = {
            one: getattr(fine.history, one)[:: FINE // max(PARTS)].copy() for one in QUANTITIES
        }

    def errors(self, method, parts):
        """For each quantity three arrays over the stories: errors of the reported peak, of the
        largest value at the steps, and of the history; None where the method does not run."""
        try:
            response = run(
                self.building, self.record, method=method, dt=self.record.dt / parts, history=True
            )
        except (FailedRun, AnalysisError):
            return None
        if response.status != "done":
            return None
        found = {}
        for one in QUANTITIES:
            history = getattr(response.history, one)
            peak = self.peaks[one]
            far = np.max(
                np.abs(history - self.history[one][:: max(PARTS) // parts][: len(history)]), axis=0
            )
            at_steps = np.max(np.abs(history), axis=0)
            reported = getattr(response.stories, f"peak_{one}")
            found[one] = np.abs(reported - peak) / peak, np.abs(at_steps - peak) / peak, far / peak
        return found


def truths():
    """The four configurations, ten buildings with kinks and ten without."""
    for name in NAMED:
        building = load_model(ROOT / "configs" / f"{name}.yaml")
        yield Truth(name, building, model_record(building))
    for kind, draw in (("kinks", piecewise_building), ("smooth", shaken_building)):
        rng, count = np.random.default_rng(23), 0
        while count < 10:
            truth = Truth(f"{kind} {count + 1}", *draw(rng))
            # What collapses, or amplifies rounding to something seen, has no peaks to compare with.
            if truth.done and truth.doubt <= SURE:
                count += 1
                yield truth


def measure():
    """Errors of all runs by building, method, part of the step and quantity."""
    found = {}
    for truth in truths():
        print(f"{truth.name}: gauss4 differs by {truth.doubt:.0e}", file=sys.stderr)
        for method in (*catalogue(), *MORE):
            for parts in PARTS:
                errors = truth.errors(method, parts)
                if errors is not None:
                    found |= {
                        (truth.name, method, parts, one): value for one, value in errors.items()
                    }
    return found


def within(errors):
    """Whether a run is within the limit."""
    reported, at_steps, own = errors
    return bool(np.all(reported <= 1.1 * np.maximum(at_steps, own) + 1e-4))


def group(name, method):
    """Which line of the table a run belongs to."""
    order = parse(method).order
    kind = (
        "linear"
        if name == "ten-story"
        else "smooth"
        if name.startswith(("smooth", "fluid"))
        else "kinks"
    )
    return f"{'4, 5, exact' if order > 3 or method == 'exact' else order}, {kind}"


def _runs(found):
    groups = defaultdict(lambda: defaultdict(list))
    for (name, method, parts, one), errors in found.items():
        groups[group(name, method)][one, parts].append(
            (np.max(errors[0]), np.max(errors[1]), within(errors))
        )
    print(
        "errors at dt (of the largest value at the steps), order from dt to dt/8; geometric means\n"
    )
    print(f"| order, building | {' | '.join(QUANTITIES)} | within |")
    print("|---|" + "---|" * (len(QUANTITIES) + 1))
    for name in sorted(groups):
        runs, cells = groups[name], []
        for one in QUANTITIES:
            (coarse, at_steps), (fine, _) = (
                np.exp(
                    np.mean(np.log(np.maximum([run[:2] for run in runs[one, k]], 1e-12)), axis=0)
                )
                for k in (1, 8)
            )
            cells.append(f"{coarse:.1e} ({at_steps:.1e}), {np.log2(coarse / fine) / 3.0:.1f}")
        every = [run[2] for part in runs.values() for run in part]
        print(f"| {name} | {' | '.join(cells)} | {sum(every)} of {len(every)} |")
    good = [within(errors) for errors in found.values()]
    print(f"\n{sum(good)} of {len(good)} runs within the limit, {100.0 * np.mean(good):.2f} %")


def _beyond(found):
    for (name, method, parts, one), errors in found.items():
        if not within(errors):
            limit = 1.1 * np.maximum(errors[1], errors[2]) + 1e-4
            i = int(np.argmax(errors[0] / limit))
            sizes = ", ".join(f"{error[i]:.2e}" for error in errors)
            print(
                f"{name}, {method}, dt/{parts}, {one} {i + 1}: {sizes} "
                f"({errors[0][i] / limit[i]:.2f} of the limit)"
            )


if __name__ == "__main__":
    FOUND = measure()
    for table in sys.argv[1:] or ("runs", "beyond"):
        {"runs": _runs, "beyond": _beyond}[table](FOUND)
        print()
