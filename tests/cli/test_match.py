"""`tdint match`: effects of its options."""

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
