"""Comparison of computed and recorded responses. A recording that is generated from a computed
response agrees with it, and known changes of the recording are detected."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from building_cases import LINEAR, Force, Law, model, story
from selection import every
from tdint.errors import AnalysisError, RecordError
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.reading.scale import moved
from tdint.ground_motion.record import Record
from tdint.ground_motion.signal import Signal, has_offset
from tdint.model.config.model_file import load_model
from tdint.output.figures.static_curves import WORST_ROWS
from tdint.response.runs.run import prepare, run_case
from tdint.studies.recordings.compare import (
    _REQUIREMENTS,
    Event,
    _mean_signal,
    case_under,
    compare,
    respond,
    unmet,
)
from tdint.studies.recordings.comparison_figures import comparison_picture
from tdint.studies.recordings.recording_file import load_recording

DT, SIZE = 0.02, 1500
MODEL = """\
stories:
  - {mass: 1.0, stiffness: 900}
  - {mass: 1.2, stiffness: 700}
  - {mass: 0.8, stiffness: 500}
damping: {modal: [0.02, 0.03, 0.04]}
"""


def sensor(column, more="", file="event.csv"):
    return f"{{file: {file}, column: {column}{more}}}"


def recording(base=None, first=None, roof=None, more=""):
    """Return the text of a file of recordings; by default with the accelerations of the base, floor
    1 and the roof."""
    base, first = base or sensor("base_m_s2"), first or sensor("floor_1_m_s2")
    return f"base: {base}\nfloors:\n  1: {first}\n  roof: {roof or sensor('floor_3_m_s2')}\n{more}"


DISPLACEMENT = ", quantity: displacement"
FLOORS = recording()


def noise(seed, size=SIZE):
    """Return a band-limited random motion in m/s^2 that is zero at both ends."""
    return (
        np.random.default_rng(seed).normal(size=size) * np.sin(np.linspace(0.0, math.pi, size)) ** 2
    )


@pytest.fixture
def recorded_model(tmp_path):
    """Return a model, its exact response to a noise with median 0, a function that writes the
    response as a table, and a function that reads recordings."""
    (tmp_path / "model.yaml").write_text(MODEL)
    model = load_model(tmp_path / "model.yaml")
    base = noise(1) - np.median(noise(1))
    record = Record(base, DT, "", "", "", "noise")
    history = run_case(prepare(model, record, method="exact"), history=True).history
    motions = {f"floor_{i + 1}": history.absolute_acceleration[:, i] for i in range(3)}
    displacements = {f"floor_{i + 1}": history.displacement[:, i] for i in range(3)}

    def write(name="event.csv", dt=DT, start=0.0, **columns):
        time = start + dt * np.arange(len(next(iter(columns.values()))))
        names = ",".join(["time_s", *columns])
        rows = np.column_stack([time, *columns.values()])
        np.savetxt(tmp_path / name, rows, "%.12g", ",", header=names, comments="")

    def event(text=FLOORS):
        (tmp_path / "recorded.yaml").write_text(text)
        return Event(load_recording(tmp_path / "recorded.yaml", 3))

    def usual(**changed):
        columns = {"base_m_s2": base} | {f"{name}_m_s2": values for name, values in motions.items()}
        return write(**(columns | changed))

    return SimpleNamespace(
        model=model,
        base=base,
        motions=motions,
        displacements=displacements,
        write=write,
        event=event,
        usual=usual,
    )


@pytest.mark.parametrize("band", ["", "band: [0.5, 20]\n"])
def test_result_agrees_with_itself(recorded_model, band):
    """The agreement is limited only by the rounding in the file, for any offset of a sensor."""
    recorded_model.usual(floor_1_m_s2=recorded_model.motions["floor_1"] + 0.3)
    for floor in compare(recorded_model.model, recorded_model.event(FLOORS + band)).floors:
        assert floor.quantity == "acceleration"
        assert floor.rms_difference < 1e-9
        assert floor.peak_ratio == pytest.approx(1.0, abs=1e-9)
        assert floor.correlation == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("law", [LINEAR, Law("bilinear", (5.0, 0.1))])
@pytest.mark.parametrize("forces", [[], [Force(1, 1.0, 0.0, 5.0)]])
def test_exact_is_chosen_for_linear_buildings_without_forces(recorded_model, law, forces):
    """`exact` is chosen for a linear building that is excited only by its base. Harmonic forces are
    excluded, because `exact` would only use their values at the time steps."""
    recorded_model.usual()
    case = model([story(1.0, 900.0, law), story(1.0, 700.0), story(0.8, 500.0)], forces=forces)
    exact_is_chosen = case_under(case, recorded_model.event()).method.family.linear_only
    assert exact_is_chosen == (law is LINEAR and not forces)


SLIP = {"type": "bilinear", "yield_force": 5.0, "hardening": 0.1}


@pytest.mark.parametrize(
    "part",
    [
        {"links": [{"name": "brace", "from": 1, "to": 3, "stiffness": 90.0, "law": SLIP}]},
        {"attachments": [{"name": "box", "floor": 2, "mass": 0.1, "stiffness": 9.0, "law": SLIP}]},
    ],
)
def test_exact_is_not_chosen_if_another_part_than_a_story_is_nonlinear(recorded_model, part):
    recorded_model.usual()
    stories = [{"mass": 1.0, "stiffness": 900.0, "repeat": 3}]
    case = case_under(load_model({"stories": stories, **part}), recorded_model.event())
    assert not case.method.family.linear_only


def test_noise_lowers_correlation_as_predicted(recorded_model):
    """For independent noise with e times the rms of the motion, the correlation is 1 / sqrt(1 +
    e^2), and the difference is e / sqrt(1 + e^2)."""
    part = 0.5
    clean = recorded_model.motions["floor_3"]
    added = np.random.default_rng(5).normal(size=SIZE)
    added *= part * np.std(clean) / np.std(added)
    recorded_model.usual(floor_3_m_s2=clean + added)
    roof = compare(recorded_model.model, recorded_model.event()).floors[-1]
    sampling = 3.0 / math.sqrt(SIZE)
    assert roof.correlation == pytest.approx(1.0 / math.sqrt(1.0 + part**2), abs=part * sampling)
    assert roof.rms_difference == pytest.approx(
        part / math.sqrt(1.0 + part**2), abs=part * sampling
    )


def test_sensors_of_floor_are_averaged_with_their_direction(recorded_model):
    """The difference of two sensors is a torsional motion, which has no effect on their mean.
    Sensors with different quantities are refused."""
    recorded_model.usual()
    plain = compare(recorded_model.model, recorded_model.event())
    turns = {"base": noise(9), "roof": 0.5 * noise(7)}
    motions = {"base": recorded_model.base, "roof": recorded_model.motions["floor_3"]}
    sides = {f"{location}_west_m_s2": motions[location] + turns[location] for location in turns}
    sides |= {
        f"{location}_east_cm_s2": -100.0 * (motions[location] - turns[location])
        for location in turns
    }
    recorded_model.usual(**sides, roof_east_m=recorded_model.displacements["floor_3"])
    base, roof = (
        f"[{sensor(f'{location}_west_m_s2')}, {sensor(f'{location}_east_cm_s2', ', sign: -1')}]"
        for location in turns
    )
    mean = compare(recorded_model.model, recorded_model.event(recording(base, roof=roof)))
    for floor, other in zip(mean.floors, plain.floors, strict=True):
        assert floor.rms_difference == pytest.approx(other.rms_difference, abs=1e-9)
        np.testing.assert_allclose(floor.computed, other.computed, atol=1e-9)
    assert any("floor 3: the mean of 2 sensors" in note for note in mean.event.notes)
    assert len([note for note in mean.event.notes if "mean of 2 sensors" in note]) == 2
    mixed = f"[{sensor('roof_west_m_s2')}, {sensor('roof_east_m')}]"
    with pytest.raises(RecordError, match=r"floor 3: .* got acceleration and displacement"):
        recorded_model.event(recording(roof=mixed))


def test_displacements_are_compared_relative_to_base(recorded_model):
    """Displacements, in mm, of a linear building without offsets are compared relative to the base,
    together with an acceleration."""
    recorded_model.usual(floor_1_mm=1e3 * recorded_model.displacements["floor_1"])
    text = recording(first=sensor("floor_1_mm", DISPLACEMENT), more="band: [0.3, 20]\n")
    floors = compare(recorded_model.model, recorded_model.event(text)).floors
    assert [floor.quantity for floor in floors] == ["displacement", "acceleration"]
    assert floors[0].rms_difference < 1e-9
    assert floors[0].peak_ratio == pytest.approx(1.0, abs=1e-9)


def test_base_displacement_becomes_an_acceleration(recorded_model):
    smooth = np.cumsum(np.cumsum(noise(3))) * 1e-4
    recorded_model.usual(base_m=smooth, base_m_s2=moved(smooth, DT, "displacement").acceleration)
    by_acceleration = compare(recorded_model.model, recorded_model.event())
    by_displacement = compare(
        recorded_model.model, recorded_model.event(recording(sensor("base_m")))
    )
    for floor, other in zip(by_displacement.floors, by_acceleration.floors, strict=True):
        np.testing.assert_allclose(
            floor.computed, other.computed, atol=1e-6 * np.max(np.abs(other.computed))
        )


@pytest.mark.long
def test_clock_shift_is_determined(recorded_model):
    """The shift is determined for a recording with twice the sampling rate and a delay of a
    fraction of a sample."""
    late = 0.137
    recorded_model.usual()
    before = compare(recorded_model.model, recorded_model.event(FLOORS + "band: [0.5, 8]\n"))
    spectrum = np.fft.rfft(recorded_model.motions["floor_3"], 4 * SIZE)
    dense = np.fft.irfft(np.concatenate([spectrum, np.zeros(2 * SIZE)]), 8 * SIZE)[: 2 * SIZE] * 2.0
    recorded_model.write("roof.csv", DT / 2.0, late, roof_m_s2=dense)
    roof = sensor("roof_m_s2", file="roof.csv")
    text = f"base: {sensor('base_m_s2')}\nfloors: {{3: {roof}}}\nband: [0.5, 8]\n"
    found = compare(recorded_model.model, recorded_model.event(text + "shift: auto\n"))
    assert found.shift == pytest.approx(-late, abs=1e-3)
    assert found.floors[0].correlation == pytest.approx(before.floors[-1].correlation, abs=1e-3)
    shifted = compare(recorded_model.model, recorded_model.event(text + f"shift: {-late}\n"))
    assert shifted.floors[0].correlation == pytest.approx(found.floors[0].correlation, abs=1e-5)
    assert compare(recorded_model.model, recorded_model.event(text)).floors[0].correlation < 0.9


def test_clock_shift_does_not_depend_on_amplitude(recorded_model):
    weak = {name: 1e-4 * values for name, values in recorded_model.motions.items()}
    recorded_model.usual(
        base_m_s2=1e-4 * recorded_model.base,
        floor_1_m_s2=np.roll(weak["floor_1"], 7),
        floor_3_m_s2=np.roll(weak["floor_3"], 7),
    )
    assert compare(
        recorded_model.model, recorded_model.event(FLOORS + "shift: auto\n")
    ).shift == pytest.approx(-7 * DT, abs=1e-3)


def test_clock_shift_of_silent_sensor_is_zero(recorded_model):
    """A sensor without motion has no correlation with any shift."""
    recorded_model.usual(floor_3_m_s2=np.zeros(SIZE))
    text = f"base: {sensor('base_m_s2')}\nfloors: {{3: {sensor('floor_3_m_s2')}}}\nshift: auto\n"
    found = compare(recorded_model.model, recorded_model.event(text))
    assert found.shift == 0.0
    assert math.isnan(found.floors[0].correlation)


def test_recordings_without_common_clock_start_together(recorded_model, tmp_path):
    """A record states a date, but a table only the time since an unknown start. They are assumed to
    start together, and a note states this."""
    with quiet_import():
        from obspy import Trace, UTCDateTime

    recorded_model.usual()
    plain = compare(recorded_model.model, recorded_model.event())
    header = {"delta": DT, "starttime": UTCDateTime(2016, 11, 13), "channel": "HNE"}
    Trace(recorded_model.motions["floor_1"].copy(), header).write(
        str(tmp_path / "floor.mseed"), format="MSEED"
    )
    mixed = recording(first="{file: floor.mseed, units: m/s^2}")
    other = compare(recorded_model.model, recorded_model.event(mixed))
    np.testing.assert_allclose(other.floors[0].recorded, plain.floors[0].recorded, atol=1e-9)
    assert [note for note in other.event.notes if "the files have no common clock" in note]
    assert not [note for note in plain.event.notes if "common clock" in note]


def test_comparison_is_limited_to_window(recorded_model):
    recorded_model.usual()
    (first, _) = compare(
        recorded_model.model, recorded_model.event(FLOORS + "window: [4, 12.5]\n")
    ).floors
    assert (first.time[0], first.time[-1]) == pytest.approx((4.0, 12.5))
    assert first.time.size == 426
    with pytest.raises(RecordError, match=r"fewer than 10 .* 29\.9 to 40 s"):
        compare(recorded_model.model, recorded_model.event(FLOORS + "window: [29.9, 40]\n"))


def test_spectra_of_recorded_and_computed_motion(recorded_model):
    """For an acceleration, the spectrum is the spectrum of the floor acceleration. For a
    displacement, it is the spectrum of its second derivative."""
    recorded_model.usual(floor_1_m=recorded_model.displacements["floor_1"])
    band = "band: [0.3, 5]\n"
    periods = np.array([0.25, 0.5, 1.0])
    by_acceleration = compare(recorded_model.model, recorded_model.event(FLOORS + band)).spectra(
        periods, 0.05
    )[0]
    text = recording(first=sensor("floor_1_m"), more=band)
    by_displacement = compare(recorded_model.model, recorded_model.event(text)).spectra(
        periods, 0.05
    )[0]
    np.testing.assert_allclose(by_acceleration.computed, by_acceleration.recorded, rtol=1e-9)
    # Second differences lose 1/12 (omega dt)^2 of a frequency: 3 % at 5 Hz.
    np.testing.assert_allclose(by_displacement.computed, by_acceleration.computed, rtol=4e-2)


def test_offset_of_samples_is_removed(recorded_model):
    base = recorded_model.base + 0.3
    recorded_model.usual(base_m_s2=base)
    event = recorded_model.event()
    assert np.median(event.base.acceleration) == pytest.approx(0.0, abs=1e-9)
    assert any("the offset of the base, 0.3 m/s^2" in note for note in event.notes)
    assert has_offset(np.full(50, 9.81) + 1e-3 * noise(4, 50))
    assert not has_offset(np.zeros(50))


@pytest.mark.parametrize(
    ("text", "message"),
    every(
        2,
        [
            (
                recording(first=sensor("floor_1_m_s2", DISPLACEMENT)),
                r"are units of acceleration, but .* specifies displacement.*one of m, cm",
            ),
            (
                recording(first=sensor("floor_9_m_s2")),
                "no column floor_9_m_s2 among 5 columns; rename the column",
            ),
            (recording(roof=sensor("roof", file="other.csv")), "does not end with its units"),
            (recording(roof=sensor("roof", ", units: g", "other.csv")), "does not overlap in time"),
            (recording(more="band: [0.5, 25]\n"), "Nyquist .* 25 Hz, got 25 Hz"),
        ],
    ),
)
def test_inconsistent_files_are_refused(recorded_model, text, message):
    recorded_model.usual()
    recorded_model.write("other.csv", start=100.0, roof=recorded_model.base)
    with pytest.raises(RecordError, match=message):
        recorded_model.event(text)
    cured = recorded_model.event(
        recording(first=sensor("floor_1_m_s2", f"{DISPLACEMENT}, units: cm"))
    )
    assert cured.floors[0].quantity == "displacement"  # as the first message advises


@pytest.mark.parametrize(("band", "fastest"), [(None, None), ((0.1, 2.0), 4.0 * math.pi)])
def test_default_time_step_resolves_modes_within_band(recorded_model, band, fastest):
    """The default time step is the first halving of the sampling interval with omega dt of at most
    a quarter."""
    recorded_model.usual()
    case = case_under(recorded_model.model, recorded_model.event(), "newmark-average")
    omega = fastest or case.building.fastest
    parts = next(2**i for i in range(9) if omega * DT / 2**i <= 0.25)
    assert parts > 1
    assert respond(case, None, band).dt == pytest.approx(DT / parts)


def test_collapsed_building_cannot_be_compared(recorded_model):
    recorded_model.usual(base_m_s2=1e3 * recorded_model.base)
    law = replace(recorded_model.model.stories[0].law, name="bilinear", parameters=(1.0, -0.3))
    stories = (
        replace(recorded_model.model.stories[0], law=law, height=3.0),
        *recorded_model.model.stories[1:],
    )
    with pytest.raises(AnalysisError):
        compare(
            replace(recorded_model.model, stories=stories),
            recorded_model.event(),
            method="impulse4",
        )


# ---- Residual and absolute displacements, several sensors


def test_residual_displacement_causes_no_jump(recorded_model):
    """For a slow ramp to a residual displacement, subtraction of the median would cause a jump at t
    = 0 and an acceleration of the order of 1 / dt^2."""
    time = DT * np.arange(SIZE)
    ramp = 0.05 * 0.5 * (1.0 + np.tanh((time - 6.0) / 0.8))
    motion = recorded_model.displacements["floor_3"] + ramp
    recorded_model.usual(floor_3_m=motion)
    text = recording(roof=sensor("floor_3_m", DISPLACEMENT), more="band: [0.2, 20]\n")
    (floor,) = compare(recorded_model.model, recorded_model.event(text)).floors[1:]
    (_, spectra) = compare(recorded_model.model, recorded_model.event(text)).spectra(
        np.array([0.05]), 0.05
    )
    without = np.max(np.abs(recorded_model.motions["floor_3"]))
    assert np.max(np.abs(floor.recorded[:5])) < 0.02 * np.max(np.abs(floor.recorded))
    assert spectra.recorded[0] < 2.0 * without


def test_absolute_displacement_is_reported(recorded_model):
    wave = np.cumsum(np.cumsum(recorded_model.base)) * DT * DT
    recorded_model.usual(
        floor_3_m=recorded_model.displacements["floor_3"] + wave,
        right_m=recorded_model.displacements["floor_3"],
    )
    absolute, relative = (
        recording(roof=sensor(column, DISPLACEMENT), more="band: [0.5, 20]\n")
        for column in ("floor_3_m", "right_m")
    )
    (text,) = compare(recorded_model.model, recorded_model.event(absolute)).warnings
    assert text.startswith("floor 3: the recorded displacement probably is absolute")
    assert compare(recorded_model.model, recorded_model.event(relative)).warnings == []


# ---- Fits


def test_window_is_exact_to_sample():
    """The window is the recorded part of the requested time range, exact to the sample. At least
    ten samples are required."""
    random = np.random.default_rng(3)
    base = Record(random.normal(size=100), 0.01, "", "", "", "base")
    refused = 0
    for _ in range(300):
        first, last = np.sort(random.integers(0, 100, 2))
        recorded = np.full(100, np.nan)
        recorded[first : last + 1] = 1.0
        window = (
            None
            if random.random() < 0.3
            else tuple(np.sort(np.round(random.uniform(-0.1, 1.1, 2), 2)))
        )
        recording = SimpleNamespace(window=window)
        event = SimpleNamespace(recording=recording, base=base, count=100)
        start, end = window or (0.0, 0.99)
        expected = [i for i in range(first, last + 1) if start - 1e-9 <= 0.01 * i <= end + 1e-9]
        if len(expected) < 10:
            refused += 1
            with pytest.raises(RecordError, match="fewer than 10 samples"):
                Event.window(event, recorded, "floor 1")
        else:
            assert [*range(100)[Event.window(event, recorded, "floor 1")]] == expected
    assert 30 < refused < 270
    with pytest.raises(RecordError, match="has fewer than 10 samples"):
        Event.window(event, np.full(100, np.nan), "floor 1")


@pytest.mark.parametrize("shortest", [10, 9])
def test_mean_of_sensors_covers_common_time_range(shortest):
    """Sensors record one motion with different factors and start times. Their mean is the motion
    with the mean factor, over the common time range."""
    motion = np.random.default_rng(4).normal(size=200)
    begins = (30, 35, 20)
    signals = [
        Signal(
            factor * motion[begin:end],
            0.01,
            "acceleration",
            "a",
            1.0 + 0.01 * begin,
            "UTC",
            (),
            (),
            None,
        )
        for factor, begin, end in zip(
            (1.0, 2.0, 6.0), begins, (140, 35 + shortest, 120), strict=True
        )
    ]
    if shortest < 10:
        with pytest.raises(RecordError, match=r"floor 1: .*sensors.* overlap"):
            _mean_signal(signals, "floor 1", {})
        return
    mean, lead = _mean_signal(signals, "floor 1", {})
    assert lead == pytest.approx(0.05)
    np.testing.assert_allclose(mean.samples, 3.0 * motion[35:45])


@pytest.mark.parametrize(
    ("name", "limit", "met", "missed"),
    [
        ("correlation", 0.9, (0.9, 1.0), (0.899, -1.0)),
        ("peak_ratio", 0.8, (0.8, 1.0, 1.25), (0.799, 1.251)),
        ("peak_ratio", 1.25, (0.8, 1.0, 1.25), (0.799, 1.251)),
        ("rms_difference", 0.3, (0.3, 0.0), (0.301,)),
    ],
)
def test_requirements_at_their_limits(name, limit, met, missed):
    meets, _ = _REQUIREMENTS[name]
    assert all(meets(value, limit) for value in met)
    assert not any(meets(value, limit) for value in missed)


def test_unmet_requirement_is_stated_with_both_bounds(recorded_model):
    """Bounds and value have four digits, and more if the value would read as the bound."""
    recorded_model.usual()
    comparison = compare(recorded_model.model, recorded_model.event())
    (first, *_) = comparison.floors
    for value, limit, text in (
        (0.895228162611, 0.9, "is 0.8952, required is between 0.9 and 1.111"),
        (1.1112, 0.9, "is 1.1112, required is between 0.9 and 1.111"),
        (0.899996, 0.9, "is 0.899996, required is between 0.9 and 1.111"),
    ):
        floors = (SimpleNamespace(floor=first.floor, peak_ratio=value),)
        changed = SimpleNamespace(event=comparison.event, floors=floors)
        (message,) = unmet(changed, [("peak_ratio", limit)])
        assert message.endswith(f"peak_ratio {text}")


# ---- Figure


@pytest.mark.long
def test_figure_shows_floors_with_least_agreement_and_overview(recorded_model):
    """The figure shows the floors with the least agreement, over the time of strong shaking, as a
    close-up of eight cycles on both sides of the roof peak, and as spectra. An overview below
    contains all floors."""
    compared = []
    for part in (0.4, 0.3, 0.1, 0.2):
        recorded_model.usual(floor_3_m_s2=recorded_model.motions["floor_3"] + part * noise(6))
        compared.append(compare(recorded_model.model, recorded_model.event()))
    floors = [(event, floor) for event in compared for floor in event.floors]
    periods = np.geomspace(0.1, 1.0, 5)
    figure = comparison_picture(compared, periods, 0.05)
    *panels, above, below = figure.axes
    for axes, values in ((above, "correlation"), (below, "peak_ratio")):
        points = [(*line.get_xdata(), *line.get_ydata()) for line in axes.lines[:8]]
        assert points == [
            (i // 2 + 1, getattr(floor, values)) for i, (_, floor) in enumerate(floors)
        ]
    assert below.lines[8].get_ydata() == [1.0, 1.0]
    worst = sorted(floors, key=lambda pair: pair[1].correlation)[:WORST_ROWS]
    assert len(panels) == 3 * WORST_ROWS
    for (event, floor), history, close, spectrum in zip(
        worst, panels[::3], panels[1::3], panels[2::3], strict=True
    ):
        assert (
            f"correlation {floor.correlation:.3f}, peak ratio {floor.peak_ratio:.3f}"
            in history.get_title("left")
        )
        for axes in (history, close):
            recorded, computed = (line.get_ydata() * 9.80665 for line in axes.lines)
            np.testing.assert_allclose(
                [recorded, computed], [floor.recorded, floor.computed], rtol=1e-12, atol=1e-12
            )
        parts = [
            np.cumsum(compared_floor.recorded**2) / np.sum(compared_floor.recorded**2)
            for compared_floor in event.floors
        ]
        left, right = np.transpose(
            [np.interp(history.get_xlim(), floor.time, part) for part in parts]
        )
        assert [np.max(left), np.min(right)] == pytest.approx([0.0005, 0.9995], abs=1e-4)
        roof = event.floors[-1]
        within = (roof.time >= close.get_xlim()[0]) & (roof.time <= close.get_xlim()[1])
        assert np.count_nonzero(np.diff(np.signbit(roof.recorded[within]))) == 15
        assert np.max(np.abs(roof.recorded)) == np.max(np.abs(roof.recorded[within]))
        floor_spectra = event.spectra(periods, 0.05)[event.floors.index(floor)]
        for line, values in zip(
            spectrum.lines[:2], (floor_spectra.recorded, floor_spectra.computed), strict=True
        ):
            np.testing.assert_allclose(line.get_ydata() * 9.80665, values, rtol=1e-12)


def test_method_step_and_shift_of_a_comparison(recorded_model):
    """The arguments have the effect of the keys of the model and of the recording."""
    recorded_model.usual()
    event, model = recorded_model.event(), recorded_model.model

    def differences(model, event, **arguments):
        return [floor.rms_difference for floor in compare(model, event, **arguments).floors]

    plain = differences(model, event, method="newmark-average")
    average = replace(model, analysis=replace(model.analysis, method="newmark-average"))
    assert differences(average, event) == plain
    steps = [
        np.array(differences(model, event, method="newmark-average", dt=dt))
        for dt in (0.5 * DT, 0.25 * DT)
    ]
    assert np.all(steps[1] < 0.3 * steps[0])  # order 2
    shifted = recorded_model.event(FLOORS + f"shift: {2.0 * DT}\n")
    assert differences(model, event, shift=2.0 * DT) == differences(model, shifted)
