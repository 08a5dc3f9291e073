"""Results as named columns, short texts and tables for notebooks; records from data in memory."""

import csv
import io
import pickle

import numpy as np
import pytest

import tdint
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.messages import quiet_import
from tdint.output.tables.buildings import mode_table
from tdint.output.tables.histories import HistoryLayout, write_history
from tdint.output.tables.responses import response_table, story_table
from tdint.output.tables.spectra import result_table
from tdint.units import STANDARD_GRAVITY

LAW = {"type": "bilinear", "yield_force": 50, "hardening": 0}
STORIES = [{"mass": 10.0, "height": 3.0, "stiffness": 8000.0, "law": LAW, "repeat": 2}]
MODEL = {"name": "<small>", "stories": STORIES, "damping": 0.05}
WAVE = np.sin(9.0 * np.arange(300) * 0.01)


@pytest.fixture(scope="module")
def response():
    record = tdint.make_record(3.0 * WAVE, dt=0.01, units="m/s^2")
    return tdint.run(
        tdint.load_model(MODEL), record, method="newmark-average", history=True, check=True
    )


def check_columns(columns, table):
    """Check that named columns equal the columns of a table."""
    assert tuple(columns) == table.columns
    for name, cells in zip(table.columns, zip(*table.rows, strict=True), strict=True):
        if isinstance(columns[name], list):
            assert tuple(columns[name]) == cells
        else:
            np.testing.assert_array_equal(
                columns[name], [np.nan if cell is None else cell for cell in cells], err_msg=name
            )


def test_columns_equal_the_columns_of_the_tables(response):
    check_columns(response.to_dict(), response_table(response))
    carried = tdint.run(response.model, response.record, method="moment4", check=True)
    columns = carried.to_dict()
    check_columns(columns, response_table(carried))
    # The table of a run: the table of its peaks, and the energies.
    peaks = story_table(carried.stories, carried.check.errors)
    energies = {
        "hysteretic_energy_J": carried.hysteretic_energy,
        "hysteretic_energy_J_error": carried.check.hysteretic_energy,
    }
    assert tuple(columns) == (*peaks.columns, *energies)
    check_columns({name: columns[name] for name in peaks.columns}, peaks)
    for name, values in energies.items():
        np.testing.assert_array_equal(columns[name], values, err_msg=name)
    check_columns(response.stories.to_dict(), story_table(response.stories))
    spectrum = tdint.spectrum(response.record, np.array([0.5, 1.0]))
    check_columns(spectrum.to_dict(), result_table([spectrum]))
    modes = tdint.modes(response.model)
    check_columns(modes.to_dict(), mode_table(modes, modes.damping))
    assert modes.damping == pytest.approx([0.05, 0.05])


def test_several_results_are_written_as_one_parquet_file(response, tmp_path):
    """The tables of spectra are joined; without pyarrow, its absence is the only error."""
    spectra = tdint.spectrum([response.record] * 2, np.array([0.5, 1.0]))
    file = tmp_path / "spectra.parquet"
    try:
        spectra.to_parquet(file)
    except UsageError as error:
        assert "requires pyarrow" in str(error)
    else:
        pyarrow = pytest.importorskip("pyarrow.parquet")
        assert pyarrow.read_table(file).num_rows == 4


def test_a_history_equals_the_file_of_the_command(response):
    stream = io.BytesIO()
    write_history([response.history], stream)
    header, *rows = csv.reader(io.StringIO(stream.getvalue().decode()))
    columns = response.history.to_dict()
    assert (
        list(columns) == header == [column.name for column in HistoryLayout(2, error=True).columns]
    )
    written = np.array([[float(cell) for cell in row] for row in rows])
    np.testing.assert_allclose(
        np.column_stack(list(columns.values())), written, rtol=1e-11, atol=1e-300
    )


def test_other_units(response):
    si, us = response.to_dict(), response.to_dict("kip,in,g")
    assert us["peak_drift_in"] * 0.0254 == pytest.approx(si["peak_drift_m"])
    assert us["peak_absolute_acceleration_g"] * STANDARD_GRAVITY == pytest.approx(
        si["peak_absolute_acceleration_m_s2"]
    )
    assert us["story"].tolist() == [1, 2] and us["story"].dtype.kind == "i"
    with pytest.raises(UsageError, match="int has no table"):
        tdint.to_dict(3)


@pytest.mark.parametrize(
    "make",
    [
        lambda run: run,
        lambda run: run.stories,
        lambda run: run.history,
        lambda run: run.record,
        lambda run: tdint.modes(run.model),
        lambda run: tdint.spectrum(run.record, np.array([0.5, 1.0])),
        lambda run: tdint.drift_spectrum(run.record, np.array([0.5, 1.0])),
        lambda run: tdint.constant_ductility(run.record, np.array([0.5]), [2.0])[0],
        lambda run: tdint.floor_spectra(run, [1, 2], np.array([0.5]), [0.05])[0],
        lambda run: tdint.cyclic_test(run.model, 1, ["1%"], points=3),
        lambda run: tdint.pushover(run.model, "1%", points=4),
        lambda run: tdint.stability("newmark-average", np.array([0.1, 0.2])),
    ],
)
def test_every_result_has_text_table_and_pickle(response, make):
    result = make(response)
    assert len(repr(result)) < 200 and "\n" not in repr(result) and repr(result).startswith("<")
    columns = result.to_dict()
    assert len({len(values) for values in columns.values()}) == 1
    html = result._repr_html_()
    assert html.count("<th>") == len(columns)
    assert html.count("<tr>") == 1 + min(20, len(next(iter(columns.values()))))
    assert "<small>" not in html  # Names are escaped.
    assert repr(pickle.loads(pickle.dumps(result))) == repr(result)


@pytest.fixture(scope="module")
def traces():
    """Two components as a stream of ObsPy."""
    with quiet_import():
        from obspy import Stream, Trace
    names = ("HNE", "HNN")
    return Stream(
        [Trace(WAVE * (i + 1), {"delta": 0.01, "channel": name}) for i, name in enumerate(names)]
    )


def test_records_from_arrays_traces_and_streams(traces):
    array = tdint.make_record(WAVE, dt=0.01, units="g", component="X", name="wave")
    np.testing.assert_allclose(array.acceleration, WAVE * STANDARD_GRAVITY, rtol=1e-15)
    assert (array.dt, array.source, array.component, array.units_from) == (
        0.01, "wave", "X", "given",
    )  # fmt: skip
    for data, component in ((traces[1], None), (traces, "HNN"), (traces, "N")):
        record = tdint.make_record(data, units="cm/s^2", component=component)
        np.testing.assert_allclose(record.acceleration, 0.02 * WAVE, rtol=1e-14)
        assert record.component == "HNN"
    # A velocity sin(w t) becomes w cos(w t), with the relative error (w dt)^2 / 12 of a spline.
    t = np.arange(301) * 0.001
    moving = tdint.make_record(np.sin(9.0 * t), dt=0.001, units="cm/s")
    np.testing.assert_allclose(
        moving.acceleration[20:-20], 0.09 * np.cos(9.0 * t)[20:-20], atol=0.09 * 9e-3**2 / 12 * 1.01
    )
    assert moving.quantity == "velocity"
    assert np.array_equal(traces[0].data, WAVE)  # The input is unchanged.


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"data": WAVE, "units": "g"}, UsageError, "dt and units are required"),
        ({"data": WAVE, "dt": 0.01}, UsageError, "dt and units are required"),
        ({"data": WAVE, "dt": 0.01, "units": "gg"}, UsageError, "units 'gg'"),
        ({"data": WAVE * np.nan, "dt": 1.0, "units": "g"}, RecordError,
         "array: .* got nan for sample 0"),
        ({"data": np.ma.masked_less(WAVE, 0.0), "dt": 1.0, "units": "g"}, RecordError,
         "samples masked"),
    ],
)  # fmt: skip
def test_invalid_arrays_are_refused(arguments, error, message):
    with pytest.raises(error, match=message):
        tdint.make_record(**arguments)


@pytest.mark.parametrize(
    ("part", "options", "error", "message"),
    [
        (
            slice(None),
            {"units": "g"},
            RecordError,
            "several components, choose one by `component`: HNE, HNN",
        ),
        (0, {}, RecordError, "units"),
        (0, {"units": "g", "dt": 0.01}, UsageError, "dt cannot be used with a trace"),
        (slice(0), {"units": "g"}, RecordError, "the stream has no traces"),
    ],
)
def test_incomplete_streams_are_refused(traces, part, options, error, message):
    with pytest.raises(error, match=message):
        tdint.make_record(traces[part], **options)


def test_runs_as_frames_arrays_and_parquet(tmp_path):
    """Runs with samples, errors and a history are converted with each package. If a package is not
    installed, the error names it."""
    building = tdint.load_model(
        {"stories": [{"mass": 2e5, "height": 3, "stiffness": 1e8, "repeat": 2}], "damping": "5%"}
    )
    record = tdint.make_record(np.sin(0.1 * np.arange(100)), dt=0.01, units="m/s^2")
    options = {
        "vary": {"stories[2].mass": [1e5, 2e5, 3e5]},
        "scales": [1.0, 2.0],
        "method": "moment4",
    }
    file = tmp_path / "runs.parquet"
    for package, call in {
        "pandas": lambda runs: runs.to_pandas(),
        "xarray": lambda runs: runs.to_xarray(),
        "pyarrow": lambda runs: runs.to_parquet(file),
    }.items():
        runs = tdint.run_many(building, record, history="drift", check=True, **options)
        try:
            __import__(package)
        except ImportError:
            with pytest.raises(UsageError, match=f"requires {package}, which is not installed"):
                call(runs)
            continue
        found = call(runs)
        if package == "pandas":
            assert (
                list(found["stories[2].mass_kg"]) == [1e5, 1e5, 2e5, 2e5, 3e5, 3e5]
                and len(found) == 6
            )
        elif package == "xarray":
            # All rows, to the end of the longest continued motion.
            assert dict(found.sizes) == {"run": 6, "time": max(runs.steps) + 1, "story": 2}
            peaks = found.peak_drift.where(found["stories[2].mass_kg"] == 2e5, drop=True)
            np.testing.assert_array_equal(peaks, runs.stories.peak_drift[2:4])
            assert found.drift.attrs["units"] == "m" and found.peak_drift_error.shape == (6, 2)
        else:
            from pyarrow import parquet

            table = parquet.read_table(file)
            np.testing.assert_array_equal(
                table["peak_drift_m"].to_numpy(), runs.to_dict()["peak_drift_m"]
            )
            assert table.schema.field("peak_drift_m").metadata[b"unit"] == b"m"
            again = tmp_path / "again.parquet"
            tdint.run_many(building, record, check=True, out=again, **options)
            assert parquet.read_table(again).equals(table)
    with pytest.raises(UsageError, match="parquet"):
        tdint.run_many(building, record, out="runs.csv")


def test_responses_of_several_methods_and_steps_are_identified():
    model = {"stories": [{"repeat": 2, "mass": 1e5, "stiffness": 6e7}]}
    record = tdint.make_record(np.sin(np.arange(60.0)), dt=0.01, units="m/s^2")
    methods, steps = ["impulse4", "newmark-average"], [0.01, 0.005]
    responses = tdint.run(model, record, method=methods, dt=steps, check=False)
    table = responses.to_dict()
    expected = [(response.method, response.dt) for response in responses for _ in range(2)]
    assert list(zip(table["method"], table["dt_s"].tolist(), strict=True)) == expected
    assert "method" not in responses[0].to_dict()


def test_spectra_of_several_damping_ratios():
    record = tdint.make_record(np.sin(np.arange(60.0)), dt=0.01, units="m/s^2")
    found = tdint.spectrum([record, record], [0.1, 0.5], [0.02, "5%"])
    assert [spectrum.damping for spectrum in found] == [0.02, 0.05] * 2
    np.testing.assert_array_equal(found[1].psa, tdint.spectrum(record, [0.1, 0.5], 0.05).psa)


def test_a_law_along_a_path_is_that_of_cycles():
    law = {"type": "bilinear", "yield_force": 100, "hardening": 0.1}
    model = {"stories": [{"mass": 1e3, "height": 3, "stiffness": 1e4, "law": law}]}
    cycles = tdint.cyclic_test(model, 1, [0.03 / 3.0], points=4)
    path = tdint.law_path(model, 1, cycles.path.drift.tolist())
    np.testing.assert_array_equal(path.path.shear, cycles.path.shear)
    for drifts in ("abc", [], [np.nan], [[0.1]], [1j]):
        with pytest.raises(UsageError, match="drifts must be a sequence of 1 to"):
            tdint.law_path(model, 1, drifts)
