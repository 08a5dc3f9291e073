"""`tdint match`: effects of its options."""

import json
from pathlib import Path

import numpy as np
import pytest

from csv_rows import rows

CALL = ("match", "motion.mseed", "--component", "HNE", "--units", "m/s^2", "-o", "m")
TARGET = ("--target", "ec8:type=1,soil=B,ag=0.2g")


@pytest.mark.usefixtures("folder", "short_matching")
def test_the_maximum_misfit(tdint):
    """A misfit is reported above --max-misfit, and is an error with --require."""
    tdint(*CALL, *TARGET, code=0)
    (row,) = rows("m/matched.csv")
    misfit = float(row["largest_misfit"])
    for limit, code in ((1.01 * misfit, 0), (0.99 * misfit, 5)):
        result = tdint(*CALL, *TARGET, "--overwrite", "--require", "--max-misfit", limit, code=code)
        assert (code == 5) == ("--max-misfit" in result.stderr)


@pytest.mark.usefixtures("folder", "short_matching")
def test_the_range_of_periods(tdint):
    """The misfit is that of the spectrum within --range."""
    Path("flat.csv").write_text("period_s,sa_g\n0.05,0.3\n4,0.3\n")
    found = []
    for periods in ("0.2:0.6", "0.6:1.8"):
        tdint(*CALL, "--target", "flat.csv", "--range", periods, "--overwrite", code=0)
        (row,) = rows("m/matched.csv")
        (motion,) = json.loads(Path("m/matched.json").read_text())["motions"]
        low, high = map(float, periods.split(":"))
        grid = ",".join(f"{period:.6g}" for period in np.geomspace(1.001 * low, 0.999 * high, 40))
        spectrum = rows(tdint("spectrum", f"m/{motion}", "--period", grid, code=0).stdout)
        misfit = max(abs(float(line["psa_m_s2"]) / (0.3 * 9.80665) - 1.0) for line in spectrum)
        assert 0.5 * float(row["largest_misfit"]) < misfit <= 1.001 * float(row["largest_misfit"])
        found.append(row["factor"])
    assert found[0] != found[1]
