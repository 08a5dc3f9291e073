"""`tdint info`: rows of the components, figure, usage errors."""

import math

import numpy as np
import pytest

from csv_rows import rows
from facts import each_states
from ground_motion import format_files
from tdint.ground_motion.measures import spectrum_intensity
from tdint.ground_motion.reading.read import read_record
from tdint.response.spectra.elastic import spectrum


def errors(result) -> list[str]:
    return [
        line for line in result.stderr.splitlines() if not line.startswith(("note: ", "Warning: "))
    ]


def test_each_component_has_a_row_in_order(folder, tdint):
    """test_interface.py compares the values with the library."""
    result = tdint("info", "motion.mseed", "other.mseed")
    assert (result.exit_code, errors(result)) == (0, [])
    table = rows(result.stdout)
    assert [(row["record"], row["component"], row["id"]) for row in table] == [
        ("motion.mseed", "HNE", "TD.TEST..HNE"),
        ("motion.mseed", "HNN", "TD.TEST..HNN"),
        ("other.mseed", "HNE", "TD.TEST..HNE"),
    ]
    assert {(row["samples"], row["dt_s"], row["duration_s"]) for row in table} == {
        ("300", "0.01", "2.99")
    }
    row = table[2]
    assert (row["start"], row["units"]) == ("", "m/s^2 (assumed)")
    assert "m/s^2 is assumed" in row["notes"]
    # The peaks of the components differ.
    for name in ("motion.mseed: HNE", "motion.mseed: HNN", "other.mseed"):
        assert f"Warning: {name}: m/s^2 is assumed" in result.stderr
    assert (row["leading_zeros"], row["trailing_zeros"]) == ("0", "0")
    # The Housner intensity does not depend on the number of periods.
    periods = np.linspace(0.1, 2.5, 4801)
    fine = spectrum_intensity(periods, spectrum(read_record("other.mseed"), periods, 0.05).psv)
    assert float(row["housner_intensity_m"]) == pytest.approx(fine, rel=1e-4)


def test_units_and_their_source(folder, tdint, make_record):
    (folder / "a.at2").write_text(format_files.at2())
    (folder / "b.y0a").write_text(format_files.usc())
    make_record(folder / "c.mseed", "HNE", integer=True)
    assert [row["units"] for row in rows(tdint("info", "a.at2", "b.y0a").stdout)] == [
        "g (file)",
        "0.1 g (file)",
    ]
    (row,) = rows(tdint("info", "c.mseed", "--units", "2e-3 gal").stdout)
    assert row["units"] == "2e-3 gal (given)"


@pytest.mark.long
def test_a_record_of_zeros_has_empty_cells_and_a_figure(folder, tdint, drawn):
    (folder / "zero.txt").write_text("# dt = 0.01, units = g\n" + "0\n" * 50)
    (row,) = rows(tdint("info", "zero.txt", "--plot", "zero.png").stdout)
    assert (row["d5_75_s"], row["d5_95_s"], row["housner_intensity_m"], row["leading_zeros"]) == (
        "", "", "0", "50",
    )  # fmt: skip
    assert (row["id"], row["notes"]) == ("", "all samples are zero")
    assert (folder / "zero.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ((), 2, "Missing argument 'RECORD...'"),
        (("-", "-"), 2, "standard input (-) can be read only once"),
        (("other.mseed", "--units", "furlong"), 2, "units 'furlong'"),
        (("other.mseed", "-o", ""), 2, "-o must not be empty"),
    ],
)
def test_usage_errors(folder, tdint, arguments, code, message):
    tdint.refused(message, "info", *arguments, code=code)


@pytest.mark.parametrize(("other", "is_reported"), [("motion.mseed", True), ("other.mseed", False)])
@pytest.mark.long
def test_omitted_components_of_a_figure_are_reported(folder, tdint, other, is_reported):
    messages = [
        line
        for line in tdint("info", "motion.mseed", other, "--plot", "p.svg").stderr.splitlines()
        if "shows" in line
    ]
    assert each_states(messages, ["note: ... first 3 components; 1 are omitted"] * is_reported)


def test_a_name_with_a_formula_after_a_semicolon_is_quoted(folder, tdint):
    """A spreadsheet that separates cells at semicolons would execute the formula. Other programs
    read the unchanged name."""
    (folder / "a;=1+2.mseed").write_bytes((folder / "motion.mseed").read_bytes())
    table = tdint("info", "a;=1+2.mseed", code=0).stdout
    assert table.splitlines()[1].startswith('"a;=1+2.mseed",HNE')
    assert rows(table)[0]["record"] == "a;=1+2.mseed"


def test_long_sampling_intervals_leave_only_spectral_measures_empty(folder, tdint):
    samples = "".join(f"{10 * i},{(-1) ** i}\n" for i in range(20))
    (folder / "slow.csv").write_text("time_s,acceleration_m_s2\n" + samples)
    (row,) = rows(tdint("info", "slow.csv", code=0).stdout)
    assert row["pga_m_s2"] == "1" and row["housner_intensity_m"] == ""


@pytest.mark.parametrize("exported", ["moved.mseed", "moved.csv"])
def test_exported_motions_have_the_same_peaks_between_samples(folder, tdint, exported):
    """The velocity has its maximum of 0.75 m/s between two samples, where it is 0.5 m/s."""
    samples = "".join(f"{i},{value}\n" for i, value in enumerate([0, 0, 1, -1, 0, 0]))
    (folder / "pulse.csv").write_text("time_s,acceleration_m_s2\n" + samples)
    (row,) = rows(tdint("info", "pulse.csv", "--export", exported, code=0).stdout)
    (again,) = rows(tdint("info", exported, code=0).stdout)
    assert row["pgv_m_s"] == again["pgv_m_s"] == "0.75"
    assert row["pgd_m"] == again["pgd_m"]


def test_the_predominant_period_is_the_period_of_the_maximum_response(folder, tdint):
    """The response to a long sine with 5 % damping has its maximum at the period of the sine,
    within the spacing of the periods of 1 %."""
    samples = [f"{math.sin(2.0 * math.pi * 0.01 * k / 0.8):.9f}" for k in range(4000)]
    (folder / "sine.txt").write_text("# dt = 0.01 s, units = m/s^2\n" + "\n".join(samples) + "\n")
    (row,) = rows(tdint("info", "sine.txt", code=0).stdout)
    assert float(row["predominant_period_s"]) == pytest.approx(0.8, rel=0.011)
    assert float(row["mean_period_s"]) == pytest.approx(0.8, rel=1e-3)
    # The sine exceeds 0.05 g in every cycle of the 40 s.
    assert float(row["bracketed_duration_s"]) == pytest.approx(40.0, abs=0.8)
    assert 0.9 < float(row["a95_m_s2"]) < 1.0
