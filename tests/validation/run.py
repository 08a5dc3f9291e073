"""Write the validation page: python tests/validation/run.py

The page is README.md in this directory, with its figures. Cases with missing files (`fetch.py`) are
replaced by a line that states how to obtain them. With --check, nothing is written: the cases are
computed and compared with their tolerances, and the exit code is 1 if a case exceeds its tolerance.
"""

import argparse
import csv
import io
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
from fetch import SOURCES
from file_cases import berkeley_cases, el_centro_cases, kaikoura_cases
from manufactured import AMPLITUDE, STEPS, observe_all

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # of the tests
import png_text
import tdint
from tdint.assessment.validation.validation import (
    MODEL,
    NUMERICAL,
    ROUNDING,
    ValidationCase,
    ValidationResult,
    all_cases,
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

This page compares results of this version with exact solutions, textbook tables, other programs, published response
spectra, and a recorded structure. One command generates the page, also on your machine, in a few minutes:

```
$ python tests/validation/run.py
```

`tdint validate` runs, in seconds, the cases that need no additional file. Each case states the cause of its difference:
**{NUMERICAL}** (of method and step), **{MODEL}** (a shear building represents the structure only approximately), **{ROUNDING}** (printed
digits, or another value of g). Differences that exceed their tolerance are marked **outside**.
"""  # noqa: E501


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
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def case_text(result: ValidationResult) -> str:
    """Return the text of a case: description and values."""
    case = result.case
    unit = "" if case.unit == "1" else f", {case.unit}"
    size = "relative difference" if case.relative else "difference"
    verdict = "within" if result.within else "**outside**"
    remark = f" ({case.remark})" if case.remark else ""
    text = (
        f"**{case.name}**: {case.title}. Source: {case.source}. Largest {size} "
        f"{result.largest:.1e}, {verdict} {case.tolerance:.1e}: {case.difference_is}{remark}.\n\n"
    )
    numbers = (("published" + unit, case.published), ("computed" + unit, result.computed))
    return text + table(
        ["", *case.quantities], [[name, *map(number, values)] for name, values in numbers]
    )


def cases(results: list[ValidationResult], group: Sequence[ValidationCase]) -> str:
    """Compute the cases of a group and return their text."""
    found = [compute_case(case) for case in group]
    results += found
    return "\n".join(map(case_text, found))


def with_file(
    results: list[ValidationResult], name: str, group: Callable[[], Sequence[ValidationCase]]
) -> str:
    """Return cases that need a fetched file, or the instruction to fetch it."""
    source = SOURCES[name]
    if not source.here():
        return (
            f"The file `{name}` is missing ({source.what}): run `python "
            f"tests/validation/fetch.py {name}`, then generate this page again.\n"
        )
    return cases(results, group())


# ---- Sections


def code_verification(results: list[ValidationResult]) -> str:
    """Return section a of the page, the verification of the code."""
    orders = []
    for row in csv.DictReader(io.StringIO(tdint_command("order", "--frequency-ratio", "0.5"))):
        orders.append(
            [
                row["method"],
                f"{parse(row['method']).order:g}",
                *(_short(row[f"{q}_order"]) for q in _QUANTITIES),
            ]
        )
    observations = observe_all()
    steps = [f"T/{steps * 2 * np.pi / (5.0 * 4.0):.0f}" for steps in (STEPS[0], STEPS[-1])]
    manufactured = [
        [
            observed.law,
            observed.method,
            f"{observed.order:.2f}",
            *(f"{observed.errors[end]:.1e}" for end in (0, -1)),
        ]
        for observed in observations
    ]
    return (
        "### Exact solutions\n\n"
        + cases(results, closed_form_cases())
        + "\n### Observed orders, linear oscillator\n\n"
        "Harmonic force at half the natural frequency, steps T/50 to T/800, against the exact "
        "motion (`tdint order --frequency-ratio 0.5`): slopes of the errors of displacement, "
        "velocity and acceleration.\n\n"
        + table(["method", "declared", *_QUANTITIES], orders)
        + "\n### Manufactured solutions, smooth laws\n\n"
        f"The motion {AMPLITUDE} sin 5t m is prescribed, and the force that causes it is applied "
        "as harmonics ([manufactured.py](manufactured.py)): maximum error of the displacement "
        "divided by the amplitude, and the order of the last two steps with errors above rounding. "
        "T is the period of the motion.\n\n"
        + table(["law", "method", "observed", *steps], manufactured)
    )


_QUANTITIES = ("displacement", "velocity", "acceleration")


def _short(text: str) -> str:
    return f"{float(text):.2f}" if text else "rounding"


def features(results: list[ValidationResult]) -> str:
    """Return section b of the page, the features of models and the laws."""
    return (
        "Peak drifts (m) and damper forces (N) of two stories under a ground motion of 2.4 s "
        "(5 sin(pi t / 2.4)^2 sin(3.2 pi t) m/s^2, sampled every 0.02 s) by `impulse4` with steps "
        "of 0.005 s (relief valves: 0.0025 s). The published values are those of "
        "[separate_solver.py](separate_solver.py): the classical Runge-Kutta method with steps of "
        "0.2 ms and [second statements of the laws](../separate_laws.py); half of this step "
        "changes them by less than 1e-6. The models are in the file `validation_cases.toml` of the "
        "package.\n\n" + cases(results, feature_cases())
    )


def other_programs() -> str:
    """Return section c of the page, the comparison with other programs."""
    import opensees

    kept = opensees.kept()
    recomputed = opensees.recomputed_peaks()
    lines = []
    for name, frame in opensees.problems().items():
        own = opensees.ours(frame)
        theirs = recomputed.get(name, kept[name]["peak_drift_m"])
        worst = float(np.max(np.abs(own / np.asarray(theirs) - 1.0)))
        lines.append([name, frame.what, number(theirs[0]), number(float(own[0])), f"{worst:.1e}"])
    origin = (
        "computed on this machine"
        if recomputed
        else f"stored with {kept['version']}, because OpenSeesPy is not installed"
    )
    return (
        "Peak drifts at the time steps of equal models with the same method and step: average "
        f"acceleration, 0.01 s, [opensees.py](opensees.py). The results of OpenSees were {origin}. "
        f"Differences are {NUMERICAL}: OpenSees iterates to a tolerance of 1e-9 of the largest "
        "inertia force.\n\n"
        + table(
            [
                "model",
                "description",
                "OpenSees, story 1, m",
                "tdint",
                "largest relative difference of a story",
            ],
            lines,
        )
    )


def work_precision() -> str:
    """Return section g of the page, the work-precision diagrams."""
    picture = HERE / "work-precision.png"
    text = tdint_command(*WORK_PRECISION, f"--plot={picture}", "--overwrite")
    command = " ".join(("tdint", *WORK_PRECISION))
    png_text.stamp(picture, f"{command} --plot={picture.name}")
    rows = [row for row in csv.DictReader(io.StringIO(text)) if row["dt_s"] == "0.01"]
    shown_rows = [
        [
            row["method"],
            f"{1e3 * float(row['time_s']):.3g}",
            f"{float(row['peak_drift_error']):.1e}",
        ]
        for row in rows
        if row["outcome"] in ("done", "collapsed") and row["peak_drift_error"]
    ]
    return (
        f"`{command}`: ten yielding stories, 40 s, "
        "processor time of the time loops on this machine (above), maximum error of the peak "
        "drifts relative to a reference that a second method confirms.\n\n![Time over error of "
        "methods and of other programs](work-precision.png)\n\n"
        + table(["method", "time at dt 0.01 s, ms", "error of peak drift"], shown_rows)
    )


_CHARTED = "newmark-average,central-difference,hht,generalized-alpha,bathe,impulse,impulse4,moment4,gauss4,rk5"  # noqa: E501
WORK_PRECISION = (
    "chart",
    "configs/ten-story-bilinear.yaml",
    *("--method", _CHARTED, "--peers", "--no-cache", "--repeat", "3"),
)
"""The command of the work-precision diagram, without the file."""


def recorded_structures(results: list[ValidationResult]) -> str:
    """Return section f of the page, the recorded structures."""
    source = SOURCES["shake-table"]
    if not source.here():
        return (
            f"The file `shake-table` is missing ({source.what}): `python tests/validation/fetch.py "
            "shake-table` explains how to get it.\n"
        )
    import shake_table

    return cases(results, shake_table.shake_table_cases(source.path, tdint_command))


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


def page() -> tuple[str, list[ValidationResult]]:
    """Return the page and the results that it contains."""
    results: list[ValidationResult] = []
    sections = {
        "Code verification": code_verification(results),
        "Textbooks, and printed results of other programs": cases(results, textbook_cases()),
        "Features and laws, by a separate solver": features(results),
        "Other programs, the same model": other_programs(),
        "Published spectra and measures": "### El Centro\n\n"
        + with_file(results, "elcentro", el_centro_cases)
        + "\n### USGS, Berkeley 2018\n\n"
        + with_file(results, "berkeley", berkeley_cases)
        + "\n### GeoNet, Kaikoura 2016\n\nHorizontal HN1 and HN2, vertical HNZ "
        "([records](../../records/README.md)).\n\n" + cases(results, kaikoura_cases()),
        "A recorded structure": recorded_structures(results),
        "Work-precision diagram": work_precision(),
    }
    outside = [result.case.name for result in results if not result.within]
    verdict = f"{len(results) - len(outside)} of {len(results)} cases are within their tolerances"
    verdict += f"; outside: {', '.join(outside)}" if outside else ""
    contents = "\n".join(f"- [{title}](#{_anchor(title)})" for title in sections)
    body = "\n".join(f"## {title}\n\n{text}" for title, text in sections.items())
    return f"{INTRODUCTION}\n{verdict}. Written with {machine()}\n\n{contents}\n\n{body}", results


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
    arguments = parser.parse_args()
    begin = time.perf_counter()
    if arguments.check:
        groups = [*all_cases(), *kaikoura_cases()]
        groups += el_centro_cases() if SOURCES["elcentro"].here() else ()
        groups += berkeley_cases() if SOURCES["berkeley"].here() else ()
        results = [compute_case(case) for case in groups]
    else:
        text, results = page()
        PAGE.write_text(text, encoding="utf-8")
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
