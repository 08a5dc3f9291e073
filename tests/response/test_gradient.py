"""Derivatives of peaks: general identities, closed forms, and larger differences."""

import math

import numpy as np
import pytest

import tdint
from building_cases import model, story, ten_bilinear
from selection import every
from tdint.errors import UsageError
from tdint.model.definition import ModalDamping
from tdint.model.story_laws import Law

RECORD = tdint.make_record(5.0 * np.sin(6.0 * np.arange(300) * 0.01), dt=0.01, units="m/s^2")
NAMES = (
    "stories[2].stiffness",
    "stories[1].law.yield_force",
    "mass_factor",
    "damping",
    "record.scale",
)
PEAKS = (
    "peak_drift",
    "peak_absolute_acceleration",
    "peak_shear",
    "peak_velocity",
    "residual_drift",
)


def test_derivatives_satisfy_euler_theorem():
    """Drifts are homogeneous of degree one in scale and strength, and of degree zero in masses,
    springs and strengths for given damping ratios and scale. Euler's theorem holds to the accuracy
    of the differences between neighbors."""
    names = ("record.scale", "strength_factor", "mass_factor", "stiffness_factor")
    response = tdint.run(ten_bilinear(), RECORD, method="impulse4", gradient=names)
    by = dict(zip(names, response.gradient.peak_drift, strict=True))
    drift = response.stories.peak_drift
    assert np.max(response.stories.ductility) > 1.5
    np.testing.assert_allclose(by["record.scale"] + by["strength_factor"], drift, rtol=1e-6)
    together = by["mass_factor"] + by["stiffness_factor"] + by["strength_factor"]
    np.testing.assert_allclose(together, 0.0, atol=1e-5 * drift.max())
    linear = tdint.run(
        model([story(1e5, 1e7)], damping=ModalDamping((0.05,))), RECORD, gradient="record.scale"
    )
    np.testing.assert_allclose(linear.gradient.peak_drift[0], linear.stories.peak_drift, rtol=1e-10)
    assert linear.gradient.by and linear.gradient.parameters == ("record.scale",)


def test_derivatives_of_free_oscillator_agree_with_closed_form():
    """For an initial velocity v0, the maximum drift is u = v0 / omega; its derivatives are -u / 2k
    by the stiffness and u / 2 by the mass factor."""
    free = model([story(1e5, 1e7)], velocity=(0.1,), dt=0.002, duration=1.0)
    response = tdint.run(free, method="impulse4", gradient=["stories[1].stiffness", "mass_factor"])
    largest = 0.1 / math.sqrt(1e7 / 1e5)
    np.testing.assert_allclose(response.stories.peak_drift, largest, rtol=1e-5)
    np.testing.assert_allclose(
        response.gradient.peak_drift[:, 0], [-0.5 * largest / 1e7, 0.5 * largest], rtol=1e-4
    )  # the peak between steps is found to 1e-5


@pytest.mark.parametrize("method", every(3, ["impulse4", "newmark-average", "hht"]))
def test_gradient_agrees_with_larger_differences(method):
    """One call for many runs gives the derivatives of each single run to the last bit, also with a
    history."""
    building = ten_bilinear(ModalDamping((0.05,)))
    response = tdint.run(building, RECORD, method=method, gradient=NAMES, history=True)
    for number, name in enumerate(NAMES):
        value = response.gradient.values[number]
        near = value * np.array([1.0 - 1e-5, 1.0 + 1e-5])
        runs = tdint.run_many(building, RECORD, method=method, vary={name: near}, history="drift")
        for peak in PEAKS:
            values = getattr(runs.stories, peak)
            expected = (values[1] - values[0]) / (near[1] - near[0])
            found = getattr(response.gradient, peak)[number]
            error = np.abs(found - expected) / np.max(np.abs(expected))
            # Some stories are at kinks. Methods that do not locate yielding have a kink if yielding
            # starts at the end of a step, which is small for drifts and large for accelerations.
            room = {"peak_absolute_acceleration": 0.1, "peak_drift": 1e-4}.get(peak, 1e-2)
            assert np.median(error) < (1e-4 if method == "impulse4" else room), f"{name} {peak}"
        expected = (runs.history["drift"][1] - runs.history["drift"][0]) / (near[1] - near[0])
        found = response.gradient.history["drift"][number][: len(expected)]
        room = 1e-3 if method == "impulse4" else 0.05
        np.testing.assert_allclose(found, expected, atol=room * np.max(np.abs(expected)))
    runs = tdint.run_many(
        building, [RECORD, RECORD], method=method, scales=[0.5, 1.0], gradient=NAMES
    )
    assert runs.gradient.peak_drift.shape == (4, len(NAMES), 10)
    np.testing.assert_array_equal(runs.gradient.peak_drift[3], response.gradient.peak_drift)


def test_each_sample_has_its_own_derivatives():
    """Derivatives are taken at the sampled values of varied parameters, and at the values of the
    model for other parameters."""
    vary = {"stiffness_factor": [0.8, 1.1], "stories[1].stiffness": [9e7, 1e8]}
    names = ("stories[1].stiffness", "stiffness_factor", "damping")
    building = ten_bilinear(ModalDamping((0.05,)))
    drawn = tdint.run_many(building, RECORD, vary=vary, gradient=names)
    np.testing.assert_array_equal(drawn.gradient.values, [[9e7, 0.8, 0.05], [1e8, 1.1, 0.05]])
    for name in names:
        number = names.index(name)
        value = drawn.gradient.values[1, number]
        near = [
            {**{key: values[1] for key, values in vary.items()}, name: value * (1.0 + d)}
            for d in (-1e-5, 1e-5)
        ]
        below, above = (
            tdint.run(building.replace(**changes), RECORD).stories.peak_drift for changes in near
        )
        expected = (above - below) / (2e-5 * value)
        np.testing.assert_allclose(
            drawn.gradient.peak_drift[1, number], expected, atol=1e-3 * np.max(np.abs(expected))
        )


@pytest.mark.long
def test_kink_is_reported():
    """At the scale for which the peak of the motion equals the initial drift, the derivative jumps
    from 0 to the derivative of the motion. At other scales, both sides agree."""
    building = model([story(1e5, 1e7)], damping=ModalDamping((0.05,)), displacement=(0.02,))

    def peak(scale):
        return tdint.run(building, RECORD.scaled(scale)).stories.peak_drift[0]

    equal, above = 0.01, 4.0
    while above - equal > 1e-9:
        middle = 0.5 * (equal + above)
        equal, above = (equal, middle) if peak(middle) > 0.02 else (middle, above)
    slope = equal * (peak(equal + 1e-4) - 0.02) / 1e-4
    for factor, derivative, kink in ((1.0, 0.5, 0.5), (1.01, 1.0, 0.0), (0.8, 0.0, 0.0)):
        gradient = tdint.run(
            building, RECORD.scaled(factor * equal), gradient="record.scale"
        ).gradient
        assert gradient.peak_drift[0, 0] / slope == pytest.approx(derivative, abs=0.02)
        assert gradient.kink.peak_drift[0, 0] / slope == pytest.approx(kink, abs=1e-2)


def test_derivative_at_end_of_range_is_one_sided():
    """The derivative by a hardening of 0 is the derivative of the parabola through 0, s and 2 s."""
    building = model([story(1e5, 1e7, Law("bilinear", (1e5, 0.0)))], damping=ModalDamping((0.05,)))
    gradient = tdint.run(
        building, RECORD, gradient=["stories[1].law.hardening", "stories[1].dashpot"]
    ).gradient
    runs = tdint.run_many(building, RECORD, vary={"stories[1].law.hardening": [0.0, 1e-5]})
    expected = (runs.stories.peak_drift[1] - runs.stories.peak_drift[0]) / 1e-5
    np.testing.assert_allclose(gradient.peak_drift[0], expected, rtol=1e-3)
    assert np.all(np.isfinite(gradient.peak_drift[1]))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("stories.stiffness", "must be the same in all stories"),
        ("stories[0].stiffness", "counting starts at 1"),
        ("stiffnes_factor", "did you mean 'stiffness_factor'"),
        ("damping", "damping requires a model with damping ratios"),
    ],
)
def test_invalid_gradient_parameter_is_refused(name, message):
    building = model([story(1e5, 1e7), story(1e5, 2e7)])
    for call in (tdint.run, tdint.run_many):
        with pytest.raises(UsageError, match=message):
            call(building, RECORD, gradient=[name])


def test_sample_out_of_range_keeps_its_row():
    """The row is kept on request, and the other runs are unchanged."""
    building = ten_bilinear(ModalDamping((0.05,)))
    vary = {
        "damping": [0.02, 1.5, 0.03],
        "stories[1].stiffness": [1e8, 1e8, -1.0],
        "record.scale": [1.0, 1.0, 0.0],
    }
    with pytest.raises(UsageError, match=r"damping .* ratio|stiffness .* positive"):
        tdint.run_many(building, RECORD, vary=vary)
    runs = tdint.run_many(building, RECORD, vary=vary, errors="keep", gradient="damping")
    assert runs.status.tolist() == ["done", "out-of-range", "out-of-range"]
    assert "got 1.5" in runs.failures[1] and "got -1.0" in runs.failures[2]
    alone = tdint.run_many(
        building, RECORD, vary={name: values[:1] for name, values in vary.items()}
    )
    np.testing.assert_array_equal(runs.stories.peak_drift[0], alone.stories.peak_drift[0])
    assert (
        np.isnan(runs.stories.peak_drift[1:]).all() and np.isnan(runs.gradient.peak_drift[1:]).all()
    )
    assert np.isfinite(runs.gradient.peak_drift[0]).all()
    with pytest.raises(UsageError, match="'raise' or 'keep'"):
        tdint.run_many(building, RECORD, errors="ignore")


def test_derivative_of_wrong_sign_has_large_error():
    """At the default method and time step the derivative of story 2 has the wrong sign; its kink is
    small, and the estimated error is larger than the derivative and covers the true error."""
    law = {"type": "bilinear", "hardening": 0.05}
    story_1, story_2 = (
        {"mass": 1e5, "height": 3.0, "stiffness": k, "law": {**law, "yield_force": force}}
        for k, force in ((1.32e8, 4.15e5), (1.96e8, 4.33e5))
    )
    building = {"stories": [story_1, story_2], "damping": "2%"}
    motion = 3.0 * np.random.default_rng(50).standard_normal(300)
    record = tdint.make_record(motion, dt=0.02, units="m/s^2")
    gradient = tdint.run(building, record, gradient="record.scale").gradient
    true = tdint.run(building, record, gradient="record.scale", dt=0.02 / 32, check=False).gradient
    assert true.errors is None and "errors not estimated" in repr(true)
    found, expected = gradient.peak_drift[0], true.peak_drift[0]
    assert expected[1] < 0.0 < found[1]
    assert gradient.errors.peak_drift[0, 1] > abs(found[1]) > 100.0 * gradient.kink.peak_drift[0, 1]
    assert np.all(np.abs(found - expected) < gradient.errors.peak_drift[0])


@pytest.mark.parametrize(
    ("method", "factor", "least"),
    every(3, [("impulse4", 3.0, 0.5), ("moment4", 3.0, 0.5), ("newmark-average", 4.0 / 3.0, 0.2)]),
)
def test_errors_of_derivatives_agree_with_two_calls(method, factor, least):
    """The estimate follows from a call with half the time step of impulse4, with the factors of the
    errors of peaks; many runs agree."""
    building = ten_bilinear(ModalDamping((0.05,)))
    names = ("record.scale", "mass_factor")
    gradient = tdint.run(building, RECORD, method=method, gradient=names).gradient
    half = tdint.run(
        building, RECORD, method="impulse4", dt=0.005, gradient=names, check=False
    ).gradient
    difference = factor * np.abs(gradient.peak_drift - half.peak_drift)
    common = least * np.sqrt(np.mean(difference**2, axis=1, keepdims=True))
    expected = np.maximum(np.maximum(difference, common), 1e-5 * np.abs(gradient.peak_drift))
    np.testing.assert_allclose(gradient.errors.peak_drift, expected, rtol=1e-12)
    many = tdint.run_many(
        [building, model([story(1e5, 1e7)], damping=ModalDamping((0.05,)))],
        RECORD,
        method=method,
        gradient=names,
        check=True,
    )
    np.testing.assert_array_equal(
        many.gradient.select_run(0).errors.peak_drift, gradient.errors.peak_drift
    )
    assert np.all(np.isnan(many.gradient.errors.peak_drift[1, :, 1:]))
    assert np.all(np.isfinite(many.gradient.errors.peak_drift[1, :, 0]))
    assert tdint.run_many(building, RECORD, gradient=names).gradient.errors is None


def test_gradient_table_has_row_for_each_parameter_and_story():
    names = ("record.scale", "mass_factor")
    building = ten_bilinear(ModalDamping((0.05,)))
    gradient = tdint.run(building, RECORD, gradient=names).gradient
    table = gradient.to_dict()
    assert table["parameter"] == [name for name in names for _ in range(10)]
    np.testing.assert_array_equal(table["story"], [*range(1, 11)] * 2)
    np.testing.assert_array_equal(table["peak_drift"], gradient.peak_drift.ravel())
    np.testing.assert_array_equal(table["peak_drift_error"], gradient.errors.peak_drift.ravel())
    np.testing.assert_array_equal(table["value"], 1.0)
    assert "peak_drift_error" in gradient._repr_html_()
    with pytest.raises(UsageError, match="units cannot be selected"):
        gradient.to_dict("kip,in,g")
    many = tdint.run_many(building, RECORD, scales=[1.0, 2.0], gradient=names).gradient
    table = many.to_dict()
    np.testing.assert_array_equal(table["run"], [0] * 20 + [1] * 20)
    np.testing.assert_array_equal(table["peak_shear"], many.peak_shear.ravel())
    assert "peak_drift_error" not in table


TREE = {
    "stories": [
        {"repeat": 3, "mass": 1e5, "height": 3.0, "stiffness": 8e7,
         "law": {"type": "bilinear", "yield_force": 3e5, "hardening": 0.05}}
    ],
    "attachments": [{"name": "tmd", "floor": 3, "mass": 6e3, "stiffness": 4e5, "dashpot": 6e3}],
    "links": [{"name": "damper", "from": 2, "to": "ground", "dashpot": 2e6, "stiffness": 1e5}],
    "damping": "3%",
}  # fmt: skip


def test_derivatives_of_strokes_and_forces_of_attachments_and_links():
    """Euler's theorem in scale and strengths, differences of two further runs, and the same numbers
    in many runs, also beside a building without attachments."""
    names = ("record.scale", "strength_factor", "attachments[tmd].stiffness")
    response = tdint.run(TREE, RECORD, gradient=names, history=True)
    gradient, peaks = response.gradient.devices, response.devices.stories
    for quantity in ("peak_drift", "peak_shear", "peak_damper_force", "peak_absolute_acceleration"):
        derivatives, values = getattr(gradient, quantity), getattr(peaks, quantity)
        np.testing.assert_allclose(derivatives[0] + derivatives[1], values, rtol=1e-7)
    near = 4e5 * np.array([1.0 - 1e-3, 1.0 + 1e-3])
    runs = tdint.run_many(TREE, RECORD, vary={names[2]: near}, history="device_shear")
    for quantity in ("peak_drift", "peak_shear"):
        below, above = getattr(runs.devices, quantity)
        expected, found = (above - below) / (near[1] - near[0]), getattr(gradient, quantity)[2]
        np.testing.assert_allclose(found, expected, atol=1e-4 * np.max(np.abs(expected)))
    below, above = runs.history["device_shear"]
    expected = (above - below) / (near[1] - near[0])
    found = response.gradient.history["device_shear"][2][: len(expected)]
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.max(np.abs(expected)))
    models = [ten_bilinear(ModalDamping((0.05,))), TREE]
    many = tdint.run_many(models, RECORD, gradient=names[:2], check=True).gradient.devices
    np.testing.assert_array_equal(many.peak_drift[1], gradient.peak_drift[:2])
    np.testing.assert_array_equal(many.errors.peak_shear[1], gradient.errors.peak_shear[:2])
    assert np.isnan(many.peak_drift[0]).all() and (gradient.errors.peak_drift > 0.0).all()
    assert list(gradient.to_dict())[:3] == ["parameter", "device", "value"]
