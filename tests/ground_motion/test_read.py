"""Reading sound files: formats, components, units."""

import io
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from ground_motion.files import START, counts, obspy_data, trace, wave, write
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.reading.contents import OBSPY_FORMATS, plugins
from tdint.ground_motion.reading.read import read_record, read_records
from tdint.units import STANDARD_GRAVITY, parse_units


@pytest.fixture
def three(tmp_path):
    """A file of three components with peaks 1, 2 and 3."""
    traces = [trace(wave(peak=peak), channel=f"HN{c}") for c, peak in zip("ENZ", (1.0, 2.0, 3.0), strict=True)]
    return write(tmp_path / "three.mseed", *traces)


class TestWhatARecordTells:
    def test_mseed_float(self, tmp_path):
        path = write(tmp_path / "a.mseed", trace(wave()))
        record = read_record(path)
        np.testing.assert_array_equal(record.acceleration, wave())
        assert (record.id, record.component, record.dt) == ("XX.ABC.00.HNE", "HNE", 0.01)
        assert record.start == "2020-01-02T03:04:05.000000Z"
        assert record.source == str(path)
        assert (record.units, record.units_from, record.quantity) == ("m/s^2", "assumed", "acceleration")
        (warning,) = record.warnings
        assert warning.startswith("m/s^2 is assumed")

    def test_standard_input(self, tmp_path, monkeypatch):
        data = write(tmp_path / "a.mseed", trace(wave())).read_bytes()
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        record = read_record("-")
        assert record.source == "-"
        assert record.pga == 3.0

    def test_name_and_extension_do_not_matter(self, tmp_path):
        path = write(tmp_path / "record[1]*?.gz", trace(wave()))
        assert read_record(path).pga == 3.0


class TestFormats:
    @pytest.mark.parametrize("encoding", ["FLOAT32", "FLOAT64"])
    @pytest.mark.parametrize("byteorder", ["<", ">"])
    def test_mseed_encodings(self, tmp_path, encoding, byteorder):
        data = wave().astype({"FLOAT32": np.float32, "FLOAT64": np.float64}[encoding])
        path = write(tmp_path / "a", trace(data), encoding=encoding, byteorder=byteorder)
        np.testing.assert_array_equal(read_record(path).acceleration, data)

    @pytest.mark.parametrize("encoding", ["INT32", "STEIM1", "STEIM2"])
    @pytest.mark.parametrize("length", [256, 512, 4096])
    def test_mseed_counts(self, tmp_path, encoding, length):
        path = write(tmp_path / "a", trace(counts()), encoding=encoding, reclen=length)
        np.testing.assert_allclose(read_record(path, units="2e-5 m/s^2").acceleration, counts() * 2e-5, rtol=1e-15)

    def test_sac(self, tmp_path):
        record = read_record(write(tmp_path / "a.sac", trace(wave().astype(np.float32)), format="SAC"), units="m/s^2")
        np.testing.assert_array_equal(record.acceleration, wave().astype(np.float32))
        assert record.component == "HNE"

    def test_gse2_counts(self, tmp_path):
        path = write(tmp_path / "a.gse", trace(counts()), format="GSE2")
        np.testing.assert_allclose(read_record(path, units="0.001 gal").acceleration, counts() * 1e-5, rtol=1e-15)

    @pytest.mark.parametrize("name", ["SLIST", "TSPAIR"])
    def test_text(self, tmp_path, name):
        record = read_record(write(tmp_path / "a.txt", trace(wave(), ascii={"unit": "CM/S**2"}), format=name))
        np.testing.assert_allclose(record.acceleration, wave() * 0.01, rtol=1e-8, atol=1e-9)

    def test_text_without_unit_in_the_header(self, tmp_path):
        path = tmp_path / "a.txt"
        path.write_text("TIMESERIES XX_ABC_00_HNE_D, 3 samples, 100 sps, 2020-01-02T03:04:05, SLIST, FLOAT,\n1.5 2 0\n")
        assert read_record(path, units="gal").pga == 0.02

    def test_pickle_is_never_among_them(self):
        names = [plugin.name for plugin in plugins()]
        assert "PICKLE" not in names
        assert set(OBSPY_FORMATS) <= set(names)

    def test_every_plugin_is_of_obspy_or_of_this_project(self):
        for plugin in plugins():
            assert plugin.is_format.value.startswith(("obspy.io.", "tdint."))

    def test_the_distributions_are_asked_once_and_only_the_plugin_of_the_format_is_loaded(self, tmp_path):
        write(tmp_path / "a", trace(wave()))
        code = """
import importlib.metadata, sys
asked = []
original = importlib.metadata.distribution
importlib.metadata.distribution = lambda name: asked.append(name) or original(name)
from tdint.ground_motion.reading.read import read_record
for _ in range(2):
    read_record(sys.argv[1])
loaded = {name.split(".")[2] for name in sys.modules if name.startswith("obspy.io.")}
print(asked.count("obspy"), asked.count("tdint"), sorted(loaded))
print([name for name in sys.modules if name.startswith("tdint.ground_motion.formats.networks")])
"""
        result = subprocess.run([sys.executable, "-c", code, tmp_path / "a"], capture_output=True, text=True)
        assert result.stdout.splitlines() == ["1 1 ['mseed']", "[]"], result.stderr

    def test_text_channels_are_left_out(self, tmp_path):
        log = trace(np.frombuffer(b"door opened" * 3, dtype="S1"), channel="LOG")
        parts = [write(tmp_path / "a", log), write(tmp_path / "b", trace(wave()))]
        (tmp_path / "c").write_bytes(b"".join(part.read_bytes() for part in parts))
        (record,) = read_records(tmp_path / "c")
        assert record.component == "HNE"


class TestKnet:
    """The strong-motion record that comes with obspy: counts with an offset, peak 4.383 gal by its header."""

    @pytest.fixture
    def path(self):
        return obspy_data("nied/tests/data/test.knet") or pytest.skip("this obspy comes without its test data")

    def test_peak_is_that_of_the_header(self, path):
        record = read_record(path)
        assert record.pga * 100 == pytest.approx(4.383, abs=0.0005)
        assert abs(record.acceleration.mean()) < 1e-12
        assert (record.component, record.id, record.dt) == ("EW", "BO.AKT013..EW", 0.01)
        assert record.start == "1996-08-10T18:12:24.000000Z"
        assert any("zero offset" in note for note in record.notes)
        assert not any("states a peak" in note for note in record.notes)

    def test_right_units_are_no_contradiction(self, path):
        assert read_record(path, units="m/s^2").pga == read_record(path).pga

    def test_other_units_are(self, path):
        with pytest.raises(RecordError, match=r"gives its units \(m/s\^2\), gal contradicts"):
            read_record(path, units="gal")

    def test_another_peak_than_the_header_s(self, path, tmp_path):
        changed = tmp_path / "a.knet"
        changed.write_bytes(path.read_bytes().replace(b"4.383", b"5.000"))
        with pytest.raises(RecordError, match=r"states a peak of 5 gal, what was read has 4\.383"):
            read_record(changed)
        changed.write_bytes(path.read_bytes().replace(b"4.383", b"4.400"))
        assert any("states a peak of 4.4 gal" in note for note in read_record(changed).notes)

    @pytest.mark.parametrize("number", [b"1e308", b"nan", b"1e12", b"-5", b"58", b"60"])
    def test_a_length_that_the_samples_have_not(self, path, tmp_path, number):
        changed = tmp_path / "a.knet"
        changed.write_bytes(path.read_bytes().replace(b"Duration Time(s)  59", b"Duration Time(s)  " + number))
        with pytest.raises(RecordError, match=r"no length that a record can have|what was read has 5900"):
            read_record(changed)

    def test_cut_off(self, path, tmp_path):
        short = tmp_path / "a.knet"
        for length in (14000, 700, 400, 100, 12):
            short.write_bytes(path.read_bytes()[:length])
            with pytest.raises(RecordError, match="damage"):
                read_record(short)


class TestOtherFilesOfObspy:
    """Files among obspy's own test data, where the installation has them."""

    def file(self, name):
        return obspy_data(name) or pytest.skip("this obspy comes without its test data")

    def test_kinemetrics_calibration_is_applied_once(self):
        path = self.file("kinemetrics/tests/data/BI008_MEMA-04823.evt")
        records = read_records(path)
        assert [record.component for record in records] == ["0", "1", "2"]
        # 1.17e-6 m/s^2 a count, by the header's full scale and sensitivity
        assert [record.pga for record in records] == pytest.approx([1.7019e-3, 1.6023e-3, 4.0144e-3], rel=1e-4)

    def test_gse2_whose_samples_look_like_their_end(self):
        path = self.file("gse2/tests/data/twiceCHK2.gse2")
        assert read_record(path, units="1 gal").acceleration.size == 750

    def test_full_seed_volume(self):
        path = self.file("mseed/tests/data/fullseed.mseed")
        assert [record.component for record in read_records(path, units="1 gal")] == ["BHN", "BHZ", "BHE"]


class TestComponents:
    def test_all_in_file_order(self, three):
        assert [(r.component, round(r.pga, 12)) for r in read_records(three)] == [("HNE", 1), ("HNN", 2), ("HNZ", 3)]

    @pytest.mark.parametrize("name", ["HNN", "hnn", " HNN ", "XX.ABC.00.HNN", "xx.abc.00.hnn", "N", "n"])
    def test_one(self, three, name):
        assert read_record(three, component=name).component == "HNN"
        assert [r.component for r in read_records(three, component=name)] == ["HNN"]

    def test_several_and_none_named(self, three):
        with pytest.raises(RecordError, match="several components, choose one: HNE, HNN, HNZ"):
            read_record(three)

    @pytest.mark.parametrize("name", ["HNX", "X", "", "HN", "H"])
    def test_unknown(self, three, name):
        with pytest.raises(RecordError, match=f"no component '{name}'; there are HNE, HNN, HNZ"):
            read_record(three, component=name)

    def test_last_letter_of_two(self, tmp_path):
        path = write(tmp_path / "a", trace(wave(), channel="HNE"), trace(wave(), channel="HLE"))
        with pytest.raises(RecordError, match="several components match 'E', choose one: HNE, HLE"):
            read_record(path, component="E")

    def test_one_code_at_two_locations(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()), trace(wave(peak=1.0), location="10"))
        with pytest.raises(RecordError, match=r"choose one: XX\.ABC\.00\.HNE, XX\.ABC\.10\.HNE"):
            read_record(path, component="HNE")
        assert read_record(path, component="XX.ABC.10.HNE").pga == 1.0

    def test_others_may_be_unusable(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()), trace([1.0, np.nan, 2.0], channel="HNN"))
        assert read_record(path, component="HNE").pga == 3.0

    def test_different_sampling(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()), trace(wave(), channel="HNN", dt=0.02))
        with pytest.raises(RecordError, match=r"HNN is sampled at 0\.02 s and XX\.ABC\.00\.HNE at 0\.01 s"):
            read_records(path)
        assert read_record(path, component="HNN").dt == 0.02


class TestPieces:
    def test_adjacent_pieces_are_joined(self, tmp_path):
        data = wave()
        later = trace(data[600:], start=START + 6.0)
        path = write(tmp_path / "a", later, trace(data[:600]))
        np.testing.assert_array_equal(read_record(path).acceleration, data)

    @pytest.mark.parametrize(("shift", "what"), [(1.5, "a gap of 1.5 s"), (-0.5, "an overlap of 0.5 s")])
    def test_gap_and_overlap(self, tmp_path, shift, what):
        path = write(tmp_path / "a", trace(wave(600)), trace(wave(400), start=START + 6.0 + shift))
        with pytest.raises(RecordError, match=rf"a: XX\.ABC\.00\.HNE: {what} after 2020-01-02T03:04:10\.99"):
            read_record(path)

    def test_changing_interval(self, tmp_path):
        path = write(tmp_path / "a", trace(wave(600)), trace(wave(400), start=START + 6.0, dt=0.02))
        with pytest.raises(RecordError, match=r"sampling interval changes from 0\.01 s to 0\.02 s"):
            read_record(path)

    def test_changing_type(self, tmp_path):
        first = write(tmp_path / "a", trace(counts(600)))
        second = write(tmp_path / "b", trace(wave(400), start=START + 6.0))
        (tmp_path / "c").write_bytes(first.read_bytes() + second.read_bytes())
        with pytest.raises(RecordError, match=r"different encodings, \[5, 11\]"):
            read_record(tmp_path / "c")


class TestUnits:
    @pytest.mark.parametrize(
        ("text", "scale"),
        [
            ("m/s^2", 1.0), ("m/s2", 1.0), ("m/s**2", 1.0), ("M/S**2", 1.0), ("m/s/s", 1.0), ("m/sec^2", 1.0),
            ("m/s²", 1.0), ("cm/s^2", 0.01), ("CM/SEC/SEC", 0.01), ("gal", 0.01), ("Gal", 0.01), ("gals", 0.01),
            ("mm/s2", 0.001), ("g", STANDARD_GRAVITY), ("G", STANDARD_GRAVITY), ("2.38e-6 m/s^2", 2.38e-6),
            ("2.38E-6m/s2", 2.38e-6), (" .5 g ", 0.5 * STANDARD_GRAVITY), ("1. gal", 0.01), ("3*mm/s^2", 0.003),
        ],
    )  # fmt: skip
    def test_spellings(self, text, scale):
        assert parse_units(text).scale == pytest.approx(scale, rel=1e-15)
        assert parse_units(text).has_factor == any(c in text for c in ".3")

    @pytest.mark.parametrize("text", ["", "m/s^", "mg", "kg", "counts", "2.38e-6", "m/s^3", "1 2 gal", "gal gal"])
    def test_unknown(self, text):
        with pytest.raises(UsageError, match=r"use one of m/s\^2, cm/s\^2, gal, mm/s\^2, g"):
            parse_units(text)

    def test_nearest(self):
        with pytest.raises(UsageError, match="did you mean 'gal'"):
            parse_units("gall")

    @pytest.mark.parametrize("text", ["0 gal", "-1 m/s^2", "1e999 g"])
    def test_factor_must_be_positive(self, text):
        with pytest.raises(UsageError, match="positive"):
            parse_units(text)

    def test_float_with_units(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()))
        record = read_record(path, units="g")
        np.testing.assert_allclose(record.acceleration, wave() * STANDARD_GRAVITY, rtol=1e-15)
        assert (record.units, record.units_from, record.warnings) == ("g", "given", ())

    def test_counts_without_units(self, tmp_path):
        path = write(tmp_path / "a", trace(counts()))
        with pytest.raises(RecordError, match=r"counts of a recorder.*value of one count.*StationXML") as caught:
            read_record(path)
        assert caught.value.exit_code == 4

    def test_counts_with_a_bare_unit(self, tmp_path):
        path = write(tmp_path / "a", trace(counts()))
        with pytest.raises(RecordError, match='write "1 gal" if one count is 1 gal'):
            read_record(path, units="gal")
        assert read_record(path, units="1 gal").pga == 1000.0

    def test_calibration_factor_without_unit(self, tmp_path):
        path = write(tmp_path / "a", trace(counts(), calib=0.25), format="GSE2")
        with pytest.raises(RecordError, match=r"calibration factor 0\.25 has no unit"):
            read_record(path)
        record = read_record(path, units="1e-5 m/s^2")
        assert record.pga == pytest.approx(1.0)
        assert any("0.25 is not applied" in note for note in record.notes)

    def test_counts_in_a_text_header(self, tmp_path):
        path = write(tmp_path / "a", trace(wave(), ascii={"unit": "COUNTS"}), format="SLIST")
        with pytest.raises(RecordError, match="counts of a recorder"):
            read_record(path)
        assert read_record(path, units="1 m/s^2").pga == pytest.approx(3.0)

    def test_header_contradicts(self, tmp_path):
        path = write(tmp_path / "a", trace(wave(), ascii={"unit": "CM/S**2"}), format="SLIST")
        with pytest.raises(RecordError, match=r"gives its units \(CM/S\*\*2\), g contradicts"):
            read_record(path, units="g")
        assert read_record(path, units="gal").pga == read_record(path).pga

    def test_header_of_something_else(self, tmp_path):
        path = write(tmp_path / "a", trace(wave(), ascii={"unit": "V"}), format="SLIST")
        with pytest.raises(RecordError, match="which is no ground motion"):
            read_record(path, units="m/s^2")

    @pytest.mark.parametrize(("header", "message"), [({"idep": 7}, "a velocity"), ({"idep": 6}, "a displacement")])
    def test_sac_of_something_else(self, tmp_path, header, message):
        path = write(tmp_path / "a", trace(wave(), sac=header), format="SAC")
        with pytest.raises(RecordError, match=message):
            read_record(path)

    # LEVEN, false, and IFTYPE, a spectrum: words of the header that obspy does not write otherwise.
    @pytest.mark.parametrize(("word", "value"), [(105, 0), (85, 2)])
    def test_sac_of_another_kind(self, tmp_path, word, value):
        path = write(tmp_path / "a", trace(wave()), format="SAC", byteorder="<")
        data = bytearray(path.read_bytes())
        data[4 * word : 4 * word + 4] = value.to_bytes(4, "little")
        path.write_bytes(data)
        with pytest.raises(RecordError, match="not an evenly sampled"):
            read_record(path)

    def test_both_units_and_inventory(self, tmp_path):
        path = write(tmp_path / "a", trace(wave()))
        with pytest.raises(UsageError, match="leave one of them out"):
            read_record(path, units="g", inventory="station.xml")


class TestOwnPlugins:
    """A reader of this project joins through `plugins` and tells its units in the trace."""

    @pytest.fixture
    def path(self, tmp_path, monkeypatch):
        class Entry:
            def __init__(self, function):
                self.load = lambda: function

        def read_format(file):
            words = file.read().decode().split()
            if len(words) < 2:
                raise RecordError("names no unit")
            return [trace(wave(), tdint_units=words[1])]

        from tdint.ground_motion.reading import contents as module

        own = module.Plugin("OWN", Entry(lambda file: file.read(3) == b"OWN"), Entry(read_format))
        monkeypatch.setattr(module, "plugins", lambda: iter([own]))
        path = tmp_path / "a.own"
        path.write_text("OWN cm/s^2")
        return path

    def test_units_of_the_file_and_of_the_user(self, path):
        for units in (None, "gal"):
            record = read_record(path, units=units)
            assert (record.pga, record.notes) == (pytest.approx(0.03), ())
        with pytest.raises(RecordError, match="g contradicts them"):
            read_record(path, units="g")

    def test_its_own_error(self, path):
        path.write_text("OWN")
        with pytest.raises(RecordError, match=r"a\.own: names no unit$"):
            read_record(path)


class TestDoubts:
    @pytest.mark.parametrize(
        ("data", "note"),
        [
            (wave(peak=319.0), "3190 m/s^2; are the units right?"),
            (np.zeros(10), "all samples are zero"),
            (0.1 * wave() + 0.1, "25% of the peak"),
        ],
    )
    def test_notes(self, tmp_path, data, note):
        assert any(note in text for text in read_record(write(tmp_path / "a", trace(data)), units="10 m/s^2").notes)


def test_a_record_is_read_where_there_is_no_folder_for_temporary_files(monkeypatch):
    def none():
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_get_default_tempdir", none)
    records = Path(__file__).parents[2] / "records"
    assert read_record(records / "firm-soil.mseed", component="HN1").dt == 0.01
