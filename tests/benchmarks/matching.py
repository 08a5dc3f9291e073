"""Match the ground motions of `records` to three target spectra, and report the misfits, the
changes of the ground motions, and the time.

    python tests/benchmarks/matching.py [--pairs] [--suite]

`--pairs` matches the two horizontal components of a record together; `--suite` matches the mean
spectrum of all components. The periods are 0.05 to 4 s and the damping ratio is 5 %. Misfits are
computed at 1000 periods; times are processor times of one core.
"""

import argparse
import time

import numpy as np
from common import ROOT

import tdint
from tdint.response.spectra.target import TargetSpectrum, read_target

RECORDS = ROOT / "records"
COMPONENTS = [
    (name, "HN1")
    for name in ("near-fault", "firm-soil", "soft-soil", "kaikoura/WTMC", "kaikoura/HSES")
]
COMPONENTS.insert(4, ("kaikoura/WTMC", "HN2"))
"""File and component of the six ground motions."""


def targets():
    """Yield names and target spectra: two spectra of codes, and a smooth spectrum with its maximum
    near 0.22 s, similar to a uniform hazard spectrum."""
    t = np.geomspace(0.01, 10.0, 400)
    smooth = 9.80665 * (
        0.9 * np.exp(-0.5 * (np.log(t / 0.22) / 0.95) ** 2) + 0.12 * t / (1.0 + t**2.2)
    )
    yield "asce7", read_target("asce7:sds=1,sd1=0.6,tl=8")
    yield "ec8", read_target("ec8:type=1,soil=B,ag=0.3g")
    yield "smooth", TargetSpectrum("smooth", t, smooth)


def print_match(name, match, seconds):
    """Print a line about a match.

    The line contains the misfits, the change of the motion, the maximum change of the final
    displacement divided by the peak ground displacement (PGD), the ratio of the PGD after and
    before, and the processor time.

    Parameters
    ----------
    name : str
        Name of the record and of the target spectrum.
    match : Match
        Result of `tdint.match`.
    seconds : float
        Processor time, s.
    """
    final_changes = [
        abs(after.displacement[-1] - before.displacement[-1]) / np.max(np.abs(before.displacement))
        for after, before in (part.motions for part in match.parts)
    ]
    after, before = match.parts[0].measures
    print(
        f"{name:24s} misfit: maximum {100.0 * match.largest_misfit:.2f} %, mean "
        f"{100.0 * match.mean_misfit:.2f} %; change {match.change:.2f}, change of final "
        f"displacement {max(final_changes):.0e} PGD, PGD x {after.pgd / before.pgd:.2f}, "
        f"{seconds:.1f} s",
        flush=True,
    )


def timed(call, *arguments):
    """Return the result of a call, and its processor time, s."""
    start = time.process_time()
    return call(*arguments), time.process_time() - start


def main():
    """Match the ground motions and print a line for each match or each target spectrum."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--pairs", action="store_true")
    parser.add_argument("--suite", action="store_true")
    options = parser.parse_args()
    if options.pairs:
        for name in ("near-fault", "firm-soil", "kaikoura/WTMC", "kaikoura/HSES"):
            pair = tdint.read_horizontals(RECORDS / f"{name}.mseed", units="m/s^2")
            for title, target in targets():
                print_match(f"{name} {title}", *timed(tdint.match, pair, target))
        return
    records = [
        tdint.read_record(RECORDS / f"{name}.mseed", component=component, units="m/s^2")
        for name, component in COMPONENTS
    ]
    # The first match loads modules and compiled kernels, so that they are not timed.
    tdint.match(records[0], next(targets())[1], periods=(0.5, 1.0))
    if options.suite:
        for title, target in targets():
            matches, seconds = timed(tdint.match_suite, records, target)
            after, before = (
                np.array([getattr(match, name) for match in matches])
                for name in ("psa", "seed_psa")
            )
            misfit = np.mean(after, axis=0) / target.at(matches[0].periods) - 1.0
            misfit = 100.0 * np.abs(misfit)  # %
            # Mean over the periods of the standard deviation of the logarithms over the motions.
            scatter_before, scatter_after = (
                np.mean(np.std(np.log(psa), axis=0, ddof=1)) for psa in (before, after)
            )
            print(
                f"{title:8s} misfit of the mean spectrum: maximum {np.max(misfit):.2f} %, mean "
                f"{np.mean(misfit):.2f} %; scatter {scatter_before:.3f} before, "
                f"{scatter_after:.3f} after; {seconds:.1f} s",
                flush=True,
            )
        return
    results = []
    for (name, component), record in zip(COMPONENTS, records, strict=True):
        for title, target in targets():
            match, seconds = timed(tdint.match, record, target)
            print_match(f"{name} {component} {title}", match, seconds)
            results.append((match.largest_misfit, match.mean_misfit, seconds))
    largest, mean, seconds = np.array(results).T
    print(
        f"{len(results)} cases: median of the maximum misfits {100.0 * np.median(largest):.2f} %, "
        f"maximum {100.0 * np.max(largest):.2f} %; maximum of the mean misfits "
        f"{100.0 * np.max(mean):.2f} %; {np.min(seconds):.1f} to {np.max(seconds):.1f} s"
    )


if __name__ == "__main__":
    main()
