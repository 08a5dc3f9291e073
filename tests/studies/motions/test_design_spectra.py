"""Design spectra by name compared with values that were computed and published elsewhere;
design_spectra.csv states the sources."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from tdint.errors import UsageError
from tdint.response.spectra.target import EXAMPLES, read_target
from tdint.units import STANDARD_GRAVITY

VALUES = Path(__file__).with_name("design_spectra.csv")


def _design_spectrum(text):
    """Return the design spectrum of mapped values with SDS = 2/3 Fa SS and SD1 = 2/3 Fv S1 (ASCE
    7-16, 11.4.4 and 11.4.5)."""
    name, _, parameters = text.partition(":")
    if name != "map":
        return text
    values = {
        key: float(value) for key, value in (part.split("=") for part in parameters.split(","))
    }
    sds, sd1 = 2.0 / 3.0 * values["fa"] * values["ss"], 2.0 / 3.0 * values["fv"] * values["s1"]
    return f"asce7:sds={sds!r},sd1={sd1!r},tl={values['tl']!r}"


def test_code_spectra_have_published_values():
    with VALUES.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 271
    for row in rows:
        target = read_target(_design_spectrum(row["spectrum"]))
        period, tolerance = float(row["period_s"]), float(row["tolerance_g"])
        value = float(target.at(np.array([period]))[0])
        assert period > 0.0 or value == target.zero
        if row["sa_g"]:
            assert value / STANDARD_GRAVITY == pytest.approx(
                float(row["sa_g"]), abs=tolerance + 1e-9
            ), row
        if row["sd_m"] and period > 0.0:
            assert value * (period / (2.0 * np.pi)) ** 2 == pytest.approx(
                float(row["sd_m"]), rel=1e-8
            ), row


@pytest.mark.parametrize("text", EXAMPLES.values())
def test_tabulated_points_are_on_curve(text):
    target = read_target(text)
    assert target.psa == pytest.approx(target.at(target.periods), rel=1e-14)
    assert target.zero == pytest.approx(float(target.curve(np.array([1e-9]))[0]), rel=1e-6)
    assert target.damping == 0.05
    omega = 2.0 * np.pi / target.periods
    assert target.psv * omega == pytest.approx(target.psa) == target.sd * omega**2


def test_long_period_branch_starts_at_tl():
    """The spectrum decreases as 1/T up to TL and as 1/T^2 from TL to 20 s; the peak ground
    acceleration at period 0 is 0.4 SDS."""
    target = read_target("mcer:sds=1.0,sd1=0.6,tl=12")
    ratios = target.at([0.0, 1.0, 11.0, 12.0, 20.0]) / STANDARD_GRAVITY
    assert ratios == pytest.approx(
        [0.6, 0.9, 0.9 / 11.0, 0.9 / 12.0, 0.9 * 12.0 / 400.0], rel=1e-12
    )
    assert target.periods[-1] == pytest.approx(20.0) and 12.0 in target.periods
    with pytest.raises(UsageError, match="0 to 20 s, got 21"):
        target.at([21.0])


def test_national_annex_and_damping_of_ec8():
    greece = read_target("ec8:type=1,soil=B,ag=0.25g,td=2.5")
    recommended = read_target("ec8:type=1,soil=B,ag=2.4516625m/s^2")
    assert greece.at([2.0]) == pytest.approx(recommended.at([2.0]))
    assert greece.at([3.0]) / recommended.at([3.0]) == pytest.approx(1.25)
    # eta = sqrt(10/(5 + xi)) is not below 0.55, which it reaches at 28.06 %.
    plateaus = [
        read_target(f"ec8:type=1,soil=A,ag=1g,damping={xi}%").at([0.3])[0]
        for xi in (5, 10, 28.1, 40)
    ]
    assert np.array(plateaus) / STANDARD_GRAVITY == pytest.approx(
        [2.5, 2.5 * (10 / 15) ** 0.5, 1.375, 1.375]
    )


@pytest.mark.parametrize("damping", [5, 20])
def test_ec8_spectrum_beyond_four_seconds(damping):
    """EN 1998-1:2004 A.2: up to TE, the spectrum is unchanged; then the displacement is linear up
    to the ground displacement at 10 s. The branches agree at TE within 2.5 / 4 pi^2 over 0.0625;
    type 2 ends at 4 s."""
    target = read_target(f"ec8:type=1,soil=C,ag=0.3g,damping={damping}%")
    ground = 0.025 * 0.3 * STANDARD_GRAVITY * 1.15 * 0.6 * 2.0
    plateau = 2.5 * (10.0 / (5.0 + damping)) ** 0.5 if damping < 28 else 1.375
    periods = np.array([6.0 * (1.0 + 1e-12), 8.0, 10.0])
    displacement = target.at(periods) * (periods / (2.0 * np.pi)) ** 2
    assert displacement == pytest.approx(
        ground * np.array([plateau, 0.5 * (plateau + 1.0), 1.0]), rel=1e-9
    )
    assert target.at([6.0]) / target.at(periods[:1]) == pytest.approx(
        40.0 / np.pi**2 / 4.0, rel=1e-9
    )
    assert target.at([5.0]) == pytest.approx(target.at([2.5]) / 4.0)
    assert target.periods[-1] == pytest.approx(10.0)
    with pytest.raises(UsageError, match="0 to 4 s"):
        read_target("ec8:type=2,soil=C,ag=0.3g").at([4.5])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("asce7", "asce7 requires sds, sd1, tl, such as asce7:sds=1.0"),
        ("asce7:sds=1,sd1=0.6", "asce7 requires tl"),
        ("ASCE7:sds=1,sd1=x,tl=8", "sd1 must be a positive number, got 'x'"),
        ("asce7:sds=1,sd1=0.5,tl=0.5", "tl must be longer than TS = sd1/sds = 0.5 s"),
        ("asce7:sds=1,sds=2,sd1=0.6,tl=8", "sds is specified twice"),
        ("asce7:sds=9.80665,sd1=5.9,tl=8", "at most 5 g, got 9.80665; "),
        ("ec9:type=1", "unknown design spectrum 'ec9' (known: asce7, mcer, ec8"),
        ("ec8:type=3,soil=B,ag=0.25g", "type must be 1 or 2"),
        ("ec8:type=1,soil=F,ag=0.25g", "one of A, B, C, D, E"),
        ("ec8:type=1,soil=B,ag=0.25", "ag must be a number"),
        ("ec8:type=1,soil=B,ag=0.25g,dampin=2%", "did you mean 'damping'"),
        ("ec8:type=1,soil=B,ag=0.25g,tc=3", "tb, tc and td must increase"),
        ("ec8:type=1,soil=B,ag=0.25g,damping=0", "damping must be between"),
    ],
)
def test_invalid_names_and_parameters_are_refused(text, message):
    with pytest.raises(UsageError, match=re.escape(message)):
        read_target(text)


@pytest.mark.parametrize(
    "header", ["T (s),Sa (g)", "Period [s],PSA [g]", "period_s,sa_g", "T,psa_g"]
)
def test_headings_of_target_tables(tmp_path, header):
    file = tmp_path / "target.csv"
    file.write_text(f"{header}\n0,0.4\n0.5,1\n1,0.6\n")
    target = read_target(str(file))
    assert target.periods.tolist() == [0.5, 1.0]
    assert target.psa / STANDARD_GRAVITY == pytest.approx([1.0, 0.6])
    assert target.zero == pytest.approx(0.4 * STANDARD_GRAVITY)


def test_design_spectrum_of_eurocode_8_with_behavior_factor():
    """EN 1998-1, 3.2.2.5: eq. 3.13 to 3.16 with beta 0.2, for type 1 and ground type B."""
    s, tb, tc, td, q, ag = 1.2, 0.15, 0.5, 2.0, 3.0, 0.25
    target = read_target("ec8:type=1,soil=B,ag=0.25g,q=3")
    for period, expected in (
        (0.05, ag * s * (2.0 / 3.0 + 0.05 / tb * (2.5 / q - 2.0 / 3.0))),
        (tb, ag * s * 2.5 / q),
        (tc, ag * s * 2.5 / q),
        (1.0, ag * s * 2.5 / q * tc / 1.0),
        (2.2, ag * s * 2.5 / q * tc * td / 2.2**2),
        (2.3, 0.2 * ag),
        (8.0, 0.2 * ag),
    ):
        value = float(target.at(np.array([period]))[0]) / STANDARD_GRAVITY
        assert value == pytest.approx(expected, rel=1e-9), period
    assert target.zero / STANDARD_GRAVITY == pytest.approx(2.0 / 3.0 * ag * s)
    for text, message in (
        ("q=0.5", "behavior factor q must be at least 1"),
        ("q=3,damping=2%", "remove damping or q"),
    ):
        with pytest.raises(UsageError, match=message):
            read_target(f"ec8:type=1,soil=B,ag=0.25g,{text}")
