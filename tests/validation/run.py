"""Measure the validation cases and write their page: python tests/validation/run.py

The numbers are written to the CSV files in this directory, and README.md is written from them. The
values of cases with missing files (`fetch.py`) or programs are kept. With --page, only the page is
written. With --check, nothing is written: the cases are computed and compared with their
tolerances, and the exit code is 1 if a case exceeds its tolerance.
"""

import argparse
import csv
import dataclasses
import io
import os
import platform
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import opensees
from fetch import SOURCES
from file_cases import berkeley_cases, el_centro_cases, kaikoura_cases
from manufactured import AMPLITUDE, STEPS, Observed, observe_all
from shake_table import shake_table_cases

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # of the tests
import png_text
import tdint
from tdint.assessment.validation.validation import (
    MODEL,
    NUMERICAL,
    ROUNDING,
    ValidationCase,
    ValidationResult,
    closed_form_cases,
    compute_case,
    feature_cases,
    textbook_cases,
)
from tdint.errors import TdintError
from tdint.methods.catalogue import parse

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PAGE = HERE / "README.md"

INTRODUCTION = f"""# Validation

This page compares results of this version with exact solutions, textbook tables, other programs,
published response spectra, and a recorded structure. One command measures the cases and writes this
page, also on your machine, in a few minutes; `tdint validate` runs, in seconds, the cases that need
no additional file:

```
$ python tests/validation/run.py
```

Each case states the cause of its largest difference: **{NUMERICAL}** (of method and step),
**{MODEL}** (a shear building represents the structure only approximately), **{ROUNDING}** (printed
digits, or another value of g). Differences and tolerances without a unit are relative, or those of
dimensionless values. Differences that exceed their tolerance are marked **outside**. All published
and computed values are in [cases.csv](cases.csv).
"""


def stored(name: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file in this directory."""
    with (HERE / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def store(name: str, rows: Iterable[Sequence[str]], heads: Sequence[str]) -> None:
    """Write a CSV file in this directory."""
    with (HERE / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([heads, *rows])


def tdint_command(*arguments: str) -> str:
    """Return the standard output of a command of this installation."""
    done = subprocess.run(
        [sys.executable, "-c", "from tdint_cli.main import main; main()", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONWARNINGS": "ignore"},
    )
    if done.returncode:
        raise RuntimeError(f"tdint {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout


def number(value: float) -> str:
    """Return a number in the format of the page."""
    return f"{value:.7g}" if value else "0"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("|" + "|".join(line) + "|" for line in lines) + "\n"


def case_groups() -> dict[str, tuple[Sequence[ValidationCase], bool]]:
    """Return the cases of each section, and True if their files are here."""
    shake_table = SOURCES["shake-table"]
    return {
        "Exact solutions": (closed_form_cases(), True),
        "Textbooks": (textbook_cases(), True),
        "Features": (feature_cases(), True),
        "El Centro": (el_centro_cases(), SOURCES["elcentro"].here()),
        "Berkeley": (berkeley_cases(), SOURCES["berkeley"].here()),
        "Kaikoura": (kaikoura_cases(), True),
        "Recorded": (shake_table_cases(shake_table.path, tdint_command), shake_table.here()),
    }


def stored_results() -> dict[str, list[ValidationResult]]:
    """Return the stored results of each section."""
    computed: dict[str, list[float]] = {}
    for row in stored("cases"):
        computed.setdefault(row["case"], []).append(float(row["computed"]))
    return {
        section: [
            compute_case(dataclasses.replace(case, computed=partial(computed.get, case.name)))
            for case in group
        ]
        for section, (group, _) in case_groups().items()
    }


# ---- Measurements


def measure_cases() -> None:
    """Compute all cases with their files here, and keep the values of the others."""
    kept = {(row["case"], row["quantity"]): row["computed"] for row in stored("cases")}
    rows = []
    for group, here in case_groups().values():
        for case in group:
            values = (
                [f"{value:.17g}" for value in compute_case(case).computed]
                if here
                else [kept[case.name, quantity] for quantity in case.quantities]
            )
            published = [f"{value:.17g}" for value in case.published]
            rows += [
                [case.name, quantity, case.unit, *pair]
                for quantity, *pair in zip(case.quantities, published, values, strict=True)
            ]
    store("cases", rows, ("case", "quantity", "unit", "published", "computed"))


def measure_orders() -> None:
    """Observe the orders for a linear oscillator, and for manufactured solutions."""
    lines = csv.DictReader(io.StringIO(tdint_command("order", "--frequency-ratio", "0.5")))
    store("orders", [order_row(line) for line in lines], ("method", "declared", *_QUANTITIES))
    steps = [f"T/{steps * 2 * np.pi / (5.0 * 4.0):.0f}" for steps in STEPS]
    store(
        "manufactured",
        [manufactured_row(observed) for observed in observe_all()],
        ("law", "method", "declared", "observed", *steps),
    )


_QUANTITIES = ("displacement", "velocity", "acceleration")


def order_row(line: dict[str, str]) -> list[str]:
    """Return the row of a method from a row of `tdint order`; empty cells are rounding errors."""
    orders = (line[f"{quantity}_order"] for quantity in _QUANTITIES)
    declared = f"{parse(line['method']).order:g}"
    return [line["method"], declared, *(f"{float(order):.2f}" if order else "" for order in orders)]


def manufactured_row(observed: Observed) -> list[str]:
    """Return the row of a method and a law."""
    declared, errors = f"{observed.declared:g}", (f"{error:.1e}" for error in observed.errors)
    return [observed.law, observed.method, declared, f"{observed.order:.2f}", *errors]


def measure_programs() -> None:
    """Compare the peak drifts with OpenSees; without OpenSeesPy, with its stored results."""
    kept, recomputed = opensees.kept(), opensees.recomputed_peaks()
    rows = []
    for name, frame in opensees.problems().items():
        own = opensees.ours(frame)
        theirs = np.asarray(recomputed.get(name, kept[name]["peak_drift_m"]))
        difference = np.max(np.abs(own / theirs - 1.0))
        rows.append([name, frame.what, number(theirs[0]), number(own[0]), f"{difference:.1e}"])
    store("programs", rows, ("model", "description", "opensees_m", "tdint_m", "difference"))


def measure_times() -> None:
    """Draw the work-precision diagram, and store the times at the sampling interval."""
    picture = HERE / "work-precision.png"
    text = tdint_command(*WORK_PRECISION, f"--plot={picture}", "--overwrite")
    png_text.stamp(picture, f"{' '.join(('tdint', *WORK_PRECISION))} --plot={picture.name}")
    store(
        "work_precision",
        [
            [
                row["method"],
                f"{1e3 * float(row['time_s']):.3g}",
                f"{float(row['peak_drift_error']):.1e}",
                "processor time",
                time.strftime("%Y-%m-%d"),
            ]
            for row in csv.DictReader(io.StringIO(text))
            if row["dt_s"] == "0.01"
            and row["outcome"] in ("done", "collapsed")
            and row["peak_drift_error"]
        ],
        ("method", "time_ms", "error", "clock", "date"),
    )


# ---- Sections


def case_table(results: Sequence[ValidationResult], with_source: bool = True) -> str:
    """Return the table of cases."""
    heads = ["case", "description", *["source"] * with_source, "difference", "tolerance", "cause"]
    return table(heads, (case_row(result, with_source) for result in results))


def case_row(result: ValidationResult, with_source: bool) -> list[str]:
    """Return the row of a case: description, largest difference, tolerance and cause."""
    case = result.case
    unit = "" if case.relative or case.unit == "1" else f" {case.unit}"
    remark = f" ({case.remark})" if case.remark else ""
    return [
        f"**{case.name}**",
        case.title,
        *[case.source] * with_source,
        f"{result.largest:.1e}{unit}" + " **outside**" * (not result.within),
        f"{case.tolerance:.1e}{unit}",
        case.difference_is + remark,
    ]


def code_verification(results: Sequence[ValidationResult]) -> str:
    """Return the section on exact solutions and observed orders."""
    orders, manufactured = stored("orders"), stored("manufactured")
    differences = [
        abs(float(row[name]) - float(row["declared"]))
        for row in orders
        for name in _QUANTITIES
        if row[name]
    ]
    worst = max(manufactured, key=lambda row: abs(float(row["observed"]) - float(row["declared"])))
    return (
        "### Exact solutions\n\n" + case_table(results) + "\n### Observed orders\n\n"
        "Linear oscillator under a harmonic force at half the natural frequency, steps T/50 to "
        "T/800, against the exact motion (`tdint order --frequency-ratio 0.5`): the slopes of the "
        f"errors of displacement, velocity and acceleration of {len(orders)} methods differ from "
        f"the declared orders by at most {max(differences):.2f} ([orders.csv](orders.csv)).\n\n"
        f"Manufactured solutions of smooth laws: the motion {AMPLITUDE} sin 5t m is prescribed, "
        "and the force that causes it is applied as harmonics "
        "([manufactured.py](manufactured.py)). The orders of the last two steps with errors above "
        f"rounding, {len(manufactured)} pairs of a method and a law, differ from the declared "
        "orders by at most "
        f"{abs(float(worst['observed']) - float(worst['declared'])):.2f} (`{worst['method']}`, "
        f"{worst['law']}); errors relative to the amplitude are in "
        "[manufactured.csv](manufactured.csv).\n"
    )


def features(results: Sequence[ValidationResult]) -> str:
    """Return the section on the features of models and the laws."""
    return (
        "Peak drifts and damper forces of two stories under a ground motion of 2.4 s "
        "(5 sin(pi t / 2.4)^2 sin(3.2 pi t) m/s^2, sampled every 0.02 s) by `impulse4` with steps "
        "of 0.005 s (relief valves: 0.0025 s). The published values are those of "
        "[separate_solver.py](separate_solver.py): the classical Runge-Kutta method with steps of "
        "0.2 ms and [second statements of the laws](../separate_laws.py); half of this step "
        "changes them by less than 1e-6. The models are in the file `validation_cases.toml` of the "
        "package.\n\n" + case_table(results, with_source=False)
    )


def other_programs() -> str:
    """Return the section on other programs."""
    heads = ("model", "description", "OpenSees, story 1, m", "tdint", "difference of any story")
    return (
        "Peak drifts at the time steps of equal models with the same method and step: average "
        f"acceleration, 0.01 s, [opensees.py](opensees.py), {opensees.kept()['version']}. "
        f"Differences are {NUMERICAL}: OpenSees iterates to a tolerance of 1e-9 of the largest "
        "inertia force.\n\n" + table(heads, (list(row.values()) for row in stored("programs")))
    )


def work_precision() -> str:
    """Return the section with the work-precision diagram."""
    rows = stored("work_precision")
    return (
        f"`{' '.join(('tdint', *WORK_PRECISION))}`: ten yielding stories, 40 s, {rows[0]['clock']} "
        f"of the time loops, measured {rows[0]['date']}, maximum error of the peak drifts relative "
        "to a reference that a second method confirms.\n\n![Time over error of methods and of "
        "other programs](work-precision.png)\n\n"
        + table(
            ("method", "time at dt 0.01 s, ms", "error of peak drift"),
            ([row["method"], row["time_ms"], row["error"]] for row in rows),
        )
    )


_CHARTED = "newmark-average,central-difference,hht,generalized-alpha,bathe,impulse,impulse4,moment4,gauss4,rk5"  # noqa: E501
WORK_PRECISION = (
    "chart",
    "configs/ten-story-bilinear.yaml",
    *("--method", _CHARTED, "--peers", "--no-cache", "--repeat", "3"),
)
"""The command of the work-precision diagram, without the file."""


def machine() -> str:
    """Return the versions and the machine for this page."""
    import numba
    import obspy
    import scipy

    versions = {
        "tdint": tdint.__version__,
        "Python": platform.python_version(),
        "NumPy": np.__version__,
    }
    versions |= {"SciPy": scipy.__version__, "numba": numba.__version__, "ObsPy": obspy.__version__}
    cores = os.cpu_count()
    text = ", ".join(f"{name} {version}" for name, version in versions.items())
    return f"{text}; {platform.system()} on {platform.machine()}, {cores} processors."


def page() -> str:
    """Return the page of the stored numbers."""
    results = stored_results()
    sections = {
        "Code verification": code_verification(results["Exact solutions"]),
        "Textbooks, and printed results of other programs": case_table(results["Textbooks"]),
        "Features and laws, by a separate solver": features(results["Features"]),
        "Other programs, the same model": other_programs(),
        "Published spectra and measures": "El Centro 1940, Berkeley 2018, and the horizontal "
        "and vertical components of Kaikoura 2016 ([records](../../records/README.md)).\n\n"
        + case_table([*results["El Centro"], *results["Berkeley"], *results["Kaikoura"]]),
        "A recorded structure": case_table(results["Recorded"]),
        "Work-precision diagram": work_precision(),
    }
    found = [result for group in results.values() for result in group]
    outside = [result.case.name for result in found if not result.within]
    verdict = f"{len(found) - len(outside)} of {len(found)} cases are within their tolerances"
    verdict += f"; outside: {', '.join(outside)}" if outside else ""
    contents = "\n".join(f"- [{title}](#{_anchor(title)})" for title in sections)
    body = "\n".join(f"## {title}\n\n{text}" for title, text in sections.items())
    (conditions,) = stored("conditions")
    return (
        f"{INTRODUCTION}\n{verdict}. Measured with {conditions['versions']}\n\n{contents}\n\n{body}"
    )


def _anchor(title: str) -> str:
    return "".join(c for c in title.lower().replace(" ", "-") if c.isalnum() or c == "-")


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--check", action="store_true", help="write nothing; exit code 1 if a case is outside"
    )
    parser.add_argument("--page", action="store_true", help="write only the page")
    arguments = parser.parse_args()
    begin = time.perf_counter()
    if arguments.check:
        groups = [case for group, here in case_groups().values() if here for case in group]
        results = [compute_case(case) for case in groups]
    else:
        if not arguments.page:
            store("conditions", [[machine()]], ["versions"])
            for measure in (measure_cases, measure_orders, measure_programs, measure_times):
                measure()
        PAGE.write_text(page(), encoding="utf-8")
        results = [result for group in stored_results().values() for result in group]
    for result in results:
        if not result.within:
            print(f"{result.case.name}: {result.largest:.3g} is beyond {result.case.tolerance:.3g}")
    print(
        f"{sum(result.within for result in results)} of {len(results)} within, "
        f"{time.perf_counter() - begin:.0f} s"
    )
    return 0 if all(result.within for result in results) else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (TdintError, RuntimeError) as error:
        sys.exit(f"{error}")
