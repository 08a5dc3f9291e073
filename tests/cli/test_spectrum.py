"""`tdint spectrum`, elastic and inelastic: rows, files, figures, and valid records together with
invalid records."""

import json

import numpy as np
import pytest

from csv_rows import rows
from tdint.ground_motion.reading.read import read_record
from tdint.response.spectra.elastic import spectrum

COLUMNS = "record,component,damping,period_s,sd_m,psv_m_s,psa_m_s2,sv_m_s,sa_m_s2"
PERIODS = ("--period", "0.2", "--period", "1.0")
UNITS = ("--units", "m/s^2")
EC8 = "ec8:type=1,soil=B,ag=0.25g"
RECORDS = (("motion.mseed", "HNE"), ("motion.mseed", "HNN"), ("other.mseed", "HNE"))


def files(folder) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("command", "targets"),
    [("spectrum", ()), ("spectrum --ductility 4,2", ("4", "2")), ("drift-spectrum", ())],
    ids=["elastic", "inelastic", "drifts"],
)
def test_every_component_damping_ductility_and_period_in_order(folder, tdint, command, targets):
    call = (*command.split(), *PERIODS, "--damping", "0.02", "--damping", "0.05")
    result = tdint(*call, "motion.mseed", "other.mseed", code=0)
    keys = ("record", "component", "damping", "target_ductility", "period_s")
    assert [tuple(row.get(key, "") for key in keys) for row in rows(result.stdout)] == [
        (*component, damping, target, period)
        for component in RECORDS
        for damping in ("0.02", "0.05")
        for target in targets or ("",)
        for period in ("0.2", "1")
    ]


def test_a_selected_option_has_a_column(folder, tdint):
    """A selected option adds a column and an entry in the JSON file."""
    plain = tdint("spectrum", "other.mseed", *PERIODS).stdout.splitlines()
    named = tdint(
        "spectrum other.mseed", *PERIODS, "--maxima", "exact", "--interpolation", "linear"
    ).stdout
    assert named.splitlines() == [
        f"{COLUMNS},maxima,interpolation",
        *(f"{line},exact,linear" for line in plain[1:]),
    ]
    tdint("spectrum", "other.mseed", "--period", "0.05", "--maxima", "peer", "-o", "x.csv", code=0)
    (row,) = rows(folder / "x.csv")
    assert ",".join(row) == f"{COLUMNS},maxima"
    exact = spectrum(read_record("other.mseed"), np.array([0.05]), maxima="peer")
    assert (row["maxima"], float(row["sa_m_s2"])) == ("peer", pytest.approx(exact.sa[0], rel=1e-11))
    settings = json.loads((folder / "x.json").read_text())["settings"]
    assert (settings["maxima"], settings["interpolation"]) == ("peer", "linear")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([], "taken as straight lines, maxima also between the samples"),
        (
            ["--maxima", "peer"],
            "taken as straight lines, maxima at 10 or more time steps per period",
        ),
        (["--method", "newmark-average"], "maxima also between the samples, on the interpolant"),
        (
            ["--interpolation", "band-limited"],
            "taken as free of frequencies above half its sampling rate, maxima",
        ),
    ],
)
def test_the_assumed_motion_between_samples_is_reported(folder, tdint, arguments, text):
    messages = tdint("spectrum", "other.mseed", "--period", "0.05", *arguments).stderr.splitlines()
    (line,) = (line for line in messages if "below a period" in line)
    assert text in line


def test_the_choices_equal_the_options_of_the_library():
    from tdint.ground_motion.processing_steps import INTERPOLATIONS
    from tdint.response.spectra.elastic import MAXIMA
    from tdint_cli.commands.spectrum import command

    choices = {parameter.name: parameter.type for parameter in command.params}
    assert list(choices["maxima"].choices) == list(MAXIMA)
    assert list(choices["interpolation"].choices) == list(INTERPOLATIONS)


@pytest.mark.parametrize("options", [(), PERIODS])
def test_period_zero_is_the_peak_ground_acceleration(folder, tdint, options, drawn):
    """The figure contains the period 0, also together with a target spectrum."""
    arguments = ("--period", "0", *options, "--target", EC8, "-o", "zero.csv", "--plot")
    result = tdint("spectrum", "other.mseed", *arguments, code=0)
    assert "below a period" not in result.stderr
    pga = f"{read_record('other.mseed').pga:.12g}"
    assert [rows(folder / "zero.csv")[0][name] for name in COLUMNS.split(",")[3:]] == [
        "0", "0", "0", pga, "0", pga,
    ]  # fmt: skip
    assert (folder / "zero.png").stat().st_size > 1000


@pytest.mark.parametrize("into", ["all.csv", "out/", "out"])
def test_output_to_a_file_or_a_directory(folder, tdint, into):
    if into == "out":
        (folder / "out").mkdir()
    before = files(folder)
    table = tdint("spectrum", "motion.mseed", "other.mseed", *PERIODS).stdout
    assert (
        tdint("spectrum motion.mseed other.mseed", *PERIODS, "-o", into, "--plot", code=0).stdout
        == ""
    )
    suffixes = ("csv", "json", "png")
    if into == "all.csv":
        assert (folder / "all.csv").read_text() == table
        assert files(folder) - before == {f"all.{suffix}" for suffix in suffixes}
    else:
        assert files(folder / "out") == {
            f"{name}.{suffix}" for name in ("motion", "other") for suffix in suffixes
        }
        parts = [(folder / "out" / name).read_text() for name in ("motion.csv", "other.csv")]
        assert parts[0] + parts[1].removeprefix(COLUMNS + "\n") == table


def test_a_clash_of_names_is_found_before_the_computation(folder, tdint):
    message = (
        "Error: out/x.EW.csv: both a/x.EW and b/x.EW would be written to this file; use -o FILE "
        "for one table of all records, or separate calls with separate directories\n"
    )
    tdint.refused(message, "spectrum", "a/x.EW", "b/x.EW", "-o", "out/", code=6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--periods", "0.1:1"], "neither FIRST:LAST:COUNT"),
        (["--period", "-1"], "--period"),
        (["--period", "inf"], "inf is not a finite number"),
        (["--damping", "1"], "--damping"),
        (["--damping", "-0.1"], "--damping"),
        (["--damping", "nan"], "neither a ratio such as 0.05"),
        (["--plot"], "--plot without a file name requires -o; add -o"),
        (["--method", "newmrk"], "unknown method"),
        (["-", "-"], "standard input (-) can be read only once"),
        (["--units", "furlong"], "units 'furlong'"),
        (["--ductility", "0.9"], "--ductility"),
        (["--ductility", "2,x"], "--ductility"),
        (["--ductility", ""], "--ductility"),
        (["--ductility", "nan"], "--ductility"),
        (["--strength", "0"], "--strength"),
        (["--strength", "inf"], "--strength"),
        (
            ["--ductility", "2", "--strength", "0.1"],
            "--ductility and --strength cannot be used together",
        ),
        (["--ductility", "2", "--hardening", "1"], "--hardening"),
        (["--strength", "1", "--period", "0"], "periods must be positive"),
    ],
)
def test_usage_errors(folder, tdint, arguments, message):
    tdint.refused(message, "spectrum", "other.mseed", *arguments)


def test_an_unstable_method_is_an_error_of_the_analysis(folder, tdint):
    call = ("spectrum", "other.mseed", "--period", "0.01", "--method", "central-difference")
    tdint.refused("Error: other.mseed: central-difference is unstable", *call, code=5)


@pytest.mark.parametrize(
    ("options", "is_reported"),
    [
        ((), False),
        (("--damping", "2%,5%"), True),
        (("--damping", "2%", "--periods", "0.5:1:3"), False),
    ],
)
def test_a_coarse_default_spacing_of_periods_is_reported(folder, tdint, options, is_reported):
    """The default periods have a spacing of 3.5 %, which exceeds half the width of a resonance with
    2 % damping."""
    message = "the spacing of the periods is 3.5 %: with 2 % damping the spectrum may be higher"
    assert (message in tdint("spectrum", "other.mseed", *options, code=0).stderr) == is_reported


@pytest.mark.parametrize(
    ("axes", "label"),
    [("tripartite", "pseudo-velocity PSV (m/s)"), ("adrs", "pseudo-acceleration PSA (g)")],
)
def test_axes_of_a_figure_of_elastic_spectra(folder, tdint, axes, label, drawn):
    tdint("spectrum", "other.mseed", "--axes", axes, "--plot=a.svg", code=0)
    assert label in (folder / "a.svg").read_text(encoding="utf-8")


def test_a_design_spectrum_is_written_and_read_as_a_target(folder, tdint):
    tdint("spectrum", "--target", EC8, "-o", "ec8.csv", "--plot", code=0)
    assert "ec8.png" in files(folder)
    read, named = (
        [
            float(row["psa_m_s2"])
            for row in rows(tdint("spectrum", "--target", target, "--period", "0.3,1,3").stdout)
        ]
        for target in ("ec8.csv", EC8)
    )
    # The spectrum is 2.5 ag S on the plateau to TC = 0.5 s and decreases with 1/T above. The
    # interpolation in logarithms has a small error.
    assert read == pytest.approx(named, rel=2e-4)
    assert named[:2] == pytest.approx(
        [2.5 * 0.25 * 1.2 * 9.80665, 2.5 * 0.25 * 1.2 * 9.80665 * 0.5]
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("other.mseed", "--target", EC8), "--target with records requires --plot"),
        (("other.mseed", "--target", EC8, "--plot=p.png", "--axes", "adrs"), "omit --axes"),
        (
            ("other.mseed", "--target", EC8, "--plot=p.png", "--ductility", "2"),
            "--target has no effect",
        ),
        (("--target", EC8, "--damping", "2%"), "damping of a design spectrum"),
        (("--target", EC8, "--period", "12"), "got 12 to 12 s"),
        (("--target", "ec8:type=1"), "ec8 requires soil, ag"),
    ],
)
def test_invalid_arguments_with_a_target_are_refused(folder, tdint, arguments, message):
    tdint.refused(message, "spectrum", *arguments)


def test_strengths_reproduce_the_computed_ductilities(folder, tdint):
    call = ("spectrum", "other.mseed", "--period", "0.7")
    (found,) = rows(tdint(*call, "--ductility", "2.5").stdout)
    (back,) = rows(tdint(*call, "--strength", found["yield_strength_ratio"]).stdout)
    assert back["target_ductility"] == ""
    assert back["yield_strength_ratio"] == found["yield_strength_ratio"]
    for column in ("ductility", "sd_m", "reduction_factor"):
        assert float(back[column]) == pytest.approx(float(found[column]), rel=1e-8)


@pytest.mark.parametrize(
    "option", [("--ductility", "2,4"), ("--strength", "0.05,0.1"), ("--strength", "0.1")]
)
def test_files_and_figure(folder, tdint, option):
    tdint("spectrum", "other.mseed", *PERIODS, *option, "-o", "all.csv", "--plot", code=0)
    assert (folder / "all.png").read_bytes().startswith(b"\x89PNG")
    settings = json.loads((folder / "all.json").read_text())["settings"]
    assert settings[option[0].lstrip("-")] == [float(number) for number in option[1].split(",")]
    assert settings["hardening"] == 0.0


def test_fourier_spectra(folder, tdint, drawn):
    """The settings are in the JSON file; scale factor, units and smoothing are tested."""
    fourier = ("spectrum", "motion.mseed", *UNITS, "--fourier")
    assert tdint(*fourier, "-o", "f.csv", "--plot", "--scale", "2", code=0).stdout == ""
    table = rows(folder / "f.csv")
    assert {row["bandwidth"] for row in table} == {"40"}
    settings = json.loads((folder / "f.json").read_text())["settings"]
    assert (settings["smoothing"], settings["scale"]) == (40.0, 2.0)
    assert not {"periods", "damping"} & set(settings)
    assert (folder / "f.png").read_bytes().startswith(b"\x89PNG")
    single = rows(tdint(*fourier).stdout)
    twice = [2.0 * float(row["fourier_amplitude_m_s"]) for row in single]
    assert [float(row["fourier_amplitude_m_s"]) for row in table] == pytest.approx(twice, rel=1e-10)
    plain = rows(tdint(*fourier, "--smoothing", "none").stdout)
    assert [row["bandwidth"] for row in plain] == [""] * (2 * 150)
    shown = rows(tdint(*fourier, "--output-units", "cm").stdout)
    assert float(shown[3]["fourier_amplitude_cm_s"]) == pytest.approx(
        50.0 * float(table[3]["fourier_amplitude_m_s"])
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("motion.mseed", *UNITS, "--smoothing", "40"), "--smoothing"),
        (
            ("motion.mseed", *UNITS, "--fourier", "--smoothing", "-1"),
            "must be a positive number, got '-1'",
        ),
        (
            ("motion.mseed", *UNITS, "--fourier", "--smoothing", "1e5"),
            "the bandwidth must be from 1 to 1000",
        ),
        (("--fourier",), "RECORD"),
    ],
)
def test_invalid_fourier_spectra_are_refused(folder, tdint, arguments, message):
    tdint.refused(message, "spectrum", *arguments)
