"""Output in other units than SI: names, values, meanings, and the inverse conversion."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tdint.errors import UsageError
from tdint.output.page import page_units
from tdint.output.summary import in_units
from tdint.units import (
    ACCELERATION,
    FORCE,
    LENGTH,
    MASS,
    SI,
    OutputUnits,
    parse_output_units,
    suffix,
)

US = parse_output_units("kip,in,g")


@pytest.mark.parametrize(
    ("name", "unit", "value", "renamed", "expected"),
    [  # exact by the definitions of inch (0.0254 m), pound (0.45359237 kg) and standard gravity
        ("peak_drift_m", "m", 0.0254, "peak_drift_in", 1.0),
        ("peak_shear_N", "N", 4448.2216152605, "peak_shear_kip", 1.0),
        ("peak_absolute_acceleration_m_s2", "m/s^2", 9.80665, "peak_absolute_acceleration_g", 1.0),
        ("peak_velocity_m_s", "m/s", 0.254, "peak_velocity_in_s", 10.0),
        ("tangent_stiffness_N_m", "N/m", 4448.2216152605 / 0.0254, "tangent_stiffness_kip_in", 1.0),
        ("energy_input_J", "J", 4448.2216152605 * 0.0254, "energy_input_kipin", 1.0),
        ("peak_drift_m_error", "m", 0.0254, "peak_drift_in_error", 1.0),
        ("time_s", "s", 3.0, "time_s", 3.0),
        ("peak_drift_ratio", "1", 0.02, "peak_drift_ratio", 0.02),
        ("dt_over_t", "1", 0.02, "dt_over_t", 0.02),
        ("mass_kg", "kg", 5.0, "mass_kg", 5.0),  # no unit of mass is specified
    ],
)
def test_names_and_numbers(
    name: str, unit: str, value: float, renamed: str, expected: float
) -> None:
    column, factor = US.column(name, unit)
    assert column == renamed
    assert value / factor == pytest.approx(expected, rel=1e-13)


def test_an_acceleration_without_its_own_unit_uses_the_unit_of_length() -> None:
    units = parse_output_units("kN, mm, t")
    assert units.unit("m/s^2") == ("mm/s^2", 0.001)
    assert units.column("mass_kg", "kg") == ("mass_t", 1000.0)
    assert units.unit("J") == units.unit("N*m") == ("kN*m", 1000.0)
    assert parse_output_units("N,mm").unit("J") == ("J", 1.0)
    assert units.column("impulse_Ns", "N*s") == ("impulse_kNs", 1000.0)


@given(
    st.sampled_from(sorted(LENGTH)),
    st.sampled_from(sorted(FORCE)),
    st.sampled_from(sorted(MASS)),
    st.sampled_from(["", *sorted(ACCELERATION)]),
)
def test_column_names_are_unique_and_the_conversion_is_invertible(
    length: str, force: str, mass: str, acceleration: str
) -> None:
    units = parse_output_units(",".join(filter(None, (force, length, mass, acceleration))))
    assert units == OutputUnits(length=length, force=force, mass=mass, acceleration=acceleration)
    names = [
        units.column(f"x{suffix(unit)}", unit)[0]
        for unit in ("m", "s", "N", "kg", "J", "N/m", "m/s", "m/s^2", "Hz")
    ]
    assert len(set(names)) == len(names)
    assert units.unit("N")[1] / units.unit("m")[1] == pytest.approx(units.unit("N/m")[1], rel=1e-15)
    arm = LENGTH["m" if length in ("mm", "cm") else length]
    assert units.unit("N")[1] * arm == pytest.approx(units.unit("J")[1], rel=1e-15)


def test_a_summary() -> None:
    content = {
        "schema": {"name": "tdint run", "version": 1},
        "peaks": {"drift_m": 0.254, "drift_story": 1, "base_shear_N": None},
        "record": {"pga_m_s2": 9.80665, "file": "a_m.csv"},
        "dts_s": [0.1, 0.2],
        "levels_m": [0.0254, 0.0508],
        "settings": {"drift_m": 1.0},
        "meanings": {
            "drift_m": {"meaning": "with base_shear_N", "unit": "m"},
            "base_shear_N": {"meaning": "force", "unit": "N"},
        },
    }
    assert in_units(content, SI) is content
    converted = in_units(
        content, US, {"drift_m": "m", "base_shear_N": "N", "levels_m": "m", "dts_s": "s"}
    )
    assert converted["peaks"] == {
        "drift_in": pytest.approx(10.0),
        "drift_story": 1,
        "base_shear_kip": None,
    }
    assert converted["record"] == {"pga_g": pytest.approx(1.0), "file": "a_m.csv"}
    assert converted["levels_in"] == pytest.approx([1.0, 2.0]) and converted["dts_s"] == [0.1, 0.2]
    assert converted["settings"] == {"drift_m": 1.0, "output_units": "kip,in,kg,g"}
    assert converted["meanings"] == {
        "drift_in": {"meaning": "with base_shear_kip", "unit": "in"},
        "base_shear_kip": {"meaning": "force", "unit": "kip"},
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("in,ft", "two units of length, in and ft"),
        ("", "unknown unit ''"),
        ("s", "unknown unit 's'; known: m, cm,"),
    ],
)
def test_invalid_units_are_refused(text: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        parse_output_units(text)


def test_pages_are_in_kilonewtons_unless_a_unit_was_selected():
    assert page_units(SI).force == "kN"
    assert page_units(US).force == "kip" and page_units(US).length == "in"
