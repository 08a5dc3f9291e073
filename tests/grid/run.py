"""Judge a new covering array.

    python tests/grid/run.py [--seed SEED] [--cases COUNT] [--processes COUNT] [--store]

draws buildings of a covering array until the number of cases is reached; a case is a building with
one method and one time step, so that all methods occur with each law and each load. Every second
case has contacts or stops if its row allows them, and they are counted by method. Without a seed, a
new one is drawn and printed. The exit code is 1 if more values than `ALLOWED` are beyond twice
their estimates, a value is beyond ten times its estimate, or a force is above a strength. The rows
of such buildings are printed as in cases.csv; `--store` adds the buildings to the stored ones.
"""

import argparse
import os
import random
import sys
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from itertools import islice
from pathlib import Path

if "tdint" not in sys.modules:  # the program, not a test
    sys.path.insert(0, str(Path(__file__).parents[1]))
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("TDINT_COMPILE", "wait")

from grid.axes import build, is_allowed
from grid.covering import covering_rows, read, reference, write
from grid.judge import (
    DONE,
    FAILED,
    REFUSED,
    STEPS,
    Verdict,
    attempt,
    judge,
    method_labels,
    model_of,
    motion_of,
)
from grid.solver import solve
from grid.springs import StoryFailureError

ALLOWED = {0.5: 5e-4, 1.0: 5e-4, 2.0: 5e-4, 5.0: 3e-3}
"""Allowed shares of values beyond twice their estimates by time step, sampling intervals."""

MOST = 10.0
"""Largest allowed error divided by its estimate."""

CONTACTS = (
    ("devices", "adjacent building"),
    ("devices", "contact of hertz"),
    ("elements", "with stop"),
    ("law", "stops"),
)
"""Axes and values of rows with contacts or stops."""

_TOLERANCE = 1e-8  # of the first solution of a case
_SEEDS = 8  # buildings that are tried for a row


def has_contact(row):
    """Return True if a row has contacts or stops."""
    return any(row[axis] == name for axis, name in CONTACTS)


def with_contact(row, number):
    """Return a row with one of the contacts in turn; the same row if it allows none."""
    for turn in range(len(CONTACTS)):
        axis, name = CONTACTS[(number + turn) % len(CONTACTS)]
        if is_allowed(changed := {**row, axis: name}):
            return changed
    return row


def cases(seed, count):
    """Yield (row, seed of the building, method, samples): each building has one method. Rows
    continue with further covering arrays until the count is reached."""
    generator, labels, made = random.Random(seed), method_labels(), 0
    while made < count:
        rows = list(covering_rows([], generator.random()))
        methods = generator.sample(labels, len(labels))
        for row in islice(rows, count - made):
            samples = STEPS[(made + made // len(labels)) % len(STEPS)]
            if made % 2 and not has_contact(row):
                row = with_contact(row, made // 2)
            yield row, 1_000_000 * (seed + 1) + 100 * made, methods[made % len(labels)], samples
            made += 1


def method_for(case, model, method, samples):
    """Return the first method from `method` on, in the order of the catalogue, that runs the case;
    `method` if there is none."""
    labels = method_labels()
    start = labels.index(method)
    for label in labels[start:] + labels[:start]:
        options = label, samples * case.interval, case.duration
        response = attempt(model, motion_of(case), *options, check=False)
        if not isinstance(response, tuple) or response[0] not in (REFUSED, FAILED):
            return label
    return method


def judged(entry):
    """Return the verdict on a case with the row and the seed of its building; None instead of the
    verdict if no accurate reference exists.

    A solution with one tolerance suffices, unless a value is beyond its estimate.
    """
    row, seed, method, samples = entry
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for number in range(_SEEDS):
            case = build(row, seed + number)
            model = model_of(case)
            if model is None:
                return row, case.seed, Verdict(method, samples, REFUSED, "the model is refused")
            try:
                peaks = solve(case.model, case.ground, case.interval, case.duration, _TOLERANCE)
            except StoryFailureError:
                continue
            method = method_for(case, model, method, samples)
            verdict = judge(case, peaks, method, samples, model)
            if verdict.beyond or verdict.above_strength:
                peaks = reference(case)
                if peaks is None:
                    continue
                verdict = judge(case, peaks, method, samples, model)
            return row, case.seed, verdict
    return row, seed, None


def features(row, verdict):
    """Return the texts of the method and of the values of a row, for counts."""
    return [f"method {verdict.method}", *(f"{axis} {name}" for axis, name in row.items())]


def report(results):
    """Print the shares, by step, method and feature, and all values beyond; return True if they are
    allowed, and the rows and seeds of the buildings with such values."""
    outcomes, values, beyond, is_right, faulty = Counter(), Counter(), Counter(), True, []
    done, contacts = Counter(), Counter()
    for row, seed, verdict in results:
        outcomes[verdict.outcome if verdict else "no reference"] += 1
        if verdict is None or verdict.outcome != DONE:
            continue
        done[verdict.method] += 1
        contacts[verdict.method] += has_contact(row)
        for group in (verdict.samples, *features(row, verdict)):
            values[group] += verdict.values
            beyond[group] += len(verdict.beyond)
        if verdict.beyond or verdict.above_strength:
            faulty.append((row, seed))
        where = f"seed {seed}, {verdict.method}, {verdict.samples:g} samples"
        for excess in verdict.beyond:
            print(
                f"{where}: {excess.quantity} of story {excess.story + 1}: error {excess.error:.2e},"
                f" estimate {excess.estimate:.2e}, ratio {excess.ratio:.1f}: {row}"
            )
            is_right &= excess.ratio <= MOST
        for story, excess in verdict.above_strength:
            print(f"{where}: force of story {story + 1} {excess:.1e} above the strength: {row}")
            is_right = False
    for group in values:
        if beyond[group]:
            print(f"{group}: {beyond[group]} of {values[group]} values beyond")
    print(", ".join(f"{count} {name}" for name, count in outcomes.items()))
    by_method = ", ".join(f"{name} {contacts[name]} of {done[name]}" for name in sorted(done))
    print(f"contacts or stops in {contacts.total()} of {done.total()} cases: {by_method}")
    for groups in (STEPS[:3], STEPS[3:]):
        total, excess = sum(values[s] for s in groups), sum(beyond[s] for s in groups)
        share = excess / max(total, 1)
        is_right &= share <= ALLOWED[groups[0]]
        steps = "/".join(f"{samples:g}" for samples in groups)
        print(f"{steps} samples: {excess} of {total} values ({share:.3%}) beyond")
    return is_right, faulty


def store(faulty, is_written):
    """Print the rows of cases.csv of buildings, and add them with their references on request."""
    new = [build(row, seed) for row, seed in faulty]
    for case in new:
        print(",".join([str(case.seed), case.digest, *case.row.values()]))
    if new and is_written:
        write([*read(), *((case.row, case.seed, case.digest, reference(case)) for case in new)])


def main():
    """Judge the cases in processes, and print the report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--cases", type=int, default=1600)
    parser.add_argument("--processes", type=int, default=None)
    parser.add_argument("--store", action="store_true")
    options = parser.parse_args()
    seed = random.SystemRandom().randrange(10**6) if options.seed is None else options.seed
    print(f"seed {seed}", flush=True)
    with ProcessPoolExecutor(options.processes) as pool:
        results = list(pool.map(judged, cases(seed, options.cases), chunksize=4))
    is_allowed, faulty = report(results)
    store(faulty, options.store)
    sys.exit(0 if is_allowed else 1)


if __name__ == "__main__":
    main()
