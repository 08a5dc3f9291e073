"""Demands of a suite of pairs, computed without tdint: python tests/pair_demands.py MOTIONS OUT.

MOTIONS is a directory of matched motions in AT2 format (`tdint match --format at2`), OUT the
directory of their runs. The script prints the RotD100 of each pair and the mean drift ratio over
pairs for each rule for the demand of a pair. `annual_losses` computes average annual losses from
the runs of a campaign with events. Only numpy and scipy are used.
"""

import csv
import math
import sys
from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete, lfilter
from scipy.stats import norm

RULES = ("larger", "mean", "separate")
GRAVITY = 9.80665  # m/s^2
PERIODS = (0.2, 0.3, 0.5)  # s
FALLEN = ("collapsed", "failed-story")


def read_at2(path):
    """Return acceleration (m/s^2) and time step (s) of an AT2 file."""
    lines = path.read_text("utf-8").splitlines()
    step = float(lines[3].upper().split("DT=")[1].split()[0].rstrip(","))
    return GRAVITY * np.array(" ".join(lines[4:]).split(), float), step


def displacement(acceleration, dt, period, damping=0.05):
    """Return the relative displacement of an oscillator at the samples, m.

    The discretization of the state equation is exact for an acceleration that is linear between the
    samples (first-order hold).

    Parameters
    ----------
    acceleration : ndarray
        Ground acceleration at the samples, m/s^2.
    dt : float
        Sampling interval, s.
    period : float
        Period of the oscillator, s.
    damping : float
        Damping ratio.
    """
    omega = 2.0 * math.pi / period
    state = np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]])
    system = (state, np.array([[0.0], [-1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1)))
    a, b, c, d, _ = cont2discrete(system, dt, method="foh")
    # The transfer function of a system with two states.
    denominator = np.poly(a)
    numerator = np.poly(a - b @ c) + (d[0, 0] - 1.0) * denominator
    # The motion is zero before its first sample.
    return lfilter(numerator, denominator, np.concatenate([[0.0], acceleration]))


def rotd100(first, second, period):
    """Return RotD100 at a period, m/s^2: the maximum pseudo-acceleration of all directions.

    It is computed from the maximum distance of the displacement from the origin. `first` and
    `second` are AT2 files of the two components.
    """
    (first_motion, dt), (second_motion, _) = read_at2(first), read_at2(second)
    size = min(first_motion.size, second_motion.size)
    paths = [displacement(motion[:size], dt, period) for motion in (first_motion, second_motion)]
    return (2.0 * math.pi / period) ** 2 * float(np.max(np.hypot(*paths)))


def table(path):
    """Return the rows of a CSV file."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def pairs_of(runs, *keys):
    """Return a list of (values of the columns `keys`, runs of both components) for each pair.

    The two runs of a pair follow each other in the rows with the same values.
    """
    groups = {}
    for run in runs:
        groups.setdefault(tuple(run[key] for key in keys), []).append(run)
    return [
        (key, group[start : start + 2])
        for key, group in groups.items()
        for start in range(0, len(group), 2)
    ]


def combined(values, rule):
    """Return the demands that a pair contributes under a rule: one demand, or the demands of both
    components."""
    return {"larger": [max(values)], "mean": [sum(values) / 2.0], "separate": list(values)}[rule]


def mean_drift(runs, rule):
    """Return the mean of the peak drift ratio over the pairs of one building that did not
    collapse."""
    values = [
        value
        for _, pair in pairs_of(runs, "building")
        for value in combined([float(run["peak_drift_ratio"]) for run in pair], rule)
    ]
    return sum(values) / len(values)


def loss_ratio(drift, states):
    """Return the mean loss ratio for a drift ratio.

    It is the sum over the damage states of the probability that the state is reached or exceeded
    times the increase of the loss ratio. `states` has the keys `medians` and `losses` (values by
    state) and `dispersion`.
    """
    probabilities = [
        float(norm.cdf(math.log(drift / median) / states["dispersion"]))
        for median in states["medians"]
    ]
    return float(np.dot(probabilities, np.diff([0.0, *states["losses"][: len(probabilities)]])))


def annual_losses(damage, rule, rates, states, worth):
    """Return the average annual loss of each building: sum of annual rates times mean losses.

    Parameters
    ----------
    damage : list of dict
        Row of each run with building, event, status and drift_ratio.
    rule : str
        Rule for the demand of a pair, one of `RULES`.
    rates, worth : dict
        Annual rate of each event, and value of each building.
    states : dict
        Damage states; see `loss_ratio`.
    """
    losses = {}
    for (building, event), pair in pairs_of(damage, "building", "event"):
        # A pair with a collapse has the loss of a collapse.
        drifts = [
            math.inf if run["status"] in FALLEN else float(run["drift_ratio"]) for run in pair
        ]
        values = [
            states["losses"][-1] if drift == math.inf else loss_ratio(drift, states)
            for drift in combined(drifts, rule)
        ]
        annual = rates[event] * worth[building] * sum(values) / len(values)
        losses[building] = losses.get(building, 0.0) + annual
    return losses


def main(motions, out):
    """Print RotD100 of each pair and the mean drift ratios; see the module docstring."""
    files = sorted(Path(motions).glob("*.at2")) or sorted(Path(motions).glob("*.AT2"))
    for first, second in zip(files[::2], files[1::2], strict=True):
        values = ", ".join(f"{rotd100(first, second, period) / GRAVITY:.4f}" for period in PERIODS)
        print(f"{first.stem}: RotD100 {values} g at {PERIODS} s")
    runs = table(Path(out) / "runs.csv")
    for rule in RULES:
        print(f"mean drift ratio, {rule}: {mean_drift(runs, rule):.6g}")


if __name__ == "__main__":
    main(*sys.argv[1:])
