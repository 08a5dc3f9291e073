"""Measure the errors of reported peaks, which include the response between the time steps.

    python tests/benchmarks/peaks.py [TABLE]...

Tables (default: both):

runs    errors of the peaks of five quantities, observed orders, and number of runs within the
        limit, for every method of `tdint methods` with dt to dt/8; the buildings are four models of
        configs and 20 random buildings
beyond  runs that exceed the limit

A quantity of a run is within the limit if the relative error of the peak of each story is at most
1.1 max(E, H) + 1e-4. E is the error of the maximum value at the time steps. H is the maximum error
of the history divided by the peak. The reference is impulse4 with dt/64, confirmed by gauss4.
"""

import sys
from collections import defaultdict

import numpy as np
from common import ROOT

from random_buildings import piecewise_building, shaken_building
from tdint import load_model, run
from tdint.errors import AnalysisError
from tdint.methods.catalogue import catalogue, parse
from tdint.response.runs.outcome import FailedRun
from tdint.response.runs.run import model_record

NAMED = ("ten-story", "ten-story-bilinear", "fluid-dampers", "base-isolated")
MORE = ("hht:alpha=-0.3", "newmark:gamma=0.6", "impulse4:rho_inf=0.5", "moment4:rho_inf=0.5")
QUANTITIES = ("drift", "displacement", "velocity", "absolute_acceleration", "shear")
PARTS = (1, 2, 4, 8)
FINE = 64
MAX_DIFFERENCE = 2e-5  # maximum relative difference of the peaks of the two references


def history_of(response, quantity):
    """Return the history of a quantity of `QUANTITIES`, shape (times, stories)."""
    # The accelerations of a history are absolute; their name does not state it.
    return getattr(response.history, quantity.removeprefix("absolute_"))


class Reference:
    """Reference solution of a building under a ground motion.

    Attributes
    ----------
    name, building, record
        Name, model and ground motion of the case.
    done : bool
        True if the run reached its end without collapse.
    peaks : dict of str to ndarray
        Peaks over the stories by quantity.
    difference : float
        Maximum relative difference of the peaks from a second reference solution.
    history : dict of str to ndarray
        Histories with dt/8 by quantity, shape (times, stories).
    """

    def __init__(self, name, building, record):
        self.name, self.building, self.record = name, building, record
        fine = run(building, record, method="impulse4", dt=record.dt / FINE, history=True)
        second = run(building, record, method="gauss4", dt=record.dt / FINE).stories
        self.done = fine.status == "done"
        self.peaks = {name: getattr(fine.stories, f"peak_{name}") for name in QUANTITIES}
        self.difference = max(
            np.max(np.abs(getattr(second, f"peak_{name}") / self.peaks[name] - 1.0))
            for name in QUANTITIES
        )
        self.history = {
            name: history_of(fine, name)[:: FINE // max(PARTS)].copy() for name in QUANTITIES
        }

    def errors(self, method, parts):
        """Return the relative errors of a run with `parts` time steps per sampling interval.

        Returns
        -------
        dict of str to tuple of ndarray, or None
            For each quantity three arrays over the stories, divided by the peaks: errors of the
            reported peak, of the maximum value at the time steps, and of the history. None if the
            run fails or collapses.
        """
        try:
            response = run(
                self.building, self.record, method=method, dt=self.record.dt / parts, history=True
            )
        except (FailedRun, AnalysisError):
            return None
        if response.status != "done":
            return None
        errors = {}
        for name in QUANTITIES:
            history = history_of(response, name)
            peak = self.peaks[name]
            exact_history = self.history[name][:: max(PARTS) // parts][: len(history)]
            history_error = np.max(np.abs(history - exact_history), axis=0)
            maximum_at_steps = np.max(np.abs(history), axis=0)
            reported = getattr(response.stories, f"peak_{name}")
            errors[name] = (
                np.abs(reported - peak) / peak,
                np.abs(maximum_at_steps - peak) / peak,
                history_error / peak,
            )
        return errors


def references():
    """Yield the references of the four models, of ten buildings with kinks and of ten without."""
    for name in NAMED:
        building = load_model(ROOT / "configs" / f"{name}.yaml")
        yield Reference(name, building, model_record(building))
    for group_name, random_case in (("kinks", piecewise_building), ("smooth", shaken_building)):
        rng, count = np.random.default_rng(23), 0
        while count < 10:
            reference = Reference(f"{group_name} {count + 1}", *random_case(rng))
            # Buildings that collapse or amplify rounding errors have no accurate reference peaks.
            if reference.done and reference.difference <= MAX_DIFFERENCE:
                count += 1
                yield reference


def measure():
    """Return the errors of all runs, and print the difference of the references to stderr.

    Returns
    -------
    dict
        Result of `Reference.errors` for a quantity by (building, method, steps per sampling
        interval, quantity).
    """
    all_errors = {}
    for reference in references():
        print(f"{reference.name}: gauss4 differs by {reference.difference:.0e}", file=sys.stderr)
        for method in (*catalogue(), *MORE):
            for parts in PARTS:
                errors = reference.errors(method, parts) or {}
                for quantity, value in errors.items():
                    all_errors[reference.name, method, parts, quantity] = value
    return all_errors


def limits(errors):
    """Return the limits of the errors of reported peaks, by story; the module docstring defines
    them."""
    _, at_steps, history = errors
    return 1.1 * np.maximum(at_steps, history) + 1e-4


def is_within(errors):
    """Return True if the errors of the reported peaks of a run are within the limits."""
    return bool(np.all(errors[0] <= limits(errors)))


def group(name, method):
    """Return the row of the table for a building and a method, for example `2, kinks`."""
    order = parse(method).order
    if name == "ten-story":
        smoothness = "linear"
    elif name.startswith(("smooth", "fluid")):
        smoothness = "smooth"
    else:
        smoothness = "kinks"
    return f"{'4, 5, exact' if order > 3 or method == 'exact' else order}, {smoothness}"


def print_runs(all_errors):
    """Print mean errors, observed orders and the number of runs within the limit by group."""
    # By group, and by quantity and steps per sampling interval: maximum error of the reported
    # peaks, maximum error of the values at the steps, and True if the run is within the limit.
    groups = defaultdict(lambda: defaultdict(list))
    for (name, method, parts, quantity), errors in all_errors.items():
        groups[group(name, method)][quantity, parts].append(
            (np.max(errors[0]), np.max(errors[1]), is_within(errors))
        )
    print(
        "errors with dt (of the maximum value at the steps), order from dt to dt/8; geometric "
        "means\n"
    )
    print(f"| order, building | {' | '.join(QUANTITIES)} | within |")
    print("|---|" + "---|" * (len(QUANTITIES) + 1))
    for name in sorted(groups):
        runs, cells = groups[name], []
        for quantity in QUANTITIES:
            # Geometric means of the first two values of each run, with dt and with dt/8.
            (coarse, at_steps), (fine, _) = (
                np.exp(
                    np.mean(
                        np.log(np.maximum([run[:2] for run in runs[quantity, parts]], 1e-12)),
                        axis=0,
                    )
                )
                for parts in (1, 8)
            )
            # The time step is halved three times.
            order = np.log2(coarse / fine) / 3.0
            cells.append(f"{coarse:.1e} ({at_steps:.1e}), {order:.1f}")
        are_within = [run[2] for runs_of_part in runs.values() for run in runs_of_part]
        print(f"| {name} | {' | '.join(cells)} | {sum(are_within)} of {len(are_within)} |")
    are_within = [is_within(errors) for errors in all_errors.values()]
    print(
        f"\n{sum(are_within)} of {len(are_within)} runs within the limit, "
        f"{100.0 * np.mean(are_within):.2f} %"
    )


def print_beyond(all_errors):
    """Print the runs that exceed the limit: the story with the largest excess, and its errors."""
    for (name, method, parts, quantity), errors in all_errors.items():
        if not is_within(errors):
            ratios = errors[0] / limits(errors)
            i = int(np.argmax(ratios))
            sizes = ", ".join(f"{error[i]:.2e}" for error in errors)
            print(
                f"{name}, {method}, dt/{parts}, {quantity} of story {i + 1}: {sizes} "
                f"({ratios[i]:.2f} of the limit)"
            )


if __name__ == "__main__":
    ERRORS = measure()
    for table in sys.argv[1:] or ("runs", "beyond"):
        {"runs": print_runs, "beyond": print_beyond}[table](ERRORS)
        print()
