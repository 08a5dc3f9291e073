"""Tests of the removal of an instrument's response, with a StationXML file that the test writes."""

import re

import numpy as np
import pytest

from facts import states
from ground_motion.files import START, counts, trace, wave, write
from tdint.errors import RecordError
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.reading.instrument import read_instruments
from tdint.ground_motion.reading.read import read_record, read_records

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


def response(poles=(), zeros=(), factor=1.0, units="M/S**2", stages=True, taps=None):
    sensor = PolesZerosResponseStage(
        1,
        GAIN / 100,
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
    sensitivity = InstrumentSensitivity(GAIN, 1.0, units, "COUNTS")
    chain = [sensor, digitizer] if stages else []
    if taps:
        delay = 0.01 * (len(taps) // 2)
        decimation |= {"delay": delay, "correction": delay}
        fir = FIRResponseStage(
            3, 1.0, 1.0, "COUNTS", "COUNTS", "NONE", coefficients=taps,
            **{f"decimation_{name}": value for name, value in decimation.items()},
        )  # fmt: skip
        chain.append(fir)
    return Response(instrument_sensitivity=sensitivity, response_stages=chain)


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
    assert any(
        "records M/S, not acceleration" in note for note in read(tmp_path, data, units="M/S").notes
    )


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


def test_response_is_removed_from_every_component(tmp_path):
    inventory = station_xml(tmp_path / "a.xml", "HNE", "HNN")
    path = write(tmp_path / "a.mseed", trace(counts()), trace(2 * counts(), channel="HNN"))
    east, north = read_records(path, inventory=inventory)
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
