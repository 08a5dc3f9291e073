"""Elastic and rotated spectra against other tools, in one run: python tests/benchmarks/spectrum.py

200 periods from 0.01 to 10 s, 5 % damping, 4001 samples at 0.01 s (records/firm-soil.mseed). Beside
tdint eqsig and pyrotd, where they are installed. All take turns, the fastest of the repeats counts,
in processor time. Errors are those of the pseudo-acceleration against the exact response to the
motion that is linear between its samples, as tdint computes it and
tests/analysis/spectra/test_exact_maxima.py confirms it with matrix exponentials.
"""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec

import numpy as np
from common import ROOT, least

from tdint import read_record, spectrum
from tdint.analysis.defaults import PERIODS
from tdint.analysis.spectra.rotated import rotated_spectrum
from tdint.ground_motion.horizontals import find_horizontals
from tdint.written_numbers import parse_grid

REPEATS = 15
RECORD = ROOT / "records" / "firm-soil.mseed"
DAMPING = 0.05


def eqsig(record, periods):
    """Pseudo-accelerations by eqsig, None if it is not installed."""
    if not find_spec("eqsig"):
        return None
    sdof = import_module("eqsig.sdof")
    return lambda: sdof.pseudo_response_spectra(record.acceleration, record.dt, periods, DAMPING)[2]


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


def show(times, errors, base):
    for name, seconds in times.items():
        print(
            f"{name:34s} {seconds * 1e3:9.3f} ms {seconds / times[base]:8.2f} x   worst error of "
            f"PSA {errors[name]}"
        )


def main():
    """Print the tables."""
    first, second = (read_record(RECORD, component=name, units="m/s^2") for name in ("HN1", "HN2"))
    periods = parse_grid(PERIODS).values()
    exact = spectrum(first, periods, DAMPING).psa
    times, results = fastest(
        {
            "tdint, exact": lambda: spectrum(first, periods, DAMPING).psa,
            "eqsig": eqsig(first, periods),
            "pyrotd": pyrotd(first, periods),
        },
        REPEATS,
    )
    errors = {name: f"{np.max(np.abs(psa / exact - 1.0)):.1e}" for name, psa in results.items()}
    show(times, errors, "tdint, exact")
    print()

    motion = find_horizontals([first, second])
    exact = rotated_spectrum(motion, periods, DAMPING).psa
    times, results = fastest(
        {
            "tdint --rotd 0,50,100": lambda: rotated_spectrum(motion, periods, DAMPING).psa,
            "pyrotd": pyrotd_rotated(first, second, periods),
        },
        7,
    )
    errors = {
        name: ", ".join(f"{error:.1e}" for error in np.max(np.abs(psa / exact - 1.0), axis=1))
        + " (RotD0, 50, 100)"
        for name, psa in results.items()
    }
    show(times, errors, "tdint --rotd 0,50,100")


if __name__ == "__main__":
    main()
