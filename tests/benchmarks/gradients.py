"""Errors of derivatives compared with their estimates: python tests/benchmarks/gradients.py

For `--buildings` random buildings (`random_buildings.any_building` from `--seed`), each method
computes the derivatives of the peaks with respect to the record scale, a story stiffness and the
mass factor, with the sampling interval as time step. The reference derivatives are central
differences of runs of `impulse4` with 32 time steps per sample, at the same parameter values. A
derivative counts as too uncertain to judge if the central difference of half the width differs by
more than a fifth of the error. The result, for each method: share of derivatives with an error of
more than twice the estimate plus the kink, and median ratio of the estimate to the error.
"""

import argparse
from collections import defaultdict

import numpy as np
from common import ROOT  # noqa: F401  sets the search path

import tdint
from random_buildings import any_building
from tdint.analysis.run.gradient import SIZE

METHODS = (
    *("impulse4", "moment4", "newmark-average", "bathe", "central-difference"),
    *("hht:alpha=-0.1", "generalized-alpha:rho_inf=0.8", "noh-bathe"),
)
NAMES = ("record.scale", "stories[1].stiffness_factor", "mass_factor")
PEAKS = ("peak_drift", "peak_total_shear", "peak_displacement", "peak_absolute_acceleration")
FINE = 32  # time steps per sample of the reference
RESOLUTION = 1e-5  # of the largest derivative of the stories; smaller errors are not judged


def references(model, record, duration):
    """Return central differences of the peaks of two widths, each by name: (parameters, n)."""
    found = []
    for size in (SIZE, 0.5 * SIZE):
        sides = {peak: [] for peak in PEAKS}
        for name in NAMES:
            runs = tdint.run_many(
                model,
                record,
                method="impulse4",
                dt=record.dt / FINE,
                duration=duration,
                vary={name: [1.0 - size, 1.0 + size]},
            )
            for peak, values in sides.items():
                below, above = getattr(runs.stories, peak)
                values.append((above - below) / (2.0 * size))
        found.append({peak: np.array(values) for peak, values in sides.items()})
    return found


def judged(seed):
    """Yield method, peak, and rows of error, estimate and kink of the judged derivatives."""
    content, record = any_building(seed)
    model = tdint.load_model(content)
    duration = 4.0 * record.dt * int(record.duration / (4.0 * record.dt) + 1e-9)
    true, half = references(model, record, duration)
    for method in METHODS:
        try:
            response = tdint.run(
                model, record, method=method, dt=record.dt, duration=duration, gradient=NAMES
            )
        except tdint.TdintError:
            continue
        gradient = response.gradient
        for peak in PEAKS:
            size = np.max(np.abs(true[peak]), axis=1, keepdims=True)
            off = np.abs(getattr(gradient, peak) - true[peak])
            sure = (off > RESOLUTION * size) & (np.abs(true[peak] - half[peak]) < 0.2 * off)
            estimate, kink = getattr(gradient.errors, peak), getattr(gradient.kink, peak)
            rows = np.array([off, estimate, kink])[:, sure & np.isfinite(estimate)]
            yield method, peak, rows.T


def main():
    """Print one line per method and peak."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--buildings", type=int, default=60)
    parser.add_argument("--seed", type=int, default=2_100_000)
    given = parser.parse_args()
    rows = defaultdict(list)
    for seed in range(given.seed, given.seed + given.buildings):
        for method, peak, values in judged(seed):
            rows[method, peak].append(values)
            rows[method, "all"].append(values)
            rows["all", peak].append(values)
            rows["all", "all"].append(values)
    print("method, peak: judged, beyond twice the estimate plus the kink, estimate over error")
    for (method, peak), parts in rows.items():
        off, estimate, kink = np.concatenate(parts).T
        beyond = 100.0 * np.mean(off > 2.0 * estimate + kink)
        print(f"{method}, {peak}: {off.size}, {beyond:.2f} %, {np.median(estimate / off):.2f}")


if __name__ == "__main__":
    main()
