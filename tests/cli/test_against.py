"""`tdint spectrum --against`: the difference to a published spectrum, by period and by units of its
columns."""

import json
import re
from pathlib import Path

import pytest

from csv_rows import rows

OPTIONS = ("spectrum", "other.mseed", "--units", "m/s^2")
PERIODS = "0.1,0.2,0.4,0.8"


@pytest.fixture
def spectra(folder, tdint):
    """Rows of the computed spectrum with two damping ratios, also as the file own.csv."""
    tdint(*OPTIONS, "--period", PERIODS, "--damping", "2%,5%", "-o", "own.csv", code=0)
    return rows(Path("own.csv").read_text())


def publish(text):
    Path("published.csv").write_text(text)
    return ("--against", "published.csv")


def test_a_spectrum_has_no_difference_to_itself(spectra, tdint):
    """The difference is zero to twelve digits; the column `damping` identifies the ratios."""
    found = rows(
        tdint(
            *OPTIONS, "--against", "own.csv", "--against-column", "psa_m_s2", "--damping", "5%,2%"
        ).stdout
    )
    assert list(found[0]) == [
        "record", "component", "damping", "period_s", "psa_m_s2", "published_psa_m_s2",
        "relative_difference",
    ]  # fmt: skip
    assert [row["damping"] for row in found[::4]] == ["0.05", "0.02"]
    assert max(abs(float(row["relative_difference"])) for row in found) < 1e-11


@pytest.mark.parametrize(
    ("header", "name", "factor"),
    [
        ("T (s),PSA (g)", "psa_m_s2", 1.0 / 9.80665),
        ("period_s,psa_cm_s2", "psa_m_s2", 100.0),
        ("Period (ms),SD (cm)", "sd_m", 100.0),
        ("period_s,psv_mm_s", "psv_m_s", 1000.0),
    ],
)
def test_units_are_read_from_the_column_name(spectra, tdint, header, name, factor):
    """The published values are 10 % above the computed values, with the longest period first."""
    time_factor = 1000.0 if "ms" in header.partition(",")[0] else 1.0
    lines = [
        f"{time_factor * float(row['period_s'])},{1.1 * factor * float(row[name])}"
        for row in spectra[7:3:-1]
    ]
    found = rows(tdint(*OPTIONS, *publish("\n".join([header, *lines]))).stdout)
    assert [float(row["period_s"]) for row in found] == pytest.approx([0.1, 0.2, 0.4, 0.8])
    for row, own in zip(found, spectra[4:], strict=True):
        assert float(row[name]) == pytest.approx(float(own[name]), rel=1e-11)
        assert float(row["relative_difference"]) == pytest.approx(1.0 / 1.1 - 1.0, abs=1e-9)


def test_periods_must_be_published(spectra, tdint):
    published = publish("period_s,sd_m\n0.1,0.01\n0.4,0.16\n")
    tdint.refused("no period 0.2 s", *OPTIONS, *published, "--period", "0.2")


def test_plot_message_and_summary_of_the_difference(spectra, tdint, drawn):
    values = [1.1, 0.9, 1.0, 1.0]
    lines = [
        f"{row['period_s']},{x * float(row['psa_m_s2'])}\n"
        for row, x in zip(spectra[4:], values, strict=True)
    ]
    published = publish("period_s,psa_m_s2\n" + "".join(lines))
    result = tdint(*OPTIONS, *published, "-o", "difference.csv", "--plot", code=0)
    assert re.search(r"\bpsa\b.* published\.csv .*\+11\.1 % at 0\.2 s", result.stderr)
    assert Path("difference.png").stat().st_size > 10_000
    settings = json.loads(Path("difference.json").read_text())["settings"]
    assert settings["against"] == "published.csv" and len(settings["against_sha256"]) == 64


@pytest.mark.parametrize(
    ("text", "options", "code", "message"),
    [
        ("period_s,psa_g\n1,1\n", (), 4, "at least 2 rows, got 1"),
        ("period,psa_g\n1,1\n2,1\n", (), 4, "column 'period' ... unit"),
        ("f_hz,psa_g\n1,1\n2,1\n", (), 4, "no column of periods"),
        ("period_s,psa\n1,1\n2,1\n", (), 4, "must end with its units (psa_g)"),
        ("period_s,psa_cm\n1,1\n2,1\n", (), 4, "cm is a unit of displacement, not of acceleration"),
        ("period_s,values_g\n1,1\n2,1\n", (), 4, "no column of a spectrum"),
        ("period_s,psa_g,sd_cm\n1,1,1\n2,1,1\n", (), 2, "--against-column: psa_g, sd_cm"),
        ("period_s,psa_g\n1,1\n1,1\n", (), 4, "the period 1 s occurs twice"),
        ("period_s,psa_g\n-1,1\n1,1\n", (), 4, "must not be negative"),
        ("period_s,psa_g\n0,1\n1,-1\n", (), 4, "must not be negative"),
        ("period_s,psa_g\n1,one\n2,1\n", (), 4, ":2: psa_g must be a number, got 'one'"),
        ("period_s,psa_g\n1,1,2\n2,1\n", (), 4, ":2: ... 3 cells, ... 2 columns"),
        (
            "period_s,damping,psa_g\n1,0.1,1\n2,0.1,1\n",
            (),
            4,
            "damping ratio 0.05 not found; the file contains 0.1",
        ),
        ("period_s,psa_g\n1,1\n2,1\n", ("--against-column", "psa"), 4, "rename the column 'psa_g'"),
    ],
)
def test_invalid_published_spectra_are_refused(folder, tdint, text, options, code, message):
    tdint.refused(message, *OPTIONS, *publish(text), *options, code=code)
