"""The pages of `tdint ida --report` and `tdint fragility --report`: numbers of the tables, rounded
for reading."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import Command
from cli.test_report import CONFIGS, RECORDS, page, table_with
from csv_rows import rows
from tdint.studies.fragility.fits import fit_capacities

G = 9.80665


@pytest.mark.long
def test_the_page_of_an_ida_has_the_capacities_of_the_table(folder: Path, tdint: Command) -> None:
    """Fractiles by rank and lognormal parameters follow from the capacities of the CSV file."""
    result = tdint(
        "ida",
        CONFIGS / "collapse-prone-frame.yaml",
        *(RECORDS / f"{name}.mseed" for name in ("firm-soil", "near-fault", "soft-soil")),
        *("--threshold", "2%", "--report", "page.html"),
        code=0,
    )
    table = rows(result.stdout)
    found = page("page.html")
    collapse = sorted(float(row["capacity"]) / G for row in table if row["threshold"] == "0.1")
    light = [float(row["capacity"]) / G for row in table if row["threshold"] == "0.02"]

    # The three capacities of the pairs, with the median by rank and interpolated fractiles.
    motion_rows = table_with(found, "collapse (g)")
    assert [row["collapse (g)"] for row in motion_rows] == [
        f"{float(row['capacity']) / G:.4g}" for row in table if row["threshold"] == "0.1"
    ]
    assert [row["at 2 % (g)"] for row in motion_rows] == [f"{value:.4g}" for value in light]
    at_drift = {row["drift ratio (%)"]: row for row in table_with(found, "median (g)")}
    # A row for each tenth of the collapse drift of 10 %; the threshold of 2 % is one of them.
    assert list(at_drift) == [str(percent) for percent in range(1, 11)]
    assert at_drift["2"]["median (g)"] == f"{sorted(light)[1]:.4g}"
    assert at_drift["10"]["median (g)"] == f"{collapse[1]:.4g}"
    low = collapse[0] * (collapse[1] / collapse[0]) ** 0.32  # rank 0.16 (3 - 1) = 0.32
    assert float(at_drift["10"]["fractile 16 (g)"]) == pytest.approx(low, rel=1e-3)

    # The fitted parameters: mean and standard deviation of the logarithms, n - 1.
    fits = {row["threshold"]: row for row in table_with(found, "theta (g)")}
    logarithms = np.log(collapse)
    beta = float(np.std(logarithms, ddof=1))
    theta = math.exp(float(np.mean(logarithms)))
    assert float(fits["10 %"]["theta (g)"]) == pytest.approx(theta, rel=1e-3)
    assert float(fits["10 %"]["beta"]) == pytest.approx(beta, rel=1e-3)
    # 4.3027: 97.5 % quantile of Student's distribution with n - 1 = 2 degrees of freedom
    factor_95 = math.exp(4.3027 * beta / math.sqrt(3.0))
    assert float(fits["10 %"]["theta low (g)"]) == pytest.approx(theta / factor_95, rel=1e-3)
    assert float(fits["10 %"]["theta high (g)"]) == pytest.approx(theta * factor_95, rel=1e-3)
    assert fit_capacities(collapse).theta == pytest.approx(theta, rel=1e-12)

    # The factor of each record at collapse is the capacity divided by the unscaled intensity.
    factors = [float(row["collapse factor"]) for row in motion_rows]
    assert all(0.1 < factor < 10.0 for factor in factors)

    # Building, motions, methods, sources and assumptions; no name of an option's syntax.
    for text in (
        "geometric mean Sa(1.095 s) = ",
        "3 pairs",
        "Building: older four-story frame",
        "Vamvatsikos and Cornell 2002",
        "Baker 2015",
        "bracketed within 5 %",
        "impulse4",
        "Torsion, floor flexibility",
    ):
        assert text in found.text, text
    assert "sa(1.09504)" not in found.text and len(found.sources) == 2
    assert len(table_with(found, "pga (g)")) == 6


def test_a_factor_at_collapse_scales_the_record_to_its_capacity(
    folder: Path, tdint: Command
) -> None:
    tdint(
        "ida shaken.yaml",
        *("motion.mseed", "--component", "HNE", "--units", "m/s^2", "--im", "pga"),
        *("-o", "out", "--report", "page.html"),
        code=0,
    )
    (row,) = table_with(page("page.html"), "collapse (g)")
    runs = rows("out/ida.csv")
    unscaled = float(runs[0]["im"]) / float(runs[0]["scale"]) / G
    assert float(row["collapse factor"]) == pytest.approx(
        float(row["collapse (g)"]) / unscaled, rel=1e-3
    )
    # A single capacity has no dispersion, and the page does not state a fit.
    assert "Fitted fragility functions" not in page("page.html").text


def test_the_page_of_fragility_functions_has_their_intervals(folder: Path, tdint: Command) -> None:
    result = tdint("fragility", CONFIGS / "stripes.csv", "--report", "page.html", code=0)
    (function,) = rows(result.stdout)
    found = page("page.html")
    (shown,) = table_with(found, "beta low")
    theta, beta, theta_error, beta_error = (
        float(function[name]) for name in ("theta", "beta", "theta_error", "beta_error")
    )
    unit = " (g)" if "theta (g)" in shown else ""
    assert shown[f"theta{unit}"] == f"{theta:.4g}" and shown["beta"] == f"{beta:.4g}"
    assert shown[f"theta low{unit}"] == f"{theta * math.exp(-1.96 * theta_error):.4g}"
    assert shown["beta high"] == f"{beta + 1.96 * beta_error:.4g}"
    for text in ("Baker 2015", "maximum likelihood of the numbers of exceedances", "stripes.csv"):
        assert text in found.text, text
    assert len(table_with(found, "counted")) > 3


def test_the_page_of_a_study_contains_its_building_and_motions(
    folder: Path, tdint: Command, make_record: Callable[..., None]
) -> None:
    for samples in (60, 120):
        make_record(folder / f"{samples}.mseed", "HNE", samples=samples)
    tdint(
        "ida shaken.yaml",
        *("motion.mseed", "60.mseed", "120.mseed", "--component", "HNE", "--units", "m/s^2"),
        *("-o", "out"),
        code=0,
    )
    tdint("fragility", "out", "--threshold", "2%", "--report", "page.html", code=0)
    found = page("page.html")
    assert "Building: shaken, 2 stories" in found.text and "newmark-average" in found.text
    assert [row["record"] for row in table_with(found, "pga (g)")] == [
        "motion.mseed",
        "60.mseed",
        "120.mseed",
    ]
    tdint.refused("--report", "fragility", "out", "--im", "sa,pga", "--report", "other.html")
