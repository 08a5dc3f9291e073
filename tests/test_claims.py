"""Claims of the paper and sentences of the READMEs with numbers.

Each row of the tables in methods/EQUATIONS is measured again by `paper_claims`; its numbers are
read from the page, and its verdict follows from the measured values.
"""

import csv
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
from tdint import read_horizontals, read_record, rotated_spectrum, spectrum
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


# ---- Measured numbers on other pages

PAGES = [
    path
    for path in readmes.ROOT.rglob("*.md")
    if not any(part.startswith(".") for part in path.relative_to(readmes.ROOT).parts)
]


def measured_sections():
    """Return the sections of tests/MEASUREMENTS.md by their anchors, without code blocks."""
    text = (readmes.ROOT / "tests/MEASUREMENTS.md").read_text()
    text = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    _, *parts = re.split(r"^## (.*)$", text, flags=re.M)
    return {
        re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-"): section
        for heading, section in zip(parts[::2], parts[1::2], strict=True)
    }


def linked_sentences(text):
    """Yield each sentence with links to sections of tests/MEASUREMENTS.md, and their anchors."""
    for paragraph in re.split(r"\n\s*\n|^- ", text, flags=re.M):
        for sentence in re.split(r"(?<=[.;:])\s+(?=[A-Z`*])", " ".join(paragraph.split())):
            if anchors := re.findall(r"MEASUREMENTS\.md#([\w-]+)", sentence):
                yield sentence, anchors


def equals_measured(written, values):
    """Return True if a number is one of the values, or a percentage of it. Numbers with a power of
    ten may be rounded."""
    digits, _, power = written.partition("e")
    last = 10.0 ** (int(power) - len(digits.partition(".")[2])) if power else 0.0
    return any(
        float(written) == pytest.approx(factor * value, abs=0.51 * last, rel=1e-9)
        for value in values
        for factor in (1, 100)
    )


def test_sentences_repeat_numbers_of_the_measurements_that_they_name():
    measured, checked = measured_sections(), 0
    for path in PAGES:
        for sentence, anchors in linked_sentences(path.read_text(encoding="utf-8")):
            known = "".join(measured[anchor] for anchor in anchors)
            values = set(map(float, re.findall(r"\d*\.?\d+(?:e-\d+)?", known)))
            prose = re.sub(r"`[^`]*`|\]\([^)]*\)|\*[^*]*\*", "", sentence)
            for written in re.findall(r"(?<![\w.])\d+\.?\d*(?:e-\d+)?", prose):
                assert equals_measured(written, values), (path.name, written, sentence)
                checked += 1
    assert checked > 5


def test_measured_numbers_have_date_or_test():
    """Each section with numbers has a date in the table, or names the test that gives them."""
    table = (readmes.ROOT / "tests/benchmarks/measured.csv").read_text().splitlines()
    names = (row["section"].lower() for row in csv.DictReader(table))
    dated = {re.sub(r"[^\w -]", "", name).replace(" ", "-") for name in names}
    for heading, text in measured_sections().items():
        numbers = NUMBER.findall(re.sub(r"`[^`]*`|\]\([^)]*\)", "", text))
        assert heading in dated or "pytest" in text or not numbers, heading


# ---- Numbers of pages that the program computes


def numbers_in_sentence(name, pattern):
    """Return the numbers in a sentence of a page in their order."""
    text = " ".join((readmes.ROOT / name).read_text().split())
    (sentence,) = re.finditer(pattern, text)
    return [float(number) for number in sentence.groups()]


def test_underestimation_of_rotd50_at_samples():
    pair = read_horizontals(readmes.ROOT / "records/kaikoura/WTMC.mseed", units="m/s^2")
    least, exact = (
        rotated_spectrum(pair, np.array([0.04]), percentiles=(50,), maxima=maxima).psa
        for maxima in ("samples", None)
    )
    missed = 100.0 * (1.0 - np.squeeze(least) / np.squeeze(exact))
    text = r"`--maxima samples` would underestimate RotD50 by up to (\d+) %"
    assert numbers_in_sentence("src/tdint/response/spectra/README.md", text) == [
        pytest.approx(float(missed), abs=0.5)
    ]


@pytest.mark.long
@pytest.mark.parametrize("option", ["maxima peer", "maxima samples", "interpolation band-limited"])
def test_differences_of_spectra_with_other_maxima(option):
    """The largest differences of PSA in the artificial motions agree with the table."""
    name, value = option.split()
    periods = np.geomspace(0.01, 10.0, 200)
    differences = []
    for file in ("firm-soil", "near-fault", "soft-soil"):
        for component in ("HN1", "HN2"):
            path = readmes.ROOT / f"records/{file}.mseed"
            record = read_record(path, units="m/s^2", component=component)
            exact, other = (spectrum(record, periods, **keys).psa for keys in ({}, {name: value}))
            differences.append(100.0 * (np.ravel(other) / np.ravel(exact) - 1.0))
    largest = [
        columns.flat[np.argmax(np.abs(columns))]
        for columns in (np.array(differences), np.array(differences)[:, periods >= 0.1])
    ]
    text = rf"`--{option}` \|[^|]*\| (-?\d+) %; (-?\d+) % \|"
    page = "src/tdint/response/spectra/README.md"
    assert numbers_in_sentence(page, text) == pytest.approx(largest, abs=0.6)


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
