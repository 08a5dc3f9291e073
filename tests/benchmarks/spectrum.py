"""Elastic and rotated spectra against other tools, in one run: python tests/benchmarks/spectrum.py

200 periods from 0.01 to 10 s, 5 % damping, 4001 samples at 0.01 s (records/firm-soil.mseed).
Besides tdint, eqsig and pyrotd are measured by their public functions if they are installed. All
take turns, and the least processor time of the repeats counts.

Errors are those of the pseudo-acceleration by ranges of periods. The truth is a second
implementation (tests/references.py): matrix exponentials of the motion that is linear between its
samples, and Brent's method for the maxima between the samples. Rotated spectra of pyrotd are
compared with those of tdint: the difference is no error of tdint.
"""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec

import numpy as np
from common import ROOT, least

from references import OscillatorResponse
from tdint import read_record, spectrum
from tdint.analysis.defaults import PERIODS
from tdint.analysis.spectra.rotated import rotated_spectrum
from tdint.ground_motion.horizontals import find_horizontals
from tdint.number_parsing import parse_grid

REPEATS = 15
RECORD = ROOT / "records" / "firm-soil.mseed"
DAMPING = 0.05


RANGES = ((0.0, 0.02), (0.02, 0.04), (0.04, 0.1), (0.1, 10.0))
"""Periods, s, the first excluded: 2, 4 and 10 sampling intervals are the bounds."""


def truth(record, periods):
    """Pseudo-accelerations, m/s^2, by matrix exponentials and Brent's method."""
    omegas = 2.0 * np.pi / periods
    responses = [OscillatorResponse(record, omega, DAMPING) for omega in omegas]
    return omegas**2 * np.array([response.largest()[0] for response in responses])


def eqsig(record, periods):
    """Pseudo-accelerations by the class of eqsig, None if it is not installed."""
    if not find_spec("eqsig"):
        return None
    signal = import_module("eqsig").AccSignal

    def work():
        motion = signal(record.acceleration, record.dt)
        motion.generate_response_spectrum(response_times=periods, xi=DAMPING)
        # It has displacements and accelerations; the pseudo-acceleration follows.
        return (2.0 * np.pi / periods) ** 2 * motion.s_d

    return work


def pyrotd(record, periods):
    """Pseudo-accelerations by pyrotd, None if it is not installed."""
    if not find_spec("pyrotd"):
        return None
    module = import_module("pyrotd")
    module.processes = 1
    return lambda: (
        module.calc_spec_accels(record.dt, record.acceleration, 1.0 / periods, DAMPING).spec_accel
    )


def pyrotd_rotated(first, second, periods):
    """RotD0, 50 and 100 by pyrotd, shape (3, k), None if it is not installed."""
    if not find_spec("pyrotd"):
        return None
    module = import_module("pyrotd")
    module.processes = 1

    def work():
        found = module.calc_rotated_spec_accels(
            record_dt,
            first.acceleration,
            second.acceleration,
            1.0 / periods,
            DAMPING,
            percentiles=[0, 50, 100],
        )
        return np.array([found[found.percentile == p].spec_accel for p in (0, 50, 100)])

    record_dt = first.dt
    return work


def fastest(works: dict[str, Callable | None], repeats):
    """Fastest times, s, and the results."""
    works = {name: work for name, work in works.items() if work}
    results = {name: work() for name, work in works.items()}
    return dict(zip(works, least(list(works.values()), repeats), strict=True)), results


def show(times, results, exact, periods, base):
    """Print time and largest error in each range of periods for each tool."""
    for name, seconds in times.items():
        error = np.abs(results[name] / exact - 1.0)
        worst = [np.max(error[..., (low < periods) & (periods <= high)]) for low, high in RANGES]
        parts = ", ".join(
            f"{high:g} s: {value:.1e}" for (_, high), value in zip(RANGES, worst, strict=True)
        )
        print(f"{name:24s} {seconds * 1e3:9.3f} ms {seconds / times[base]:8.2f} x   up to {parts}")


def main():
    """Print the tables."""
    first, second = (read_record(RECORD, component=name, units="m/s^2") for name in ("HN1", "HN2"))
    periods = parse_grid(PERIODS).values()
    times, results = fastest(
        {
            "tdint": lambda: spectrum(first, periods, DAMPING).psa,
            "eqsig": eqsig(first, periods),
            "pyrotd": pyrotd(first, periods),
        },
        REPEATS,
    )
    show(times, results, truth(first, periods), periods, "tdint")
    print()

    motion = find_horizontals([first, second])
    times, results = fastest(
        {
            "tdint --rotd 0,50,100": lambda: rotated_spectrum(motion, periods, DAMPING).psa,
            "pyrotd": pyrotd_rotated(first, second, periods),
        },
        7,
    )
    # The difference from tdint, not an error of tdint: tests/analysis/spectra/test_rotated.py
    # compares its rotated spectra with those of 180 turned motions.
    show(times, results, results["tdint --rotd 0,50,100"], periods, "tdint --rotd 0,50,100")


if __name__ == "__main__":
    main()
