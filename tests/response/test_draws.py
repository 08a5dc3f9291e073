"""Samples as arrays: each run equals the run of the building of `Model.replace` to the last bit."""

from dataclasses import fields

import numpy as np
import pytest

import tdint
from tdint.errors import TdintError, UsageError
from tdint.response.run_plan import RunsRequest

DRAWS = 9
SOURCE = np.random.default_rng(5)
RECORD = tdint.make_record(
    4.0 * np.sin(7.0 * np.arange(200) * 0.01), dt=0.01, units="m/s^2", name="wave"
)
SHORT = tdint.make_record(
    3.0 * np.cos(4.0 * np.arange(150) * 0.01), dt=0.01, units="m/s^2", name="short"
)
STORY = {"mass": 2e5, "height": 3.5, "stiffness": 3e8}
BILINEAR = {"type": "bilinear", "yield_force": 1.5e6, "hardening": 0.03}
BACKBONE = {
    "type": "multilinear-pinching",
    "backbone": [[0.005, 1.5e6], [0.02, 2e6], [0.06, 2.2e6], [0.1, 1e6]],
}
PINCHED = {
    **BACKBONE,
    "pinching": {"drift": 0.5, "force": 0.3, "unloading": 0.0},
    "degradation": {"capacity": 50.0},
}


def model(law, **more):
    return tdint.load_model(
        {"stories": [{**STORY, "repeat": 3, "law": law}], "damping": "5%", **more}
    )


def near(value, part=0.1):
    return value * SOURCE.uniform(1.0 - part, 1.0 + part, DRAWS)


CASES = {
    "bilinear, Rayleigh": (
        model(BILINEAR),
        {
            "stories.mass": near(2e5),
            "stories[2].stiffness": near(3e8),
            "stories[3].law.hardening": near(0.03),
            "strength_factor": near(1.0),
            "damping": near(0.05),
            "stories[1].height": near(3.5),
        },
    ),
    "dashpots that some draws have": (
        model(BILINEAR),
        {"stories[2].dashpot": [0.0, 1e6] * 4 + [2e6]},
    ),
    "power-law dashpots": (
        tdint.load_model(
            {
                "stories": [
                    {
                        **STORY,
                        "law": BILINEAR,
                        "dashpot": {"coefficient": 5e5, "exponent": 0.5, "linear_below": 0.01},
                    }
                ],
                "damping": "2%",
            }
        ),
        {
            "stories.dashpot.coefficient": near(5e5),
            "stories.dashpot.exponent": near(0.5),
            "stories.dashpot.linear_below": near(0.01),
        },
    ),
    "relief valves with braces": (
        tdint.load_model(
            {
                "stories": [
                    {
                        **STORY,
                        "repeat": 2,
                        "dashpot": {
                            "coefficient": 5e6,
                            "exponent": 1.0,
                            "brace": 1e9,
                            "relief": {"force": 2e5, "ratio": 0.1},
                        },
                    }
                ],
                "damping": {"rayleigh": {"ratio": 0.02, "modes": [1]}},
            }
        ),
        {
            "stories[2].dashpot.brace": near(1e9),
            "stories[1].dashpot.relief.force": near(2e5),
            "damping": near(0.02),
        },
    ),
    "P-delta, seven stories": (
        tdint.load_model(
            {"stories": [{**STORY, "repeat": 7, "law": BILINEAR}], "damping": "3%", "p_delta": True}
        ),
        {"stories[2].height": near(3.5), "mass_factor": near(1.0), "stiffness_factor": near(1.0)},
    ),
    "modal damping": (
        model(BILINEAR, damping={"modal": 0.05}),
        {"damping": near(0.05), "stories[1].mass": near(2e5)},
    ),
    "a law with its own stiffness": (
        tdint.load_model(
            {
                "stories": [
                    {"mass": 2e5, "law": {"type": "polynomial", "coefficients": [3e8, 0.0, -1e11]}},
                    {"mass": 2e5, "height": 3.5, "law": PINCHED},
                ]
            }
        ),
        {
            "stories[1].law.coefficients[1]": near(3e8),
            "stories.mass_factor": near(1.0),
            "stories[2].law.backbone[1].force": near(1.5e6),
            "story 2.strength_factor": near(1.0, 0.05),
        },
    ),
}


def same(many, separate):
    for quantity in fields(many.stories):
        drawn, alone = (
            getattr(many.stories, quantity.name),
            getattr(separate.stories, quantity.name),
        )
        np.testing.assert_array_equal(drawn, alone, err_msg=quantity.name)
    np.testing.assert_array_equal(many.energy_error, separate.energy_error)
    np.testing.assert_array_equal(many.steps, separate.steps)
    assert many.status.tolist() == separate.status.tolist()


def replaced_buildings(building, values):
    return [
        building.replace(**{name: float(column[d]) for name, column in values.items()})
        for d in range(DRAWS)
    ]


@pytest.mark.parametrize("name", CASES)
def test_sample_equals_building_made_by_replace(name):
    building, values = CASES[name]
    drawn = tdint.run_many(building, RECORD, vary=values, scales=[0.5, 2.0], method="impulse4")
    same(
        drawn,
        tdint.run_many(
            replaced_buildings(building, values), RECORD, scales=[0.5, 2.0], method="impulse4"
        ),
    )
    # the varied parameters affect the results
    assert len({*drawn.stories.peak_drift[:, 0].tolist()}) >= 6
    for key, column in values.items():
        np.testing.assert_array_equal(drawn.varied[key], np.repeat(column, 2))


@pytest.mark.parametrize("name", CASES)
def test_samples_are_prepared_in_one_batch(name, monkeypatch):
    building, values = CASES[name]
    prepared, varied = [], RunsRequest.varied
    monkeypatch.setattr(
        RunsRequest, "varied", lambda *key: prepared.append(key) or varied(*key), raising=True
    )
    runs = tdint.run_many(building, SHORT, vary=values, method="impulse4", jobs=1)
    assert set(runs.status) == {"done"}
    # A dashpot that only some samples have changes the flags of the time loop.
    assert len(prepared) == (DRAWS if name == "dashpots that some draws have" else 1)


@pytest.mark.parametrize(
    ("method", "more"),
    [
        ("moment4", {"check": True}),
        ("newmark-average", {"history": "drift"}),
        ("central-difference", {"dt": 0.005}),
    ],
)
def test_building_properties_are_determined_for_each_sample(method, more):
    building, values = CASES["bilinear, Rayleigh"]
    drawn = tdint.run_many(building, [RECORD, SHORT], vary=values, method=method, **more)
    separate = tdint.run_many(
        replaced_buildings(building, values), [RECORD, SHORT], method=method, **more
    )
    same(drawn, separate)
    if "history" in more:
        np.testing.assert_array_equal(drawn.history["drift"], separate.history["drift"])
    if "check" in more:
        np.testing.assert_array_equal(drawn.errors.peak_drift, separate.errors.peak_drift)


def test_products_and_pairs_of_varied_parameters():
    building = model(BILINEAR)
    grid = tdint.run_many(
        building,
        RECORD,
        vary={"damping": [0.02, 0.05], "record.scale": [1.0, 2.0, 3.0]},
        product=True,
    )
    columns = grid.to_dict()
    assert columns["damping"].tolist() == [0.02] * 3 + [0.05] * 3
    assert (
        columns["record.scale"].tolist() == [1.0, 2.0, 3.0] * 2
        and grid.scale.tolist() == [1.0, 2.0, 3.0] * 2
    )
    single = tdint.run(building.replace(damping=0.05), RECORD.scaled(2.0))
    np.testing.assert_array_equal(grid.stories.peak_drift[4], single.stories.peak_drift)
    pairs = tdint.run_many(
        building, [RECORD, SHORT], vary={"damping": [0.02, 0.05]}, zip_records=True
    )
    assert pairs.record.tolist() == [0, 1] and pairs.varied["damping"].tolist() == [0.02, 0.05]


def test_collapsed_sample_has_status_of_single_run():
    building = model(BILINEAR, collapse_drift=0.02)
    values = {"strength_factor": np.linspace(0.1, 3.0, DRAWS)}
    drawn = tdint.run_many(building, RECORD, scales=[0.1, 3.0], vary=values)
    same(drawn, tdint.run_many(replaced_buildings(building, values), RECORD, scales=[0.1, 3.0]))
    assert {"done", "collapsed"} <= set(drawn.status.tolist())


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({"stories[2].law.hardning": [0.1]},
         r"stories\[2\]\.law\.hardning.*did you mean 'law\.hardening'"),
        ({"stories[4].mass": [1.0]}, "has 3 stories"),
        ({"storeys[2].mass": [1.0]}, "unknown parameter"),
        ({"stories[2].mas": [1.0]}, r"did you mean 'stories\[2\]\.mass'"),
        ({"stories[2].law.hardening": [0.1, 1.0]}, "between -1 and 1"),
        ({"stories.mass": [1e5, -1e5]}, "positive"),
        ({"stories.mass": [1e5, np.nan]}, "must be"),
        ({"damping": [0.1, 1.2]}, "damping"),
        ({"damping": [0.1, 0.2], "stories.mass": [1e5, 2e5, 3e5]},
         "2 of damping, 3 of stories.mass"),
        ({"damping": []}, "0 of damping"),
        ({"record.scale": [0.0]}, "other than zero"),
        ({"stories[1].law.coefficients[1]": [1.0]}, "law.coefficients"),
        ({3: [1.0]}, "unknown parameter"),
        (5, "vary"),
    ],
)  # fmt: skip
def test_invalid_vary_is_refused_before_first_run(vary, message):
    with pytest.raises(TdintError, match=message):
        tdint.run_many(model(BILINEAR), RECORD, vary=vary)


def test_progress_is_reported_without_bar_in_pipe(capfd):
    calls = []
    tdint.run_many(
        model(BILINEAR),
        RECORD,
        scales=np.linspace(0.1, 1.0, 130),
        progress=lambda *progress: calls.append(progress),
    )
    assert calls[-1] == (130, 130) and [done for done, _ in calls] == sorted(
        done for done, _ in calls
    )
    pytest.importorskip("tqdm")
    tdint.run_many(model(BILINEAR), RECORD, progress=True)
    assert capfd.readouterr() == ("", "")


def test_interrupt_before_first_run_gives_empty_result(monkeypatch):
    """The interrupt occurs while the buildings are prepared, or while the first batch waits."""

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("tdint.response.runs.run_many.plan_runs", interrupt)
    empty = tdint.run_many(model(BILINEAR), RECORD, partial=True, gradient="record.scale")
    assert len(empty.status) == 0 and empty.failures == {} and empty.gradient is None
    assert "0 of" in repr(empty) and empty.time.shape == (0, 0)
    assert all(len(column) == 0 for column in empty.to_dict().values())
    with pytest.raises(UsageError, match="at least one run"):
        empty.plot()
    with pytest.raises(KeyboardInterrupt):
        tdint.run_many(model(BILINEAR), RECORD)
    monkeypatch.undo()
    monkeypatch.setattr("tdint.response.runs.run_many.on_threads", interrupt)
    runs = tdint.run_many(model(BILINEAR), RECORD, partial=True)
    assert runs.status.tolist() == ["interrupted"] and len(runs.failures) == 1


def test_interrupt_gives_completed_runs():
    def interrupt(done, of):
        raise KeyboardInterrupt

    building, scales = model(BILINEAR), np.linspace(0.1, 1.0, 640)
    runs = tdint.run_many(building, RECORD, scales=scales, jobs=1, progress=interrupt, partial=True)
    done = runs.status == "done"
    assert 64 <= done.sum() < 640 and set(runs.status.tolist()) == {"done", "interrupted"}
    assert (
        np.isfinite(runs.stories.peak_drift[done]).all()
        and np.isnan(runs.stories.peak_drift[~done]).all()
    )
    complete = tdint.run_many(building, RECORD, scales=scales)
    np.testing.assert_array_equal(runs.stories.peak_drift[done], complete.stories.peak_drift[done])
    assert len(runs.failures) == 640 - done.sum()
    with pytest.raises(KeyboardInterrupt):
        tdint.run_many(building, RECORD, scales=scales, progress=interrupt)
    with pytest.raises(UsageError, match="progress"):
        tdint.run_many(building, RECORD, progress="yes")


DEVICES = tdint.load_model(
    {
        "units": {"force": "kN", "length": "cm", "mass": "t"},
        "stories": [
            {
                "repeat": 2,
                "mass": 100,
                "height": 300,
                "dashpot": 2,
                "stiffness": 400,
                "law": {"type": "bilinear", "yield_force": 400, "hardening": 0.05},
            }
        ],
        "damping": "3%",
        "attachments": [{"name": "tmd", "floor": "roof", "mass": 6, "stiffness": 4}],
    }
)


@pytest.mark.parametrize(
    ("name", "text", "number"),
    [
        ("stories[1].stiffness", "500 kN/cm", 5e7),
        ("stories.mass", "120 t", 1.2e5),
        ("stories.mass", "0.5 kip*s^2/in", 0.5 * 1e3 * 0.45359237 * 9.80665 / 0.0254),
        ("stories[2].height", "10 ft", 3.048),
        ("stories[2].dashpot", "3 kN*s/cm", 3e5),
        ("stories.law.yield_force", "500kN", 5e5),
        ("stories.law.hardening", "2%", 0.02),
        ("attachments[tmd].stiffness", "5 kN / cm", 5e5),
        ("mass_factor", "110%", 1.1),
        ("damping", "2%", 0.02),
    ],
)
def test_texts_state_the_unit_of_a_value(name, text, number):
    assert DEVICES.si_value(name, text) == pytest.approx(number, rel=1e-14)
    assert DEVICES.si_value(name, number) == number
    assert DEVICES.replace(**{name: text}).varied_parameters == (
        (name, DEVICES.si_value(name, text)),
    )


def test_texts_and_numbers_are_the_same_samples():
    names = {"stories[1].stiffness": ["450 kN/cm", 5e7], "damping": "2%"}
    texts = tdint.run_many(DEVICES, RECORD, vary=names)
    numbers = tdint.run_many(
        DEVICES, RECORD, vary={"stories[1].stiffness": [4.5e7, 5e7], "damping": 0.02}
    )
    assert texts.varied["damping"].tolist() == [0.02, 0.02]
    np.testing.assert_array_equal(texts.stories.peak_drift, numbers.stories.peak_drift)
    assert texts.stories.peak_drift[0, 0] != texts.stories.peak_drift[1, 0]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("stories[1].stiffness", "500 kN", "number in SI units, or a text of a number with a unit"),
        ("stories.mass", "120 kN", "kg, t, lb"),
        ("stories.law.hardening", "2 kN", "neither a ratio"),
        ("stories[1].stiffness", "", "got ''"),
        ("stories[7].stiffness", "5 kN/m", "story not found"),
    ],
)
def test_other_units_are_refused(name, text, message):
    with pytest.raises(UsageError, match=message):
        DEVICES.replace(**{name: text})
    with pytest.raises(UsageError, match=message):
        tdint.run_many(DEVICES, RECORD, vary={name: [text]})
