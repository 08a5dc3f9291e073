"""Ground motions of this project: content of the files, and their reproduction."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from tdint.ground_motion.reading.read import read_record, read_records

FOLDER = Path(__file__).parents[2] / "records"
NAMES = ("firm-soil", "near-fault", "soft-soil")
RETROFIT = tuple(f"retrofit/R{number}" for number in range(1, 5))
G = 9.81


@pytest.fixture(scope="module")
def maker():
    spec = importlib.util.spec_from_file_location("make_records", FOLDER / "make_records.py")
    module = importlib.util.module_from_spec(spec)
    # The creation of a dataclass requires its module in sys.modules.
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "make_records", module)
        spec.loader.exec_module(module)
        yield module


def velocity(record):
    a = record.acceleration
    return np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1]))]) * record.dt


def test_records_are_reproducible(maker, tmp_path):
    maker.write_records(tmp_path)
    names = (*NAMES, *RETROFIT)
    assert sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*.*")) == sorted(
        Path(f"{name}.mseed") for name in names
    )
    assert sorted((FOLDER / "retrofit").iterdir()) == [
        FOLDER / f"{name}.mseed" for name in RETROFIT
    ]
    for name in names:
        pairs = zip(
            read_records(FOLDER / f"{name}.mseed"),
            read_records(tmp_path / f"{name}.mseed"),
            strict=True,
        )
        for kept, recomputed in pairs:
            assert (kept.id, kept.start, kept.dt) == (
                recomputed.id,
                recomputed.start,
                recomputed.dt,
            )
            np.testing.assert_allclose(
                kept.acceleration, recomputed.acceleration, rtol=0, atol=1e-12 * kept.pga
            )


@pytest.mark.parametrize(
    ("name", "component", "samples", "pga", "pgv"),
    [
        ("firm-soil", "HN1", 4001, 0.400, 0.60), ("firm-soil", "HN2", 4001, 0.320, 0.35),
        ("near-fault", "HN1", 3001, 0.491, 1.03), ("near-fault", "HN2", 3001, 0.219, 0.36),
        ("soft-soil", "HN1", 11001, 0.150, 0.67), ("soft-soil", "HN2", 11001, 0.120, 0.47),
    ],
)  # fmt: skip
def test_readme_states_samples_and_peaks(name, component, samples, pga, pgv):
    record = read_record(FOLDER / f"{name}.mseed", component=component)
    assert record.acceleration.size == samples
    assert record.dt == 0.01
    assert record.acceleration[0] == 0.0
    assert record.pga / G == pytest.approx(pga, abs=5e-4)
    assert np.abs(velocity(record)).max() == pytest.approx(pgv, abs=6e-3)
    line = f"| {component} | {pga:.3f} g | {pgv:.2f} m/s |"
    assert line in (FOLDER / "README.md").read_text()


@pytest.mark.parametrize("name", [*NAMES, *RETROFIT])
def test_files_are_small_and_have_two_components(name):
    path = FOLDER / f"{name}.mseed"
    assert path.stat().st_size < 200_000
    assert [record.component for record in read_records(path)] == ["HN1", "HN2"]


@pytest.mark.parametrize("name", ["near-fault", "soft-soil"])
def test_final_velocity_is_zero(name):
    for record in read_records(FOLDER / f"{name}.mseed"):
        assert abs(velocity(record)[-1]) < 1e-12


def test_samples_of_reference_motion():
    """The motion of the published comparisons is fixed, so that any change of its generator is
    detected."""
    acceleration = read_record(FOLDER / "firm-soil.mseed", component="HN1").acceleration
    assert acceleration[1000] == pytest.approx(0.4338568487862746, rel=1e-12)
    assert acceleration[2500] == pytest.approx(-0.07326727990833307, rel=1e-12)


def test_pulse_ends_at_rest(maker):
    time = maker.sample_times(20.0, 0.001)
    a = maker.pulse(time, period=2.0, cycles=2.0, velocity=1.0, center=10.0)
    v = np.cumsum(a) * 0.001
    assert a[[0, -1]].tolist() == [0.0, 0.0]
    assert abs(v[-1]) < 1e-9
    assert abs(v.sum() * 0.001) < 1e-6
    expected = 0.5 * (1 + np.cos(np.pi / 2 * (time - 10.0))) * -np.sin(np.pi * (time - 10.0))
    np.testing.assert_allclose(v[8500:11500], expected[8500:11500], atol=2e-3)


def test_energy_of_soft_soil_record_is_near_two_seconds():
    record = read_record(FOLDER / "soft-soil.mseed", component="HN1")
    spectrum = np.abs(np.fft.rfft(record.acceleration))
    frequency = np.fft.rfftfreq(record.acceleration.size, record.dt)
    near = (frequency > 1 / 3) & (frequency < 1 / 1.4)
    assert (spectrum[near] ** 2).sum() > 0.6 * (spectrum**2).sum()


@pytest.mark.parametrize(
    ("station", "component", "pga"),
    [
        ("WTMC", "HN1", 9.7331),
        ("WTMC", "HN2", 7.9664),
        ("WTMC", "HNZ", 18.0219),
        ("HSES", "HN1", 2.3646),
        ("HSES", "HN2", 2.5537),
        ("HSES", "HNZ", 1.5712),
    ],
)
def test_kaikoura_records_have_peaks_of_geonet(station, component, pga):
    record = read_record(
        FOLDER / "kaikoura" / f"{station}.mseed", component=component, units="m/s^2"
    )
    assert (record.acceleration.size, record.dt, record.pga) == (8192, 0.02, pga)
    # The files print tenths of a millimeter per second squared.
    tenths = 1e4 * record.acceleration
    assert np.array_equal(np.round(tenths) / 1e4, record.acceleration)
    assert str(record.start).startswith("2016-11-13T11:02:")


def test_kaikoura_records_require_original_files(maker, tmp_path):
    for recording in maker.KAIKOURA.values():
        (tmp_path / recording.file).write_text("another file\n")
    with pytest.raises(SystemExit, match="not the file"):
        maker.write_recordings(tmp_path / "out", tmp_path)
    assert not list((tmp_path / "out").iterdir())
