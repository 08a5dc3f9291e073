"""Compare the errors of derivatives with their estimates.

    python tests/benchmarks/gradients.py [--buildings N] [--seed N]

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
from common import ROOT  # noqa: F401  adds the directory of random_buildings to the search path

import tdint
from random_buildings import any_building
from tdint.response.runs.gradient import SIZE

METHODS = (
    *("impulse4", "moment4", "newmark-average", "bathe", "central-difference"),
    *("hht:alpha=-0.1", "generalized-alpha:rho_inf=0.8", "noh-bathe"),
)
NAMES = ("record.scale", "stories[1].stiffness_factor", "mass_factor")
PEAKS = ("peak_drift", "peak_total_shear", "peak_displacement", "peak_absolute_acceleration")
FINE = 32  # time steps per sample of the reference
# Minimum error that is judged, divided by the maximum derivative over the stories.
RESOLUTION = 1e-5


def references(model, record, duration):
    """Return reference derivatives of the peaks: central differences of two widths.

    Parameters
    ----------
    model, record : Model, Record
        Building and ground motion.
    duration : float
        Duration of the runs, s.

    Returns
    -------
    list of dict
        For the width of `tdint.run` and for half this width: arrays by name of the peak, shape
        (parameters of `NAMES`, stories).
    """
    derivatives = []
    for size in (SIZE, 0.5 * SIZE):
        differences = {peak: [] for peak in PEAKS}
        for name in NAMES:
            runs = tdint.run_many(
                model,
                record,
                method="impulse4",
                dt=record.dt / FINE,
                duration=duration,
                vary={name: [1.0 - size, 1.0 + size]},
            )
            for peak, values in differences.items():
                below, above = getattr(runs.stories, peak)
                values.append((above - below) / (2.0 * size))
        derivatives.append({peak: np.array(values) for peak, values in differences.items()})
    return derivatives


def judged_errors(seed):
    """Yield the judged derivatives of a random building for each method and peak.

    Methods that fail are omitted.

    Yields
    ------
    method, peak : str
        Name of the method, and name of the peak.
    rows : ndarray, shape (derivatives, 3)
        True error, estimated error and kink (half the difference of the one-sided derivatives).
    """
    content, record = any_building(seed)
    model = tdint.load_model(content)
    # Round down to a multiple of four sampling intervals; 1e-9 allows for rounding errors.
    duration = 4.0 * record.dt * int(record.duration / (4.0 * record.dt) + 1e-9)
    true, with_half_width = references(model, record, duration)
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
            error = np.abs(getattr(gradient, peak) - true[peak])
            uncertainty = np.abs(true[peak] - with_half_width[peak])
            is_certain = (error > RESOLUTION * size) & (uncertainty < 0.2 * error)
            estimate, kink = getattr(gradient.errors, peak), getattr(gradient.kink, peak)
            rows = np.array([error, estimate, kink])[:, is_certain & np.isfinite(estimate)]
            yield method, peak, rows.T


def main():
    """Print a line for each method and peak, and for all methods and all peaks together."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--buildings", type=int, default=60)
    parser.add_argument("--seed", type=int, default=2_100_000)
    options = parser.parse_args()
    rows = defaultdict(list)
    for seed in range(options.seed, options.seed + options.buildings):
        for method, peak, values in judged_errors(seed):
            rows[method, peak].append(values)
            rows[method, "all"].append(values)
            rows["all", peak].append(values)
            rows["all", "all"].append(values)
    print(
        "method, peak: judged derivatives, share with an error above twice the estimate plus the "
        "kink, median of estimate / error"
    )
    for (method, peak), parts in rows.items():
        error, estimate, kink = np.concatenate(parts).T
        exceeding = 100.0 * np.mean(error > 2.0 * estimate + kink)
        ratio = np.median(estimate / error)
        print(f"{method}, {peak}: {error.size}, {exceeding:.2f} %, {ratio:.2f}")


if __name__ == "__main__":
    main()
