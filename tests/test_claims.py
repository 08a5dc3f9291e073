"""Claims of the paper and sentences of the READMEs with numbers.

Each row of the tables in methods/README and methods/EQUATIONS is measured again by `paper_claims`;
its numbers are read from the page, and its verdict follows from the measured values.
"""

import math
import re
import subprocess
import sys

import numpy as np
import pytest

import paper_claims
import readmes
from as_printed import ENTRIES, MISPRINTS, corrected
from paper_claims import ROUNDING, ROWS, Below
from selection import every
from tdint import read_horizontals, rotated_spectrum
from tdint.methods import impulse

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w])")
LONG = ("Conclusion 8", "Example 2", "Example 3, ranking", "Eqs. 46 to 54")
CLOSED_FORMS = (33, 34, *ENTRIES)


def rows():
    """Return the measured column and the verdict of each row of both tables, by its first cell."""
    text = readmes.digest("claims") + readmes.digest("equations")
    lines = [
        line for line in text.splitlines() if line.startswith("| ") and "| where |" not in line
    ]
    cells = [re.split(r" *\| *", line.strip("| ")) for line in lines]
    return {row[0]: (row[2], row[4]) for row in cells}


@pytest.mark.parametrize(
    "where",
    every(3, [pytest.param(name, marks=[pytest.mark.long] * (name in LONG)) for name in rows()]),
)
def test_row_of_claims_agrees_with_measurement(where):
    """Numbers outside back quotes and references to equations are the measured values, to the
    digits of the page, or upper bounds; the verdict follows from the values."""
    text, verdict = rows()[where]
    row = ROWS[where]
    written = NUMBER.findall(re.sub("`[^`]*`|eqs?[.] [0-9]+( and [0-9]+)?", "", text))
    measured = row.measure()
    assert len(written) == len(measured), (written, measured)
    for number, value in zip(written, measured, strict=True):
        if isinstance(value, Below):
            assert 0.0 <= value < float(number), where
            continue
        digits, _, power = number.partition("e")
        last = 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))
        assert value == pytest.approx(float(number), abs=0.51 * last), (where, number)
    claims = row.claims(*measured)
    assert paper_claims.is_confirmed(row, verdict, claims), (where, verdict)
    # The opposite verdict must not pass.
    opposite = "does not hold" if re.match("holds?\\b", verdict) else "holds"
    assert not paper_claims.is_confirmed(row, opposite, claims), (where, opposite)


def test_every_row_is_measured():
    assert ROWS.keys() == rows().keys()
    for number in (1, 2, 3, 4, 5, 6, 7, 8):
        assert any(where.startswith(f"Conclusion {number}") for where in rows())
    # The equations that the page lists as not checked have no row.
    named = set()
    for where in rows():
        if where.startswith("Eq"):
            first, *more = map(int, re.findall(r"(?<!A)\b\d+", where))
            named |= set(range(first, (more or [first])[0] + 1))
    assert set(range(11, 66)) - named == {27, 28, 30, 55, 56}


# ---- Closed forms of the paper


@pytest.mark.parametrize("number", CLOSED_FORMS)
def test_corrected_closed_form_holds(number):
    assert paper_claims.corrected_deviation(number) < ROUNDING
    as_printed = paper_claims.printed_deviation(number)
    if number in MISPRINTS:
        assert as_printed > 0.05
    else:
        assert as_printed < ROUNDING


@pytest.mark.parametrize("number", [number for number in MISPRINTS if number in CLOSED_FORMS])
def test_each_misprint_alone_is_wrong(number):
    """The equation with all corrections but one deviates from the compiled step."""
    for misprint in MISPRINTS[number]:
        text = corrected(number)
        assert text.count(misprint.correct) == 1 or misprint.description
        text = text.replace(misprint.correct, misprint.printed, 1)
        assert paper_claims.deviation(number, text) > 1e-3, misprint


def test_misprinted_equations_hold_in_special_cases():
    """A12 holds without damping as printed; A13 holds without damping and with critical damping,
    both for any dt; A23 and A31 to A33 hold."""
    assert paper_claims.printed_deviation(58, dampings=(0.0,)) < ROUNDING
    assert paper_claims.printed_deviation(59, dampings=(0.0, 1.0)) < ROUNDING


@pytest.mark.long
def test_each_correction_is_on_page_and_in_docstring():
    documented = " ".join(impulse.__doc__.split())
    for number, misprints in MISPRINTS.items():
        (where,) = [
            name for name in rows() if re.search(rf"\b{number}\b", name) and "energy" not in name
        ]
        entry = re.search(rf"eqs?\. (?:\d+, )?{number} (.*?)(?= eqs?\. \d+ | section )", documented)
        for misprint in misprints:
            correction = misprint.correction()
            assert correction.replace("`", "") in entry[1], correction
            if number in CLOSED_FORMS:
                assert correction in rows()[where][0], correction


# ---- Statements on one page about a table on another page


def page(name):
    return " ".join((readmes.ROOT / name).read_text().split())


def table_row(name, *begin):
    """Return the numbers of the only table row of a page with the given first cells."""
    (row,) = re.findall(
        rf"\| {re.escape(' | '.join(begin))} \|([^\n]*)", (readmes.ROOT / name).read_text()
    )
    return [float(number) for number in re.findall(r"[\d.]+(?:e-\d+)?", row)]


def numbers_in_sentence(name, pattern):
    """Return the numbers in a sentence of a page in their order."""
    (sentence,) = re.finditer(pattern, page(name))
    return [float(number) for number in sentence.groups()]


def test_reliability_of_error_estimates_in_readme():
    text = (
        r"In random buildings, ([\d.]+) % of the drift errors of the default method exceed twice "
        r"the estimate, and ([\d.]+) % of the errors of all quantities"
    )
    (row,) = re.findall(
        # Seven columns; the table of the separate solver has six.
        r"^\| impulse4 \| ([\d.]+) /[^|\n]*(?:\|[^|\n]*){5}\| ([\d.]+) / [\d.]+ \|$",
        (readmes.ROOT / "tests/MEASUREMENTS.md")
        .read_text()
        .partition("## Reliability of error")[2],
        re.MULTILINE,
    )
    assert numbers_in_sentence("README.md", text) == [float(number) for number in row]


def test_speed_of_default_method_on_methods_page():
    text = (
        r"fastest method in (\d+), (\d+) and (\d+) of 14 yielding buildings, and takes on average "
        r"([\d.]+), ([\d.]+) and ([\d.]+) times the time of the fastest method"
    )
    rows_of_table = [
        table_row("tests/MEASUREMENTS.md", limit) for limit in ("1 %", "0.1 %", "0.01 %")
    ]
    means, counts = zip(*[row[:2] for row in rows_of_table], strict=True)
    assert numbers_in_sentence("src/tdint/methods/README.md", text) == [*counts, *means]
    assert all(sum(row[1::2]) <= 14 for row in rows_of_table)


def test_ratios_in_table_of_ten_yielding_stories():
    """The ratios of errors and the decrease of the error per halving agree with the table."""
    at_step, finer = (
        table_row("tests/MEASUREMENTS.md", "impulse4", dt) for dt in ("0.01", "0.0025")
    )
    average, fine_average = (
        table_row("tests/MEASUREMENTS.md", "newmark-average", dt) for dt in ("0.01", "0.0025")
    )
    assert numbers_in_sentence(
        "tests/MEASUREMENTS.md", r"error is (\d+) times\s+smaller than the error of average"
    ) == [round(average[0] / at_step[0], -2)]
    assert fine_average[1] / at_step[1] == pytest.approx(30.0, rel=0.05)  # "thirty times closer"
    assert at_step[-1] < 0.5 * 4.0 * fine_average[-1]  # "in less than half of the time"
    for method in ("impulse", "bathe", "gauss4", "newmark-average"):
        coarse, fine = (
            table_row("tests/MEASUREMENTS.md", method, dt)[0] for dt in ("0.01", "0.0025")
        )
        assert 1.85 <= math.log2(coarse / fine) / 2.0 <= 2.35
    assert math.log2(at_step[0] / finer[0]) / 2.0 > 3.7
    quarter, half, full = numbers_in_sentence(
        "tests/MEASUREMENTS.md", r"\| moment4 \| (\S+e-\d+) / \S+ \| (\S+) / \S+ \| (\S+) /"
    )
    fell = numbers_in_sentence(
        "src/tdint/methods/README.md",
        r"factors of (\d+) \(rho_inf = 1\) and (\d+); for `impulse4`, the factor is (\d+)",
    )
    assert fell == [
        round(full / half),
        round(half / quarter),
        round((at_step[0] / finer[0]) ** 0.5),
    ]


def test_cost_of_equal_accuracy_in_joss_paper():
    row = re.findall(
        r"\(([\d.]+)\)",
        re.findall(r"\| 1e-5 \|(.*)", (readmes.ROOT / "tests/MEASUREMENTS.md").read_text())[0],
    )
    assert "a twentieth of the computing time of the average-acceleration method" in page(
        ".github/paper/paper.md"
    )
    assert "a four-hundredth of the computing time of OpenSeesPy" in page(".github/paper/paper.md")
    assert (float(row[4]), round(float(row[5]), -2)) == (20, 400)


def test_conservatism_of_target_displacements():
    rows_of_table = [
        table_row("configs/README.md", f"`{name}`")
        for name in ("kaikoura-frame", "three-story-concrete", "ten-story-bilinear")
    ]
    over = [100.0 * (estimate / row[2] - 1.0) for row in rows_of_table for estimate in row[:2]]
    assert numbers_in_sentence("configs/README.md", r"conservative by (\d+) to (\d+) %") == [
        round(min(over)),
        round(max(over)),
    ]


def test_error_on_models_page_equals_table():
    stated = numbers_in_sentence(
        "configs/README.md", r"drifts of `impulse4` are at most ([\d.]+) %"
    )
    assert stated == [
        pytest.approx(100.0 * table_row("tests/MEASUREMENTS.md", "impulse4", "0.01")[1])
    ]


def test_underestimation_of_rotd50_at_samples():
    pair = read_horizontals(readmes.ROOT / "records/kaikoura/WTMC.mseed", units="m/s^2")
    least, exact = (
        rotated_spectrum(pair, np.array([0.04]), percentiles=(50,), maxima=maxima).psa
        for maxima in ("samples", None)
    )
    missed = 100.0 * (1.0 - np.squeeze(least) / np.squeeze(exact))
    text = r"`--maxima samples` would underestimate RotD50 by up to (\d+) %"
    assert numbers_in_sentence("src/tdint/analysis/spectra/README.md", text) == [
        pytest.approx(float(missed), abs=0.5)
    ]


@pytest.mark.slow
def test_table_of_moment4_with_unresolved_modes():
    """The command prints the L2 errors of the table."""
    command = [sys.executable, readmes.ROOT / "tests/benchmarks/moment4.py", "stiff"]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    section = (
        (readmes.ROOT / "tests/MEASUREMENTS.md")
        .read_text()
        .partition("(`stiff`):")[2]
        .partition("## ")[0]
    )
    lines = re.findall(r"^\| ([a-z]\S+) \| (\S+e-.*) \|$", section, re.MULTILINE)
    assert len(lines) == 5
    for method, numbers in lines:
        (line,) = re.findall(rf"^{re.escape(method)} +(.*)$", printed, re.MULTILINE)
        measured = [float(cell.partition("/")[0]) for cell in line.split()]
        assert measured == pytest.approx(
            [float(number) for number in numbers.split(" | ")], rel=0.05
        ), method


# ---- Sources of the numbers of a page


MEASURED_PAGES = (
    "tests/MEASUREMENTS.md",
    "tests/benchmarks/README.md",
    "tests/validation/README.md",
)


def sections(name):
    """Return the sections of a page by their headings of the second level without code blocks; the
    text before the first heading has the empty heading."""
    text = re.sub(r"^```.*?^```", "", (readmes.ROOT / name).read_text(), flags=re.S | re.M)
    head, *parts = re.split(r"^## (.*)$", text, flags=re.M)
    return {"": head, **dict(zip(parts[::2], parts[1::2], strict=True))}


def test_measured_numbers_have_date_or_test():
    """Each section of tests/MEASUREMENTS.md with numbers states the date of the measurement. A
    single command writes the other two pages; it states versions and processor at their head."""
    for heading, text in sections("tests/MEASUREMENTS.md").items():
        if not heading:
            continue
        numbers = NUMBER.findall(re.sub(r"`[^`]*`|\]\([^)]*\)", "", text))
        measured = re.search(r"\*Measured once, 20\d\d-\d\d-\d\d( to 20\d\d-\d\d-\d\d)?\.\*", text)
        assert measured or "pytest" in text or not numbers, heading
    for name in MEASURED_PAGES[1:]:
        head = sections(name)[""]
        assert re.search(r"(Measured|[Ww]ritten) with tdint [\d.]+, Python [\d.]+", head), name
        assert "2 processors" in head, name


def test_summary_repeats_numbers_of_measurements():
    """Each number of a bullet on accuracy or speed is in the section to which the bullet links, as
    the same number or as a percentage of it."""
    summary, measured = sections("tests/README.md"), sections("tests/MEASUREMENTS.md")
    by_anchor = {
        re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-"): text
        for heading, text in measured.items()
    }
    checked = 0
    for bullet in re.split(r"^- ", summary["Accuracy"] + summary["Speed"], flags=re.M)[1:]:
        if anchors := re.findall(r"MEASUREMENTS\.md#([\w-]+)", bullet):
            text = "".join(map(by_anchor.__getitem__, anchors))
            known = {float(number) for number in re.findall(r"\d*\.?\d+(?:e-\d+)?", text)}
            prose = re.sub(r"`[^`]*`|\]\([^)]*\)|\*[^*]*\*", "", bullet)
            for number in map(float, re.findall(r"(?<![\w.])\d+\.?\d*(?:e-\d+)?", prose)):
                assert any(
                    number == pytest.approx(factor * value)
                    for value in known
                    for factor in (1, 100)
                ), (number, bullet)
                checked += 1
    assert checked > 20


def test_measured_numbers_of_readme_have_date():
    for text in (
        r"\d+ packages \(630 MB; a single measurement, ([\d-]+)",
        r"5 to 20 s \(a single measurement, ([\d-]+)",
    ):
        (date,) = re.findall(text, page("README.md"))
        assert re.fullmatch(r"20\d\d-\d\d-\d\d", date)


def test_number_of_runs_within_limit_equals_table():
    section = sections("tests/MEASUREMENTS.md")["Peaks between the steps, of every method"]
    counts = re.findall(r"\| (\d+) of (\d+) \|", section)
    sums = [sum(int(count[i]) for count in counts) for i in (0, 1)]
    assert (
        numbers_in_sentence("tests/MEASUREMENTS.md", r"(\d+) of (\d+) runs are within the limit")
        == sums
    )


def test_readme_states_directory_of_its_run():
    text = page("README.md")
    (directory,) = re.findall(r"\$ tdint run \S+ -o (\S+) --history --plot", text)
    assert f"The directory `{directory}` now contains `stories.csv`, `history.csv`" in text


def test_errors_over_four_samples_on_methods_page():
    """The columns of the table are 1/4, 1/2, 1, 2, 4 and 8 samples in a step, with L2 first."""
    table = sections("tests/MEASUREMENTS.md")[
        "Energy conservation and accuracy of moment4"
    ].partition("(`yielding`)")[2]
    errors = {
        method: float(
            re.search(rf"^\| {method} \|(.*)$", table, re.M)[1].split("|")[4].split("/")[0]
        )
        for method in ("impulse4", "moment4", "newmark-average")
    }
    own, moment, average = numbers_in_sentence(
        "src/tdint/methods/README.md",
        r"L2 errors for ten yielding stories are (\S+) and (\S+); the error of average "
        r"acceleration is (\d+) %",
    )
    assert own == pytest.approx(errors["impulse4"], rel=0.2)
    assert moment == pytest.approx(errors["moment4"], rel=0.2)
    assert average == pytest.approx(100.0 * errors["newmark-average"], rel=0.05)
