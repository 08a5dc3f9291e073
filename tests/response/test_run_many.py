"""Many runs in one call equal single runs to the last bit: peaks, histories and status."""

from copy import deepcopy

import numpy as np
import pytest

import tdint
from building_cases import Law, model, noise, story, ten_bilinear, ten_linear
from feature_buildings import building as featured
from small_buildings import MOTION
from tdint.errors import AnalysisError, ModelError, UsageError
from tdint.fractiles import fractiles
from tdint.model.definition import RayleighRatio
from tdint.response.runs.history import HISTORIES, values_of
from tdint.response.runs.outcome import STORY_QUANTITIES, FailedRun
from tdint.units import STANDARD_GRAVITY

SCALES = (0.5, 1.0, -2.0)
TWO_PERCENT = RayleighRatio((0.02, 0.02), (1, 2))


def two_stories(**more):
    """Return a building with two bilinear stories."""
    law = Law("bilinear", (2e4, 0.05))
    return model([story(2e3, 2e6, law, height=3.0)] * 2, damping=TWO_PERCENT, **more)


def falling():
    """Return a story with P-delta effects that exceed the stiffness after yielding."""
    stiffness = 2.0 * STANDARD_GRAVITY / 3.0
    return model(
        [story(1.0, stiffness, Law("bilinear", (0.05 * stiffness, 0.0)), height=3.0)], p_delta=True
    )


MODELS = [ten_bilinear(), two_stories(), ten_linear()]
RECORDS = [noise(samples=150), noise(samples=90, seed=8)]


def test_histories_exceeding_memory_are_refused_with_size(monkeypatch):
    """The histories of three runs with 150 rows of 2 stories have 8 bytes per number."""
    monkeypatch.setattr("tdint.response.runs.many_results.available_memory", lambda: 1e3)
    with pytest.raises(AnalysisError, match=r"3 runs .*7\.2e-06 GB .* 1e-06 GB"):
        tdint.run_many(
            two_stories(),
            RECORDS[0],
            scales=(0.1, 0.2, 0.3),
            method="newmark-average",
            history="drift",
        )


@pytest.fixture(scope="module")
def runs():
    return tdint.run_many(
        MODELS,
        RECORDS,
        scales=SCALES,
        method="newmark-average",
        history=tuple(HISTORIES),
        jobs=2,
    )


def test_each_run_equals_single_run(runs):
    assert runs.model.tolist() == np.repeat([0, 1, 2], 6).tolist()
    assert runs.record.tolist() == [0, 0, 0, 1, 1, 1] * 3
    assert runs.scale.tolist() == [*SCALES] * 6
    for i, (building, record, scale) in enumerate(
        zip(runs.model, runs.record, runs.scale, strict=True)
    ):
        n = len(MODELS[building].stories)
        single = tdint.run(
            MODELS[building], RECORDS[record].scaled(scale), method="newmark-average", history=True
        )
        assert (runs.status[i], runs.steps[i], runs.dt[i]) == (
            single.status,
            single.steps,
            single.dt,
        )
        assert runs.energy_error[i] == single.energy.error
        for quantity in STORY_QUANTITIES:
            np.testing.assert_array_equal(
                getattr(runs.stories, quantity.name)[i, :n], getattr(single.stories, quantity.name)
            )
            assert np.isnan(getattr(runs.stories, quantity.name)[i, n:]).all()
        for name in HISTORIES:
            expected = getattr(single.history, name)
            np.testing.assert_array_equal(
                runs.history[name][i, : len(expected), :n], expected, err_msg=name
            )
            assert np.isnan(runs.history[name][i, len(expected) :]).all()
            assert np.isnan(runs.history[name][i, :, n:]).all()
        assert runs.record_rows[i] == single.record_rows == RECORDS[record].acceleration.size
    rows = single.history.time.size
    np.testing.assert_array_equal(runs.time[0, :rows], single.history.time)


@pytest.mark.parametrize("method", ["impulse4", "moment4"])
def test_jobs_and_history_do_not_change_results(method):
    """With a history, runs are made separately; without a history, they are made in one call. A
    method that estimates its own errors has larger arrays."""
    both = [
        tdint.run_many(
            two_stories(), RECORDS, scales=SCALES, method=method, history=kept, jobs=jobs
        )
        for kept, jobs in (("drift", 1), ((), 2))
    ]
    for quantity in STORY_QUANTITIES:
        np.testing.assert_array_equal(*(getattr(found.stories, quantity.name) for found in both))
    np.testing.assert_array_equal(both[0].energy_error, both[1].energy_error)
    assert np.nanmax(np.abs(both[0].history["drift"])) <= np.max(both[0].stories.peak_drift)


def test_histories_of_building_with_attachments_are_those_of_floors():
    building = tdint.load_model("configs/absorber-frame.yaml")
    found = tdint.run_many(building, RECORDS[0], method="impulse4", history=True)
    single = tdint.run(building, RECORDS[0], method="impulse4", history=True)
    for name, kept in found.history.items():
        values = values_of(single.history, name)[: kept.shape[1]]
        np.testing.assert_array_equal(kept[0, : len(values)], values)


def test_status_of_collapsed_diverged_and_refused_runs():
    """Collapsed, diverged and refused runs have the status of single runs and do not prevent the
    other runs."""
    record = noise(samples=300)
    found = tdint.run_many(
        falling(), record, scales=(1e-3, 5.0), method="newmark-average", history="drift", jobs=1
    )
    assert found.status.tolist() == ["done", "collapsed"]
    single = tdint.run(falling(), record.scaled(5.0), method="newmark-average", history=True)
    assert single.status == "collapsed" and found.steps[1] == single.steps
    np.testing.assert_array_equal(found.stories.peak_drift[1], single.stories.peak_drift)
    np.testing.assert_array_equal(
        found.history["drift"][1, : single.steps + 1], single.history.drift
    )
    stiff = model([story(1.0, 1e6)])
    refused = tdint.run_many(
        [stiff, ten_linear()], record, method="central-difference", dt=0.01, history="drift"
    )
    ends = []
    for building in (stiff, ten_linear()):
        try:
            ends.append(tdint.run(building, record, method="central-difference", dt=0.01).status)
        except FailedRun as failure:
            ends.append(failure.status)
    assert refused.status.tolist() == ends and "unstable-step" in ends
    for i, status in enumerate(ends):
        assert (i in refused.failures) == (status == "unstable-step")
        assert np.isnan(refused.stories.peak_drift[i]).all() == (status == "unstable-step")
        assert np.isnan(refused.history["drift"][i]).all() == (status == "unstable-step")


def test_run_that_gains_energy_fails_as_single_run():
    """The energy at the end is too large, and is smaller one step later."""
    stiffening = {"type": "polynomial", "coefficients": [1e8, 0.0, 1e11]}
    building = {"stories": [{"mass": 1e5, "height": 3.0, "law": stiffening}], "damping": "2%"}
    accelerations = np.random.default_rng(6).normal(size=20)
    record = tdint.make_record(accelerations, dt=0.05, units="m/s^2")
    settings = {"method": "newmark:beta=0:gamma=0.5", "check": False}
    with pytest.raises(FailedRun, match=r"diverged after 0\.95 s: the final energy") as failure:
        tdint.run(building, record, **settings)
    runs = tdint.run_many(building, [record], **settings)
    assert runs.status == ["diverged"] and runs.failures == {0: str(failure.value)}


def test_failed_run_after_collapse_is_collapsed():
    """The force decreases from a drift of 6 cm and changes its sign at 10 cm. A run ends with its
    collapse, also if it would fail or gain energy from the method after it."""
    record = noise(samples=400)
    away = model([story(1.0, 400.0, Law("polynomial", (400.0, 0.0, -4e4)), height=3.0)])
    found = tdint.run_many(away, record, scales=(2.0, 3.0, 5.0), method="impulse4")
    assert found.status.tolist() == ["collapsed", "collapsed", "collapsed"]
    for i, scale in ((0, 2.0), (1, 3.0), (2, 5.0)):
        single = tdint.run(away, record.scaled(scale), method="impulse4")
        assert single.steps == found.steps[i] < 399
        assert single.stories.peak_drift == found.stories.peak_drift[i] < 1.0


def test_histories_are_written_to_given_array(tmp_path, runs):
    complete = runs.history["drift"][6:12, :, :2]
    file = np.lib.format.open_memmap(
        tmp_path / "drift.npy", mode="w+", shape=(6, 50, 2), dtype=np.float32
    )
    file[...] = 7.0
    arguments = {
        "records": RECORDS,
        "scales": SCALES,
        "method": "newmark-average",
        "history": "drift",
        "every": 3,
    }
    found = tdint.run_many(two_stories(), **arguments, out=file)
    assert found.history["drift"] is file
    thinned = complete[:, : 3 * 50 : 3]
    np.testing.assert_array_equal(np.load(tmp_path / "drift.npy"), thinned.astype(np.float32))
    assert found.time.shape == (1, 50) and found.time[0, -1] == pytest.approx(1.47)
    with pytest.raises(
        UsageError,
        match=r"out\[.drift.\] must be an array .* shape \(6, 50, 2\), got float64 \(6, 51, 2\)",
    ):
        tdint.run_many(two_stories(), **arguments, out={"drift": np.zeros((6, 51, 2))})
    with pytest.raises(UsageError, match="one array for each of: drift, shear"):
        tdint.run_many(two_stories(), **{**arguments, "history": ("drift", "shear")}, out=file)
    with pytest.raises(UsageError, match=r"out .* no history"):
        tdint.run_many(two_stories(), **{**arguments, "history": ()}, out=file)


def test_zip_records_pairs_models_and_records(runs):
    found = tdint.run_many(
        [MODELS[1], MODELS[0]], RECORDS, scales=2.0, zip_records=True, method="newmark-average"
    )
    assert (found.model.tolist(), found.record.tolist(), found.scale.tolist()) == (
        [0, 1],
        [0, 1],
        [2.0, 2.0],
    )
    single = tdint.run(MODELS[0], RECORDS[1].scaled(2.0), method="newmark-average")
    np.testing.assert_array_equal(found.stories.peak_drift[1], single.stories.peak_drift)
    with pytest.raises(UsageError, match=r"zip_records: records .* 1 or 3 .* got 2"):
        tdint.run_many(MODELS, RECORDS, zip_records=True)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"history": "drfit"}, UsageError, "unknown quantity 'drfit'; did you mean 'drift'"),
        ({"history": "acceleration"}, UsageError, "absolute_acceleration"),
        ({"scales": (1.0, 0.0)}, UsageError, "scales must be numbers other than zero"),
        ({"every": 0}, UsageError, "every must be a positive integer"),
        ({"jobs": 0}, UsageError, "the number of jobs"),
        ({"models": []}, UsageError, "models must contain at least one item"),
        ({"models": 3.0}, ModelError, "model"),
        ({"dt": 0.007}, UsageError, "dt .* sampling interval"),
        ({"method": "newmrk"}, UsageError, "newmark"),
    ],
)
def test_invalid_arguments_are_refused(arguments, error, message):
    with pytest.raises(error, match=message):
        tdint.run_many(**{"models": two_stories(), "records": RECORDS[0], **arguments})


@pytest.mark.parametrize("method", ["moment4", "impulse4"])
def test_errors_equal_errors_of_single_runs(method):
    """The corrected peaks are the peaks of the run that estimates the errors."""
    found = tdint.run_many(MODELS[:2], RECORDS[:1], method=method, check=True, history="drift")
    for i, building in enumerate(MODELS[:2]):
        n, single = (
            len(building.stories),
            tdint.run(building, RECORDS[0], method=method, check=True, history=True),
        )
        for quantity in STORY_QUANTITIES:
            np.testing.assert_array_equal(
                getattr(found.errors, quantity.name)[i, :n],
                getattr(single.check.errors, quantity.name),
            )
            corrected = getattr(single.check.corrected, quantity.name)
            np.testing.assert_array_equal(getattr(found.corrected, quantity.name)[i, :n], corrected)
        np.testing.assert_array_equal(found.history["drift"][i, :, :n], single.history.drift)
    names = list(found.to_dict())
    assert names[-1].endswith("_error") and "peak_drift_m_error" in names
    plain = tdint.run_many(MODELS[:2], RECORDS[:1], method=method)
    assert plain.errors is plain.corrected is None and not set(names[-2:]) <= set(plain.to_dict())
    np.testing.assert_array_equal(plain.stories.peak_drift, found.stories.peak_drift)


def test_statistics_over_samples():
    runs = tdint.run_many(
        [two_stories()],
        [noise(samples=60)],
        scales=[1.0, 2.0],
        vary={"stories[1].stiffness": [1.5e6, 2e6, 2.5e6], "record.scale": [0.9, 1.0, 1.2]},
    )
    table = runs.over_samples([10, 90])
    rows = [dict(zip(table, values, strict=True)) for values in zip(*table.values(), strict=True)]
    (row,) = [
        row
        for row in rows
        if (row["quantity"], row["story"], row["scale"]) == ("peak_drift", 2, 2.0)
    ]
    is_member = np.isclose(runs.scale / runs.varied["record.scale"], 2.0)
    peaks = runs.stories.peak_drift[is_member, 1]
    assert peaks.size == row["samples"] == 3
    assert row["failed"] == 0 and row["unit"] == "m"
    assert row["mean"] == pytest.approx(np.mean(peaks))
    assert row["std"] == pytest.approx(np.std(peaks, ddof=1))
    assert [row["p10"], row["p90"]] == pytest.approx(fractiles(peaks, [0.1, 0.9]))
    with pytest.raises(UsageError, match="require runs with `vary`"):
        tdint.run_many([two_stories()], [noise(samples=20)]).over_samples()
    with pytest.raises(UsageError, match="percentiles must be from 0 to 100"):
        runs.over_samples([101])


ABSORBED = {
    "stories": [{"repeat": 2, "mass": 1e5, "height": 3.0, "stiffness": 4e7}],
    "damping": "3%",
    "attachments": [
        {"name": "tmd", "floor": 2, "mass": 6e3, "stiffness": 4e5, "dashpot": 6e3},
        {
            "name": "tank",
            "floor": 1,
            "mass": 3e3,
            "stiffness": 2e5,
            "law": {"type": "bilinear", "yield_force": 2e2, "hardening": 0.05},
        },
    ],
    "links": [{"name": "damper", "from": "ground", "to": 2, "dashpot": 2e5}],
}


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("attachments[tmd].stiffness", ("attachments", 0, "stiffness")),
        ("attachments[tmd].mass", ("attachments", 0, "mass")),
        ("attachments[tmd].dashpot", ("attachments", 0, "dashpot")),
        ("attachments[tank].law.yield_force", ("attachments", 1, "law", "yield_force")),
        ("links[damper].dashpot", ("links", 0, "dashpot")),
    ],
)
def test_varied_devices_equal_changed_models(name, keys):
    values = []
    for factor in (0.7, 1.3):
        changed = deepcopy(ABSORBED)
        *path, key = keys
        entry = changed
        for part in path:
            entry = entry[part]
        entry[key] *= factor
        values.append(entry[key])
        single = tdint.run(changed, RECORDS[0], check=False)
        varied = tdint.run_many(ABSORBED, RECORDS[0], vary={name: [entry[key]]})
        np.testing.assert_array_equal(varied.stories.peak_drift[0], single.stories.peak_drift)
        replaced = tdint.load_model(ABSORBED).replace(**{name: entry[key]})
        assert replaced.devices == tdint.load_model(changed).devices
    both = tdint.run_many(ABSORBED, RECORDS[0], vary={name: values})
    assert both.stories.peak_drift[0, 0] != both.stories.peak_drift[1, 0]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("attachments[tdm].mass", r"attachments\[tdm\] not found.*attachments\[tmd\]"),
        ("links[damper].mass", r"links\[damper\] of model has no parameter 'mass'"),
        ("links[damper].stiffness", "has no parameter 'stiffness'"),
        ("attachments[tmd].stifness", "did you mean .attachments.tmd..stiffness"),
    ],
)
def test_unknown_devices_and_keys_are_refused(name, message):
    with pytest.raises(UsageError, match=message):
        tdint.run_many(ABSORBED, RECORDS[0], vary={name: [1e5]})


def test_runs_without_records():
    """An initial motion, forces, and the record of the model."""
    free = {**ABSORBED, "initial": {"displacement": [0.01, 0.02]}}
    options = {"dt": 0.01, "duration": 2.0}
    runs = tdint.run_many(free, vary={"mass_factor": [1.0, 1.2]}, history="displacement", **options)
    for i, factor in enumerate((1.0, 1.2)):
        model = tdint.load_model(free).replace(mass_factor=factor)
        single = tdint.run(model, history=True, check=False, **options)
        np.testing.assert_array_equal(runs.stories.peak_drift[i], single.stories.peak_drift)
        np.testing.assert_array_equal(runs.history["displacement"][i], single.history.displacement)
    assert runs.to_dict()["record"] == ["", ""]
    pushed = {**ABSORBED, "excitation": {"forces": [{"floor": 2, "amplitude": 1e4, "omega": 9}]}}
    single = tdint.run(pushed, check=False, **options)
    np.testing.assert_array_equal(
        tdint.run_many(pushed, **options).stories.peak_drift[0], single.stories.peak_drift
    )
    with pytest.raises(UsageError, match="no ground motion to scale"):
        tdint.run_many(free, scales=[1.0, 2.0], **options)
    with pytest.raises(UsageError, match="ground motion is missing"):
        tdint.run_many(ABSORBED)


def test_forces_of_elements_are_histories():
    walled = featured(("elements",))
    scales = (1.0, 2.0)
    runs = tdint.run_many([walled, featured(("power",))], MOTION, scales=scales, history=True)
    assert runs.history["element_force"].shape == (4, runs.history["drift"].shape[1], 2)
    for i, scale in enumerate(scales):
        force = tdint.run(walled, MOTION.scaled(scale), history=True).history.element_force
        kept = runs.history["element_force"][i]
        np.testing.assert_array_equal(kept[: len(force)], force)
        assert np.isnan(kept[len(force) :]).all()
    assert np.isnan(runs.history["element_force"][2:]).all()
    with pytest.raises(UsageError, match="element_force needs a building with several elements"):
        tdint.run_many(featured(("power",)), MOTION, history="element_force")


WITH_DEVICES = {
    "stories": [{"mass": 2e3, "stiffness": 2e6, "repeat": 2}],
    "damping": "2%",
    "attachments": [{"name": "tmd", "floor": 2, "mass": 90.0, "stiffness": 4e4, "dashpot": 90.0}],
    "links": [{"from": 2, "to": "ground", "dashpot": 500.0}],
}


def test_peaks_of_attachments_and_links_are_those_of_single_runs():
    """Also in batches, with a building that has none, and in a part of the runs."""
    models = [tdint.load_model(WITH_DEVICES), two_stories()]
    runs = tdint.run_many(models, RECORDS[0], scales=SCALES, check=False)
    for i, scale in enumerate(SCALES):
        single = tdint.run(models[0], RECORDS[0].scaled(scale), check=False).devices.stories
        for name in ("peak_drift", "peak_shear", "peak_damper_force", "peak_velocity"):
            assert getattr(runs.devices, name)[i].tolist() == getattr(single, name).tolist()
    assert np.isnan(runs.devices.peak_drift[3:]).all()
    assert runs[1:2].devices.peak_drift.tolist() == runs.devices.peak_drift[1:2].tolist()
    assert tdint.run_many(models[1], RECORDS[0]).devices is None


@pytest.mark.parametrize("check", [False, True])
def test_histories_of_attachments_and_links_are_those_of_single_runs(check):
    """Also with error estimates, whose runs are integrated individually."""
    models = [two_stories(), tdint.load_model(WITH_DEVICES)]
    options = {"history": True, "check": check}
    runs = tdint.run_many(models, RECORDS[0], scales=SCALES[:2], every=2, **options)
    devices = tdint.run(models[1], RECORDS[0].scaled(SCALES[1]), **options).history.devices
    names = [name for name in runs.history if name.startswith("device_")]
    assert len(names) == 6
    for name in names:
        expected = getattr(devices, name.removeprefix("device_"))[::2]
        found = runs.history[name]
        np.testing.assert_array_equal(found[3, : len(expected)], expected)
        assert found.shape[2] == 2 and np.isnan(found[:2]).all()
    assert runs.history["device_drift"][3].any(axis=0).all()
    with pytest.raises(UsageError, match="device_drift needs a building with attachments or links"):
        tdint.run_many(models[0], RECORDS[0], history="device_drift")
