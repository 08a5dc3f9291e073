"""`tdint spectrum --ductility` and `--strength`: rows, files, the picture, wrong arguments."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

from tdint.analysis.spectra.inelastic import constant_ductility
from tdint.ground_motion.reading.read import read_record

COLUMNS = (
    "record,component,damping,hardening,target_ductility,period_s,yield_strength_ratio,ductility,residual_m,sd_m,"
    "yield_sd_m,yield_psa_m_s2,reduction_factor"
)
PERIODS = ("--period", "0.2", "--period", "1.0")


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_every_component_damping_ductility_and_period_in_order(folder, tdint):
    options = ("--ductility", "4,2", "--damping", "0.02", "--damping", "0.05", *PERIODS)
    result = tdint("spectrum", "motion.mseed", "other.mseed", *options)
    assert result.exit_code == 0
    assert result.stdout.splitlines()[0] == COLUMNS
    keys = ("record", "component", "damping", "target_ductility", "period_s")
    assert [tuple(row[key] for key in keys) for row in rows(result.stdout)] == [
        (record, component, damping, target, period)
        for record, component in (("motion.mseed", "HNE"), ("motion.mseed", "HNN"), ("other.mseed", "HNE"))
        for damping in ("0.02", "0.05")
        for target in ("4", "2")
        for period in ("0.2", "1")
    ]


def test_the_numbers_are_those_of_the_library(folder, tdint):
    table = rows(tdint("spectrum", "other.mseed", *PERIODS, "--ductility", "3", "--hardening", "0.1").stdout)
    (expected,) = constant_ductility(read_record("other.mseed"), [0.2, 1.0], [3.0], hardening=0.1)
    assert {row["hardening"] for row in table} == {"0.1"}
    for column, values in (
        ("yield_strength_ratio", expected.yield_strength_ratio), ("ductility", [3.0, 3.0]),
        ("residual_m", expected.residual), ("sd_m", expected.sd), ("yield_sd_m", expected.yield_displacement),
        ("yield_psa_m_s2", expected.yield_acceleration), ("reduction_factor", expected.reduction_factor),
    ):  # fmt: skip
        np.testing.assert_allclose([float(row[column]) for row in table], values, rtol=1e-8)


def test_ductility_1_is_the_elastic_spectrum(folder, tdint):
    inelastic = rows(tdint("spectrum", "other.mseed", "--periods", "0.05:5:9", "--ductility", "1").stdout)
    elastic = rows(tdint("spectrum", "other.mseed", "--periods", "0.05:5:9").stdout)
    for one, other in zip(inelastic, elastic, strict=True):
        assert float(one["yield_psa_m_s2"]) == pytest.approx(float(other["psa_m_s2"]), rel=1e-6)
        assert float(one["sd_m"]) == pytest.approx(float(other["sd_m"]), rel=1e-6)
        assert (one["ductility"], one["reduction_factor"], one["residual_m"]) == ("1", "1", "0")


def test_given_strengths_are_those_of_found_ductilities(folder, tdint):
    (found,) = rows(tdint("spectrum", "other.mseed", "--period", "0.7", "--ductility", "2.5").stdout)
    (back,) = rows(
        tdint("spectrum", "other.mseed", "--period", "0.7", "--strength", found["yield_strength_ratio"]).stdout
    )
    assert back["target_ductility"] == ""
    assert back["yield_strength_ratio"] == found["yield_strength_ratio"]
    for column in ("ductility", "sd_m", "reduction_factor"):
        assert float(back[column]) == pytest.approx(float(found[column]), rel=1e-8)


@pytest.mark.parametrize("option", [("--ductility", "2,4"), ("--strength", "0.05,0.1"), ("--strength", "0.1")])
def test_files_and_picture(folder, tdint, option):
    records = ("motion.mseed", "other.mseed") * 2
    whole = tdint("spectrum", *records, *PERIODS, *option).stdout
    result = tdint("spectrum", *records, *PERIODS, *option, "--jobs", 2, "-o", "all.csv", "--plot")
    assert (result.exit_code, result.stdout) == (0, "")
    assert (folder / "all.csv").read_text() == whole
    assert (folder / "all.png").read_bytes().startswith(b"\x89PNG")
    settings = json.loads((folder / "all.json").read_text())["settings"]
    assert settings[option[0].lstrip("-")] == [float(number) for number in option[1].split(",")]
    assert settings["hardening"] == 0.0


@pytest.mark.parametrize("option", [("--ductility", "2"), ("--strength", "0.1")])
def test_a_record_of_zeros_is_drawn(folder, tdint, option):
    (folder / "zero.txt").write_text("# dt = 0.01, units = g\n" + "0\n" * 50)
    result = tdint("spectrum", "zero.txt", "--period", "1", *option, "-o", "zero.csv", "--plot")
    assert result.exit_code == 0
    (row,) = rows((folder / "zero.csv").read_text())
    assert row["sd_m"] == "0"
    assert row["ductility"] == ("" if option[0] == "--ductility" else "0")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--ductility", "0.9"], "--ductility"),
        (["--ductility", "2,x"], "--ductility"),
        (["--ductility", ""], "--ductility"),
        (["--ductility", "nan"], "--ductility"),
        (["--strength", "0"], "--strength"),
        (["--strength", "inf"], "--strength"),
        (["--ductility", "2", "--strength", "0.1"], "--ductility and --strength are given"),
        (["--hardening", "0.1"], "--hardening has nothing to act on without --ductility or --strength"),
        (["--ductility", "2", "--hardening", "1"], "--hardening"),
        (["--ductility", "2", "--method", "newmark"], "--method is for elastic spectra"),
        (["--strength", "1", "--maxima", "peer"], "--maxima is for elastic spectra"),
        (["--strength", "1", "--interpolation", "linear"], "--interpolation is for elastic spectra"),
        (["--strength", "1", "--period", "0"], "periods of inelastic spectra must be positive"),
    ],
)
def test_usage_errors(folder, tdint, arguments, message):
    result = tdint("spectrum", "other.mseed", *arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert message in result.stderr
