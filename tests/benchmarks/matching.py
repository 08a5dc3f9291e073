"""Match the motions of `records` to three target spectra, and report the misfits, the preserved
properties of the motions, and the time.

    python tests/benchmarks/matching.py [--pairs] [--suite]

Periods from 0.05 to 4 s at 5 % damping, with misfits at 1000 periods; processor time of one core.
"""

import argparse
import time

import numpy as np
from common import ROOT

import tdint
from tdint.analysis.spectra.target import TargetSpectrum, read_target

RECORDS = ROOT / "records"
COMPONENTS = [
    (name, "HN1")
    for name in ("near-fault", "firm-soil", "soft-soil", "kaikoura/WTMC", "kaikoura/HSES")
]
COMPONENTS.insert(4, ("kaikoura/WTMC", "HN2"))


def targets():
    """A code's spectra and a smooth one, as of uniform hazard: largest at .22 s."""
    t = np.geomspace(0.01, 10.0, 400)
    smooth = 9.80665 * (
        0.9 * np.exp(-0.5 * (np.log(t / 0.22) / 0.95) ** 2) + 0.12 * t / (1.0 + t**2.2)
    )
    yield "asce7", read_target("asce7:sds=1,sd1=0.6,tl=8")
    yield "ec8", read_target("ec8:type=1,soil=B,ag=0.3g")
    yield "smooth", TargetSpectrum("smooth", t, smooth)


def told(name, match, seconds):
    """A line of one match."""
    ends = [
        abs(after.displacement[-1] - before.displacement[-1]) / np.max(np.abs(before.displacement))
        for after, before in (part.motions for part in match.parts)
    ]
    after, before = match.parts[0].measures
    print(
        f"{name:24s} largest {100.0 * match.largest_misfit:.2f} %, mean "
        f"{100.0 * match.mean_misfit:.2f} %, change {match.change:.2f}, end {max(ends):.0e} of "
        f"PGD, PGD x {after.pgd / before.pgd:.2f}, {seconds:.1f} s",
        flush=True,
    )


def timed(call, *arguments):
    """Return the result of a call, and its processor time, s."""
    begin = time.process_time()
    return call(*arguments), time.process_time() - begin


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--pairs", action="store_true")
    parser.add_argument("--suite", action="store_true")
    asked = parser.parse_args()
    if asked.pairs:
        for name in ("near-fault", "firm-soil", "kaikoura/WTMC", "kaikoura/HSES"):
            pair = tdint.read_horizontals(RECORDS / f"{name}.mseed", units="m/s^2")
            for title, target in targets():
                told(f"{name} {title}", *timed(tdint.match, pair, target))
        return
    records = [
        tdint.read_record(RECORDS / f"{name}.mseed", component=c, units="m/s^2")
        for name, c in COMPONENTS
    ]
    # The first match loads modules and compiled kernels, so that they are not timed.
    tdint.match(records[0], next(targets())[1], periods=(0.5, 1.0))
    if asked.suite:
        for title, target in targets():
            matches, seconds = timed(tdint.match_suite, records, target)
            after, before = (
                np.array([getattr(match, name) for match in matches])
                for name in ("psa", "seed_psa")
            )
            off = np.mean(after, axis=0) / target.at(matches[0].periods) - 1.0
            scatter = [np.std(np.log(psa), axis=0, ddof=1) for psa in (before, after)]
            off, (wide, after) = 100.0 * np.abs(off), np.mean(scatter, axis=1)
            print(
                f"{title:8s} mean off by {np.max(off):.2f} % at most, {np.mean(off):.2f} % in the "
                "mean;",
                end=" ",
            )
            print(f"scatter {wide:.3f} before, {after:.3f} after; {seconds:.1f} s", flush=True)
        return
    figures = []
    for (name, component), record in zip(COMPONENTS, records, strict=True):
        for title, target in targets():
            match, seconds = timed(tdint.match, record, target)
            told(f"{name} {component} {title}", match, seconds)
            figures.append((match.largest_misfit, match.mean_misfit, seconds))
    largest, mean, seconds = np.array(figures).T
    print(
        f"{len(figures)} cases: largest misfit {100.0 * np.median(largest):.2f} % in the median, "
        f"{100.0 * np.max(largest):.2f} % at most; mean misfit {100.0 * np.max(mean):.2f} % at "
        f"most; {np.min(seconds):.1f} to {np.max(seconds):.1f} s"
    )


if __name__ == "__main__":
    main()
