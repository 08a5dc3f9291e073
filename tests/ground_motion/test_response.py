"""Tests of the removal of an instrument's response, with a StationXML file that the test writes."""

import re

import numpy as np
import pytest

from facts import states
from ground_motion.files import START, counts, trace, wave, write
from selection import every
from tdint.errors import RecordError
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.reading.instrument import parse_input_unit, read_instruments
from tdint.ground_motion.reading.read import read_horizontals, read_record, read_records

with quiet_import():
    from obspy.core.inventory import Channel, Inventory, Network, Station
    from obspy.core.inventory.response import (
        CoefficientsTypeResponseStage,
        FIRResponseStage,
        InstrumentSensitivity,
        PolesZerosResponseStage,
        Response,
    )

GAIN = 40000.0
"""Counts per m/s^2."""


def response(
    poles=(),
    zeros=(),
    factor=1.0,
    units="M/S**2",
    stages=True,
    taps=None,
    gain=GAIN,
    sensitivity=GAIN,
    sensitivity_units=None,
    frequency=1.0,
):
    sensor = PolesZerosResponseStage(
        1,
        gain / 100,
        1.0,
        units,
        "V",
        "LAPLACE (RADIANS/SECOND)",
        1.0,
        list(zeros),
        list(poles),
        factor,
    )
    decimation = {
        "input_sample_rate": 100.0,
        "factor": 1,
        "offset": 0,
        "delay": 0.0,
        "correction": 0.0,
    }
    digitizer = CoefficientsTypeResponseStage(
        2,
        100.0,
        1.0,
        "V",
        "COUNTS",
        "DIGITAL",
        numerator=[1.0],
        denominator=[],
        **{f"decimation_{name}": value for name, value in decimation.items()},
    )
    stated = sensitivity and InstrumentSensitivity(
        sensitivity, frequency, units if sensitivity_units is None else sensitivity_units, "COUNTS"
    )
    chain = [sensor, digitizer] if stages else []
    if taps:
        delay = 0.01 * (len(taps) // 2)
        decimation |= {"delay": delay, "correction": delay}
        fir = FIRResponseStage(
            3, 1.0, 1.0, "COUNTS", "COUNTS", "NONE", coefficients=taps,
            **{f"decimation_{name}": value for name, value in decimation.items()},
        )  # fmt: skip
        chain.append(fir)
    return Response(instrument_sensitivity=stated, response_stages=chain)


def station_xml(path, *channels, **options):
    """Write a StationXML file with the given channels, which have the same response."""
    instruments = [
        Channel(
            code,
            "00",
            1.0,
            2.0,
            0.0,
            0.0,
            sample_rate=100.0,
            start_date=START - 9,
            response=response(**options),
        )
        for code in channels
    ]
    station = Station("ABC", 1.0, 2.0, 0.0, channels=instruments)
    Inventory([Network("XX", [station])], source="test").write(str(path), format="STATIONXML")
    return path


PULSE = wave(4000) * np.exp(-(((np.arange(4000) - 2000) / 300) ** 2))


def read(folder, data, **options):
    """Return the record of the counts after removal of the response of a file with one channel."""
    path = write(folder / "a.mseed", trace(np.round(data).astype(np.int32)), encoding="INT32")
    return read_record(path, inventory=str(station_xml(folder / "a.xml", "HNE", **options)))


def test_flat_response_divides_by_gain(tmp_path):
    data = counts() + 1234
    record = read(tmp_path, data)
    np.testing.assert_allclose(
        record.acceleration, (data - data.mean()) / GAIN, atol=1e-9 * record.pga
    )
    assert any("zero offset" in note for note in record.notes)
    assert any(note.endswith("a.xml) is removed") for note in record.notes)


@pytest.mark.parametrize(
    ("units", "value"),
    every(
        3,
        [
            ("M/S**2", 1.0),
            ("M/S^2", 1.0),
            ("m/s2", 1.0),
            ("M/S/S", 1.0),
            ("M/(S**2)", 1.0),
            ("m s-2", 1.0),
            ("M*S**-2", 1.0),
            ("m.s^-2", 1.0),
            ("m/s\N{SUPERSCRIPT TWO}", 1.0),
            ("meters/second**2", 1.0),
            ("Metre per second per second", 1.0),
            ("M/SEC2 - Acceleration in meters per second per second", 1.0),
            ("CM/S/S", 1e-2),
            ("cm/sec^2", 1e-2),
            ("GAL", 1e-2),
            ("nm/s**2", 1e-9),
            ("\N{MICRO SIGN}m/s**2", 1e-6),
            ("\N{GREEK SMALL LETTER MU}m/s^2", 1e-6),
            ("micrometers/s2", 1e-6),
            ("G", 9.80665),
            ("mg", 9.80665e-3),
            ("IN/S**2", 0.0254),
        ],
    ),
)
def test_acceleration_in_any_unit(tmp_path, units, value):
    """The gain per unit is the gain per m/s^2 times the value of the unit; the record is equal."""
    gain = GAIN * value
    record = read(tmp_path, PULSE * 1e5, units=units, gain=gain, sensitivity=gain)
    expected = read(tmp_path, PULSE * 1e5)
    np.testing.assert_allclose(
        record.acceleration, expected.acceleration, rtol=1e-9, atol=1e-9 * expected.pga
    )
    assert record.warnings == expected.warnings == ()


@pytest.mark.parametrize(
    ("text", "derivatives", "value"),
    [
        ("M", 0, 1.0), ("nm", 0, 1e-9), ("M/S", 1, 1.0), ("m s-1", 1, 1.0), ("CM/SEC", 1, 1e-2),
        ("millimeters per second", 1, 1e-3), ("feet/s", 1, 0.3048),
    ],
)  # fmt: skip
def test_units_of_velocity_and_displacement(text, derivatives, value):
    unit = parse_input_unit(text)
    assert (unit.derivatives, unit.value, unit.text) == (derivatives, value, text)


@pytest.mark.parametrize(
    "text",
    ["V", "COUNTS", "PA", "RAD/S", "M/M", "", None, "M/S**3", "MS2", "M*S**2", "S/M", "M/S-2", "T"],
)
def test_other_units_are_no_ground_motion(text):
    assert parse_input_unit(text) is None


@pytest.mark.parametrize("units", ["V", "PA", "M/S**3"])
def test_first_stage_must_be_ground_motion(tmp_path, units):
    """ObsPy would evaluate the stage as if its input were a displacement."""
    with pytest.raises(
        RecordError, match="must start with a ground motion.*is in " + re.escape(units)
    ):
        read(tmp_path, counts(), units=units)


def velocity_sensor(corner=0.01):
    """Return poles, zeros and factor of a velocity sensor whose gain is stated at 1 Hz."""
    omega, s = 2 * np.pi * corner, 2j * np.pi
    poles = [omega * (-1 + 1j) / np.sqrt(2), omega * (-1 - 1j) / np.sqrt(2)]
    factor = abs((s - poles[0]) * (s - poles[1]) / s**2)
    return {"poles": poles, "zeros": [0, 0], "factor": factor}


def test_velocity_sensor_in_cm(tmp_path):
    """A velocity of amplitude v at 2 Hz is an acceleration of amplitude 2 pi f v."""
    time, omega = np.arange(4000) * 0.01, 2 * np.pi * 2.0
    envelope = np.exp(-(((time - 20) / 5) ** 2))
    data = 1e7 * envelope * np.sin(omega * time)
    options = velocity_sensor() | {"units": "CM/S"}
    record = read(tmp_path, data, **options)
    expected = 1e7 / GAIN * 0.01 * omega
    assert record.pga == pytest.approx(expected, rel=5e-3)
    warning, _ = record.warnings  # the second one is the unusual peak acceleration
    assert "records CM/S, not acceleration" in warning
    # The response at the corner frequency is 1 / sqrt(2) of the gain, which is no contradiction.
    at_corner = read(tmp_path, data, **options, frequency=0.01)
    assert at_corner.pga == pytest.approx(record.pga, rel=1e-12)


@pytest.mark.parametrize("sensitivity", [GAIN, GAIN / (2 * np.pi * 4.0)], ids=["label", "quantity"])
def test_sensitivity_of_other_quantity_is_compared(tmp_path, sensitivity):
    """A sensitivity per M/S**2 at 4 Hz is the sensitivity per M/S divided by 2 pi f. In some files,
    only the label is wrong."""
    options = velocity_sensor() | {"units": "M/S", "frequency": 4.0}
    record = read(
        tmp_path, counts(), **options, sensitivity=sensitivity, sensitivity_units="M/S**2"
    )
    assert any("sensitivity is stated per M/S**2, but" in text for text in record.warnings)
    with pytest.raises(RecordError, match="contradicts its sensitivity") as error:
        read(
            tmp_path, counts(), **options,
            sensitivity=1.2 * sensitivity, sensitivity_units="M/S**2",
        )  # fmt: skip
    assert "units=" not in str(error.value)


def test_accelerometer_with_sensitivity_labeled_velocity_is_no_velocity_sensor(tmp_path):
    (warning,) = read(tmp_path, counts(), sensitivity_units="M/S").warnings
    assert "sensitivity is stated per M/S, but the response starts with M/S**2" in warning


@pytest.mark.parametrize("ratio", [0.5, 0.94, 1.06, 2.0])
def test_contradictory_sensitivity_is_error(tmp_path, ratio):
    with pytest.raises(RecordError) as error:
        read(tmp_path, counts(), sensitivity=GAIN * ratio)
    for number in (
        f"{GAIN * ratio:.6g} counts",
        f"{GAIN:.6g} counts",
        f"units={1 / (GAIN * ratio):.6g}",
    ):
        assert number in str(error.value)


@pytest.mark.parametrize("ratio", [0.96, 1.04, -1.0])
def test_stages_are_used_if_sensitivity_agrees(tmp_path, ratio):
    record = read(tmp_path, counts(), sensitivity=GAIN * ratio)
    assert (record.pga, record.warnings) == (read(tmp_path, counts()).pga, ())


def test_missing_pole_is_error(tmp_path):
    """The gains agree with the sensitivity, but the response is 40 times the gain."""
    with pytest.raises(RecordError, match=r"give 1\.6e\+06 counts .* of their gains is 40000"):
        read(tmp_path, counts(), factor=40.0)


def test_sensitivity_above_filters_is_compared_with_gains(tmp_path):
    """The filter cos^2(pi f dt) has the amplitude 0.024 at 45 Hz."""
    options = {"taps": [0.25, 0.5, 0.25], "frequency": 45.0}
    assert read(tmp_path, counts(), **options).warnings == ()
    with pytest.raises(RecordError, match="contradicts its sensitivity"):
        read(tmp_path, counts(), **options, gain=1.1 * GAIN)
    with pytest.raises(RecordError, match="contradicts its sensitivity"):
        read(tmp_path, counts(), **options | {"frequency": 35.0})


def test_unchecked_response_is_reported(tmp_path):
    (warning,) = read(tmp_path, counts(), sensitivity=None).warnings
    assert "states no sensitivity" in warning


def test_sensitivity_without_stages_is_proposed_as_units(tmp_path):
    """The proposed units give the motion of the flat response."""
    expected = read(tmp_path, counts())
    with pytest.raises(RecordError, match="sensitivity, 400 counts per GAL") as error:
        read(tmp_path, counts(), stages=False, sensitivity=0.01 * GAIN, units="GAL")
    (units,) = re.findall("`units=([^`]*)`", str(error.value))
    record = read_record(tmp_path / "a.mseed", units=units)
    assert record.pga == pytest.approx(expected.pga, rel=1e-3)
    # An accelerometer has no sensitivity to velocity.
    with pytest.raises(RecordError, match="must contain the stages") as error:
        read(tmp_path, counts(), stages=False, units="M/S")
    assert "units=" not in str(error.value)


def test_frequencies_stopped_by_digital_filter_are_faded_out(tmp_path):
    """Three taps of 1/4, 1/2 and 1/4 multiply the amplitude by cos^2(pi f dt)."""
    taps = [0.25, 0.5, 0.25]
    record = read(tmp_path, 1e8 * np.convolve(PULSE, taps, mode="same"), taps=taps)
    (note,) = (note for note in record.notes if "faded" in note)
    found = re.search(r"faded out from ([\d.]+) to ([\d.]+) Hz", note)
    for text, gain in zip(found.groups(), (np.sqrt(0.5), 0.1), strict=True):
        assert float(text) == pytest.approx(np.arccos(np.sqrt(gain)) / np.pi * 100.0, abs=0.02)
    np.testing.assert_allclose(record.acceleration, 1e8 * PULSE / GAIN, atol=1e-6 * record.pga)
    assert not any(note.startswith("ObsPy") for note in record.notes)


def test_stopped_frequencies_are_not_amplified(tmp_path):
    """Noise in the counts at frequencies that the filter of the instrument removes is not
    amplified."""
    noise = np.random.default_rng(0).integers(-1000, 1000, 4000)
    record = read(tmp_path, noise, taps=[1 / 64, 6 / 64, 15 / 64, 20 / 64, 15 / 64, 6 / 64, 1 / 64])
    assert 1000 / GAIN < record.pga < 3000 / GAIN


def test_motion_at_rest_at_both_ends_is_exact(tmp_path):
    data = np.round(PULSE * 1e8)
    expected = (data - data.mean()) / GAIN
    np.testing.assert_allclose(
        read(tmp_path, data).acceleration, expected, rtol=0, atol=1e-6 * expected.max()
    )


def test_response_of_pole_is_removed(tmp_path):
    """A sensor with one pole at 20 Hz is a low-pass filter, whose output is known in closed
    form."""
    corner = 2 * np.pi * 20.0
    omega, time = 2 * np.pi * 2.0, np.arange(4000) * 0.01
    envelope = np.exp(-(((time - 20) / 5) ** 2))
    seen = corner / (corner + 1j * omega)
    data = 1e8 * envelope * (seen * np.exp(1j * omega * time)).imag
    record = read(tmp_path, data, poles=[-corner], factor=corner)
    expected = 1e8 / GAIN * envelope * np.sin(omega * time)
    # The envelope changes slowly, so that the error of the closed form is the ratio of its rate to
    # the corner frequency.
    np.testing.assert_allclose(record.acceleration, expected, atol=4e-3 * expected.max())
    assert record.pga > 1.003 * np.abs(data).max() / GAIN


def test_response_of_a_pair(tmp_path):
    """The response of each component is removed, as for single components."""
    inventory = station_xml(tmp_path / "a.xml", "HNE", "HNN")
    path = write(tmp_path / "a.mseed", trace(counts()), trace(2 * counts(), channel="HNN"))
    east, north = read_records(path, inventory=inventory)
    pair = read_horizontals(path, inventory=inventory)
    for component, expected in ((pair.first, north), (pair.second, east)):
        np.testing.assert_array_equal(component.acceleration, expected.acceleration)
    np.testing.assert_allclose(north.acceleration, 2 * east.acceleration, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("channel", "start", "options", "message"),
    [
        (
            "HNZ",
            START,
            {},
            r"no response for XX\.ABC\.00\.HNE at 2020.*its channels are XX\.ABC\.00\.HNZ",
        ),
        ("HNE", START - 3600, {}, "has no response for"),
        ("HNE", START, {"stages": False}, "must contain the stages of the response"),
    ],
    ids=["channel", "epoch", "stages"],
)
def test_missing_response_is_reported(tmp_path, channel, start, options, message):
    path = write(tmp_path / "a.mseed", trace(counts(), start=start))
    with pytest.raises(RecordError, match=message):
        read_record(path, inventory=station_xml(tmp_path / "a.xml", channel, **options))


@pytest.mark.parametrize("data", [None, b"", b"no xml", b"<a/>", b"<FDSNStationXML", b"\x80\x04."])
def test_invalid_station_xml_is_refused(tmp_path, data):
    if data is not None:
        (tmp_path / "a.xml").write_bytes(data)
    message = "file not found" if data is None else "the file is empty|cannot be read as StationXML"
    with pytest.raises(RecordError, match=rf"a\.xml: ({message})"):
        read_record(write(tmp_path / "a.mseed", trace(counts())), inventory=tmp_path / "a.xml")


def test_xml_entities_are_refused(tmp_path):
    path = tmp_path / "a.xml"
    text = '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/hostname">]><FDSNStationXML>&b;</FDSNStationXML>'
    for encoding in ("utf-8", "utf-16", "utf-16-be", "utf-8-sig", "latin-1"):
        declared = (
            "" if encoding.startswith("utf") else f'<?xml version="1.0" encoding="{encoding}"?>'
        )
        path.write_bytes((declared + text).encode(encoding))
        with pytest.raises(RecordError, match=r"document type definition|not well-formed"):
            read_instruments(path)
    path.write_bytes(b'<?xml version="1.0" encoding="utf-7"?><a/>')
    with pytest.raises(RecordError, match="cannot be read as StationXML"):
        read_instruments(path)


def test_inventory_is_ignored_if_file_states_units(tmp_path):
    path = write(tmp_path / "a.txt", trace(wave(), ascii={"unit": "CM/S**2"}), format="SLIST")
    record = read_record(path, inventory=station_xml(tmp_path / "a.xml", "HNE"))
    assert (record.units_from, len(record.inputs)) == ("file", 1)
    assert any(states(note, "inventory is not used, ... (CM/S**2)") for note in record.notes)
    np.testing.assert_array_equal(record.acceleration, read_record(path).acceleration)
