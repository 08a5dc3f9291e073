"""Reading of valid files: formats, components, time gaps and attributes of records."""

import io
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from ground_motion.files import START, counts, need_obspy_data, refused, trace, wave, write
from selection import every
from tdint.errors import RecordError
from tdint.ground_motion.choice import TextLayout
from tdint.ground_motion.reading import contents
from tdint.ground_motion.reading.contents import OBSPY_FORMATS, plugins
from tdint.ground_motion.reading.read import read_record, read_records

FIRM_SOIL = Path(__file__).parents[2] / "records" / "firm-soil.mseed"


@pytest.fixture
def three(tmp_path):
    """Return a file of three components with peaks 1, 2 and 3."""
    traces = [
        trace(wave(peak=peak), channel=f"HN{c}")
        for c, peak in zip("ENZ", (1.0, 2.0, 3.0), strict=True)
    ]
    return write(tmp_path / "three.mseed", *traces)


class TestRecordAttributes:
    def test_miniseed_is_read_with_any_file_name(self, tmp_path, monkeypatch):
        path = write(tmp_path / "record[1]*?.gz", trace(wave()))
        record = read_record(path)
        np.testing.assert_array_equal(record.acceleration, wave())
        assert (record.id, record.component, record.dt) == ("XX.ABC.00.HNE", "HNE", 0.01)
        assert (record.start, record.source) == ("2020-01-02T03:04:05.000000Z", str(path))
        assert (record.units, record.units_from, record.quantity) == (
            "m/s^2",
            "assumed",
            "acceleration",
        )
        (warning,) = record.warnings
        assert warning.startswith("m/s^2 is assumed")
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(path.read_bytes())))
        piped = read_record("-")
        assert (piped.source, piped.pga) == ("-", 3.0)

    @pytest.mark.parametrize(
        ("data", "note"),
        [
            (wave(peak=319.0), "325 g; usual values are 0.0001 g to 1.5 g"),
            (wave(peak=1e-6), "1.02e-06 g; usual"),
            (np.zeros(10), "all samples are zero"),
            (0.1 * wave() + 0.1, "25 % of the peak"),
        ],
    )
    def test_suspect_samples_are_noted(self, tmp_path, data, note):
        record = read_record(write(tmp_path / "a", trace(data)), units="10 m/s^2")
        assert any(note in text for text in (*record.warnings, *record.notes))


class TestFormats:
    @pytest.mark.parametrize("encoding", ["FLOAT32", "FLOAT64", "INT32", "STEIM1", "STEIM2"])
    @pytest.mark.parametrize(
        "options",
        every(2, [{"byteorder": "<"}, {"byteorder": ">"}, {"reclen": 256}, {"reclen": 4096}]),
    )
    def test_miniseed_encodings_are_read(self, tmp_path, encoding, options):
        data = {"FLOAT32": wave().astype(np.float32), "FLOAT64": wave()}.get(encoding, counts())
        path = write(tmp_path / "a", trace(data), encoding=encoding, **options)
        np.testing.assert_array_equal(read_record(path, units="1 m/s^2").acceleration, data)

    @pytest.mark.parametrize(
        ("name", "samples", "units", "scale"),
        [
            ("SAC", wave().astype(np.float32), "m/s^2", 1.0),
            ("GSE2", counts(), "0.001 gal", 1e-5),
            ("SLIST", wave(), None, 0.01),
            ("TSPAIR", wave(), None, 0.01),
        ],
    )
    def test_other_obspy_formats_are_read(self, tmp_path, name, samples, units, scale):
        path = write(tmp_path / "a", trace(samples, ascii={"unit": "CM/S**2"}), format=name)
        np.testing.assert_allclose(
            read_record(path, units=units).acceleration, samples * scale, rtol=1e-8, atol=1e-9
        )

    def test_slist_without_unit_requires_units(self, tmp_path):
        path = tmp_path / "a.txt"
        path.write_text(
            "TIMESERIES XX_ABC_00_HNE_D, 3 samples, 100 sps, 2020-01-02T03:04:05, SLIST, "
            "FLOAT,\n1.5 2 0\n"
        )
        assert read_record(path, units="gal").pga == 0.02

    def test_plugins_exclude_pickle(self):
        by_name = {plugin.name: plugin for plugin in plugins()}
        assert "PICKLE" not in by_name
        assert set(OBSPY_FORMATS) <= set(by_name)
        assert all(
            plugin.is_format.value.startswith(("obspy.io.", "tdint."))
            for plugin in by_name.values()
        )

    @pytest.mark.long
    def test_only_plugin_of_format_is_loaded(self):
        code = """
import importlib.metadata, sys
asked = []
original = importlib.metadata.distribution
importlib.metadata.distribution = lambda name: asked.append(name) or original(name)
from tdint.ground_motion.reading.read import read_records
for _ in range(2):
    read_records(sys.argv[1], units="m/s^2")
loaded = {name.split(".")[2] for name in sys.modules if name.startswith("obspy.io.")}
print(asked.count("obspy"), asked.count("tdint"), sorted(loaded))
print([name for name in sys.modules if name.startswith("tdint.ground_motion.formats.networks")])
"""
        result = subprocess.run(
            [sys.executable, "-c", code, FIRM_SOIL], capture_output=True, text=True
        )
        assert result.stdout.splitlines() == ["1 1 ['mseed']", "[]"], result.stderr

    def test_text_channels_are_omitted(self, tmp_path):
        log = trace(np.frombuffer(b"door opened" * 3, dtype="S1"), channel="LOG")
        log.stats.delta = 1.0
        parts = [write(tmp_path / "a", log), write(tmp_path / "b", trace(wave()))]
        (tmp_path / "c").write_bytes(b"".join(part.read_bytes() for part in parts))
        (record,) = read_records(tmp_path / "c")
        assert record.component == "HNE"
        layout = TextLayout(step=record.dt)
        assert read_records(tmp_path / "c", layout=layout)[0].dt == record.dt


class TestKnet:
    """Tests with the strong-motion record in ObsPy, which contains counts with an offset and states
    a peak of 4.383 gal."""

    @pytest.fixture
    def path(self):
        return need_obspy_data("nied/tests/data/test.knet")

    def test_peak_agrees_with_header(self, path):
        record = read_record(path)
        assert record.pga * 100 == pytest.approx(4.383, abs=0.0005)
        assert abs(record.acceleration.mean()) < 1e-12
        assert (record.component, record.id, record.dt) == ("EW", "BO.AKT013..EW", 0.01)
        assert record.start == "1996-08-10T18:12:24.000000Z"
        assert any("zero offset" in note for note in record.notes)
        assert not any("states a peak" in note for note in record.notes)
        assert read_record(path, units="m/s^2").pga == record.pga
        refused(path, r"states its units \(m/s\^2\), but gal is specified", units="gal")

    @pytest.mark.parametrize(
        ("old", "new", "message"),
        [
            (b"4.383", b"5.000", r"peak of 5 gal, .* 4\.383"),
            *(
                (b"Time(s)  59", b"Time(s)  " + length, "invalid number of samples|read have 5900")
                for length in (b"1e308", b"nan", b"1e12", b"-5", b"58", b"60")
            ),
        ],
    )
    def test_wrong_peak_or_length_in_header_is_refused(self, path, tmp_path, old, new, message):
        changed = tmp_path / "a.knet"
        changed.write_bytes(path.read_bytes().replace(old, new))
        refused(changed, message)

    @pytest.mark.parametrize("length", [14000, 700, 400, 100, 12])
    def test_truncated_file_is_refused(self, path, length):
        refused(path.read_bytes()[:length], "corrupt")


def test_kinemetrics_calibration_is_applied_once():
    records = read_records(need_obspy_data("kinemetrics/tests/data/BI008_MEMA-04823.evt"))
    assert [record.component for record in records] == ["0", "1", "2"]
    # 1.17e-6 m/s^2 a count, by the header's full scale and sensitivity
    assert [record.pga for record in records] == pytest.approx(
        [1.7019e-3, 1.6023e-3, 4.0144e-3], rel=1e-4
    )


def test_gse2_samples_similar_to_end_mark_are_read():
    path = need_obspy_data("gse2/tests/data/twiceCHK2.gse2")
    assert read_record(path, units="1 gal").acceleration.size == 750


def test_full_seed_volume_is_read():
    path = need_obspy_data("mseed/tests/data/fullseed.mseed")
    assert [record.component for record in read_records(path, units="1 gal")] == [
        "BHN",
        "BHZ",
        "BHE",
    ]


class TestComponents:
    def test_components_are_in_file_order(self, three):
        assert [(r.component, round(r.pga, 12)) for r in read_records(three)] == [
            ("HNE", 1),
            ("HNN", 2),
            ("HNZ", 3),
        ]
        refused(three, "several components, choose one by `component`: HNE, HNN, HNZ")

    @pytest.mark.parametrize(
        "name", ["HNN", "hnn", " HNN ", "XX.ABC.00.HNN", "xx.abc.00.hnn", "N", "n"]
    )
    def test_component_is_selected_by_name(self, three, name):
        assert read_record(three, component=name).component == "HNN"
        assert [r.component for r in read_records(three, component=name)] == ["HNN"]

    @pytest.mark.parametrize("name", ["HNX", "X", "", "HN", "H"])
    def test_unknown_component_is_refused(self, three, name):
        refused(
            three, f"component '{name}' not found; the components are HNE, HNN, HNZ", component=name
        )

    def test_ambiguous_component_is_refused(self, tmp_path):
        path = write(tmp_path / "a", trace(wave(), channel="HNE"), trace(wave(), channel="HLE"))
        refused(path, "several components match 'E', choose one: HNE, HLE", component="E")
        path = write(tmp_path / "b", trace(wave()), trace(wave(peak=1.0), location="10"))
        refused(path, r"choose one: XX\.ABC\.00\.HNE, XX\.ABC\.10\.HNE", component="HNE")
        assert read_record(path, component="XX.ABC.10.HNE").pga == 1.0
        # The stations distinguish the matches, but do not select a component.
        components = [
            trace(wave(), channel=code, station=station)
            for station in ("S1", "S2")
            for code in ("HNE", "HNN")
        ]
        path = write(tmp_path / "c", *components)
        refused(path, r"choose one: XX\.S1\.00\.HNE, XX\.S2\.00\.HNE", component="HNE")

    def test_unselected_components_may_be_invalid(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()), trace([1.0, np.nan, 2.0], channel="HNN"))
        assert read_record(path, component="HNE").pga == 3.0

    def test_different_sampling_intervals_are_refused(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()), trace(wave(), channel="HNN", dt=0.02))
        with pytest.raises(
            RecordError, match=r"HNN is sampled at 0\.02 s and XX\.ABC\.00\.HNE at 0\.01 s"
        ):
            read_records(path)
        assert read_record(path, component="HNN").dt == 0.02


class TestPieces:
    def test_adjacent_pieces_are_joined(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()[600:], start=START + 6.0), trace(wave()[:600]))
        np.testing.assert_array_equal(read_record(path).acceleration, wave())

    @pytest.mark.parametrize(
        ("second", "message"),
        [
            (
                {"start": START + 7.5},
                r"XX\.ABC\.00\.HNE: a gap of 1.5 s after 2020-01-02T03:04:10\.99",
            ),
            (
                {"start": START + 5.5},
                r"XX\.ABC\.00\.HNE: an overlap of 0.5 s after 2020-01-02T03:04:10\.99",
            ),
            (
                {"start": START + 6.0, "dt": 0.02},
                r"sampling interval changes from 0\.01 s to 0\.02 s",
            ),
        ],
    )
    def test_gap_overlap_and_changing_interval_are_refused(self, tmp_path, second, message):
        refused(write(tmp_path / "a", trace(wave(600)), trace(wave(400), **second)), message)

    def test_changing_encoding_is_refused(self, tmp_path):
        first = write(tmp_path / "a", trace(counts(600)))
        second = write(tmp_path / "b", trace(wave(400), start=START + 6.0))
        refused(first.read_bytes() + second.read_bytes(), r"different encodings, \[5, 11\]")


class TestOwnPlugins:
    """Tests of a reader of this project that is added to `plugins` and states its units in the
    trace."""

    @pytest.fixture
    def path(self, tmp_path, monkeypatch):
        class Entry:
            def __init__(self, function):
                self.load = lambda: function

        def read_format(file):
            entries = file.read().decode().split()
            if len(entries) < 2:
                raise RecordError("names no unit")
            return [trace(wave(), tdint_units=entries[1])]

        own = contents.Plugin("OWN", Entry(lambda file: file.read(3) == b"OWN"), Entry(read_format))
        monkeypatch.setattr(contents, "plugins", lambda: iter([own]))
        path = tmp_path / "a.own"
        path.write_text("OWN cm/s^2")
        return path

    def test_units_of_file_must_agree_with_specified_units(self, path):
        for units in (None, "gal"):
            record = read_record(path, units=units)
            assert (record.pga, record.notes) == (pytest.approx(0.03), ())
        refused(path, "but g is specified", units="g")

    def test_error_of_plugin_is_reported(self, path):
        path.write_text("OWN")
        refused(path, r"a\.own: names no unit$")


def test_record_is_read_without_temporary_directory(monkeypatch):
    def none():
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_get_default_tempdir", none)
    assert read_record(FIRM_SOIL, component="HN1").dt == 0.01
