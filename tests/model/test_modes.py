"""Single frequencies of tall buildings compared with their closed form, and limits of memory."""

import math
import threading

import numpy as np
import pytest

from building_cases import FIVE_PERCENT, model, story
from facts import states
from tdint.arrays import cached_property
from tdint.errors import ModelError
from tdint.model.building import assemble
from tdint.model.definition import ModalDamping, RayleighRatio
from tdint.model.model_notes import model_notes
from tdint.model.modes import FreeVibration
from tdint.model.plausibility import negative_damping
from tdint.response.arguments import model_of


@pytest.mark.parametrize("stories", [101, 3000])
def test_single_frequencies_of_uniform_building(stories):
    """The frequencies are omega_j = 2 sqrt(k / m) sin((2 j - 1) pi / (2 (2 n + 1)))."""
    mass, stiffness, link = np.full(stories, 2e5), np.full(stories, 3e8), np.ones(stories)
    link[0] = 0.0
    vibration = FreeVibration(mass, stiffness, link)
    for mode in (1, 2, stories // 2, stories):
        exact = (
            2.0
            * math.sqrt(3e8 / 2e5)
            * math.sin((2 * mode - 1) * math.pi / (2 * (2 * stories + 1)))
        )
        assert vibration.frequency(mode) == pytest.approx(exact, rel=1e-12)


def test_negative_damping_ratio_is_returned():
    """Ratios of two modes that differ much give Rayleigh damping with a negative coefficient."""
    stories = [story(2e5, 3e8)] * 4
    building = assemble(model(stories, damping=RayleighRatio((0.05, 0.001), (1, 2))))
    modes, damping = building.modes(), building.damping_matrix()
    a0 = 2.0 * np.linalg.solve([[1.0 / w, w] for w in modes.omega[:2]], [0.05, 0.001])
    ratios = 0.5 * (a0[0] / modes.omega + a0[1] * modes.omega)
    assert ratios.min() < -0.001
    np.testing.assert_allclose(modes.own_damping(damping), ratios, rtol=1e-9)
    assert modes.damping_ratios(damping) is None
    assert states(*negative_damping(building), "mode 3, 4")
    assert negative_damping(assemble(model(stories, damping=FIVE_PERCENT))) == []


def test_rayleigh_damping_solves_only_for_its_modes(monkeypatch):
    def refuse(*_):
        raise AssertionError("all modes are solved for")

    monkeypatch.setattr("tdint.model.modes.solve_modes", refuse)
    damping = RayleighRatio((0.05, 0.05), (1, 3))
    building = assemble(model([story(2e5, 3e8)] * 2000, damping=damping))
    omega, ratio = building.first_mode()
    assert ratio == pytest.approx(0.05, rel=1e-10)
    assert omega == pytest.approx(building.vibration.frequency(1), rel=1e-12)


@pytest.mark.parametrize("seed", range(12))
def test_first_mode_agrees_with_solution_for_all_modes(seed):
    """Frequency and damping ratio of the first mode alone agree with the solution for all modes,
    with story dampers, floor dampers and modal damping."""
    building = assemble(
        model(
            [story(2e5 + 1e4 * i * seed, 3e8 - 2e7 * i, dashpot=1e5 * (i % 2)) for i in range(8)],
            damping=(FIVE_PERCENT, ModalDamping((0.02 + 0.001 * seed,)), None)[seed % 3],
        )
    )
    omega, ratio = building.first_mode()
    modes = building.modes()
    assert modes.omega[0] == pytest.approx(omega, rel=1e-10)
    assert modes.own_damping(building.damping_matrix())[0] == pytest.approx(ratio, rel=1e-8)


@pytest.mark.parametrize("seed", range(12))
def test_first_frequency_bound_is_maximum_row_sum(seed):
    """By Gershgorin, sqrt(max_i sum_j |M^-1 K|_ij) is an upper bound of the largest frequency."""
    rng = np.random.default_rng(seed)
    masses, springs = rng.uniform(1e5, 4e5, 7), rng.uniform(1e8, 9e8, 7)
    building = assemble(model([story(m, k) for m, k in zip(masses, springs, strict=True)]))
    row_sums = np.abs(building.stiffness_matrix() / building.mass[:, None]).sum(axis=1)
    bound = math.sqrt(row_sums.max())
    largest = building.vibration.frequency(7)
    assert largest <= building.fastest <= bound * (1.0 + 1e-12)
    springs = building.initial_stiffness
    assert building.frequency_bound(springs) == pytest.approx(bound, rel=1e-12)


@pytest.mark.long
def test_modal_damping_exceeding_memory_is_refused(monkeypatch):
    monkeypatch.setattr("os.sysconf", {"SC_PAGE_SIZE": 2**12, "SC_PHYS_PAGES": 2**22}.__getitem__)
    with pytest.raises(ModelError, match=r"100000 stories .*298 GiB .*16 GiB; use"):
        assemble(model([story(2e5, 3e8)] * 100_000, damping=ModalDamping((0.05,))))


def test_cached_property_holds_no_shared_lock():
    """While one thread computes the property of an instance, other threads compute it for other
    instances, as a forked child must."""

    class Slow:
        def __init__(self):
            self.begun, self.go_on = threading.Event(), threading.Event()

        @cached_property
        def value(self):
            self.begun.set()
            self.go_on.wait(20.0)
            return 1

    first, second = Slow(), Slow()
    second.go_on.set()
    thread = threading.Thread(target=lambda: first.value)
    thread.start()
    first.begun.wait()
    found = threading.Thread(
        target=lambda: second.value
    )  # of another instance, because Python before 3.12 has one lock for all instances
    found.start()
    found.join(5.0)
    assert vars(second).get("value") == 1
    first.go_on.set()
    thread.join()


def test_last_of_several_modal_ratios_applies_to_all_further_modes():
    """Without it, the higher modes would be undamped without a word."""
    stories = [story(2e5, 3e8)] * 5
    ratios = (0.05, 0.03)
    building = assemble(model(stories, damping=ModalDamping(ratios)))
    modes = building.modes()
    damping = np.diagonal(modes.modal_damping(building.damping_matrix())) / (2.0 * modes.omega)
    assert damping == pytest.approx([0.05, 0.03, 0.03, 0.03, 0.03])
    (note,) = model_notes(model(stories, damping=ModalDamping(ratios)))
    assert note == "the last of 2 modal damping ratios, 3 %, applies to modes 3 to 5, too"
    for explicit in ((0.05,), (0.05, 0.0), (0.05,) * 5):
        assert model_notes(model(stories, damping=ModalDamping(explicit))) == []
    undamped = assemble(model(stories, damping=ModalDamping((0.05, 0.0))))
    assert len(undamped.modal) == 1


@pytest.mark.parametrize("seed", range(10))
def test_complex_modes_agree_with_eigenvalues_of_state_matrix(seed):
    """The reference contains the deformations of the dampers instead of their forces."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 7))
    mass, stiffness = random.uniform(50.0, 200.0, n), random.uniform(1e4, 1e5, n)
    damper, brace = random.uniform(50.0, 2000.0, n), random.uniform(1e4, 2e5, n)
    kind = random.integers(0, 3, n)  # no damper, plain, with a brace
    kind[0] = 2 - seed % 2
    stories = []
    for i in range(n):
        entry = {"mass": mass[i], "stiffness": stiffness[i]}
        if kind[i] == 1:
            entry["dashpot"] = damper[i]
        elif kind[i] == 2:
            entry["dashpot"] = {"coefficient": damper[i], "brace": brace[i]}
        stories.append(entry)
    building = assemble(model_of({"stories": stories, "damping": "none"}))
    found = building.complex_modes().eigenvalues
    drifts = np.eye(n) - np.eye(n, k=-1)
    braced, plain = kind == 2, np.where(kind == 1, damper, 0.0)
    rows = drifts[braced]
    k, c = brace[braced], damper[braced]
    zero, one = np.zeros((n, n)), np.eye(n)
    stiff = drifts.T @ np.diag(stiffness) @ drifts + rows.T @ np.diag(k) @ rows
    state = np.block(
        [
            [zero, one, np.zeros((n, k.size))],
            [
                -stiff / mass[:, None],
                -(drifts.T @ np.diag(plain) @ drifts) / mass[:, None],
                (rows.T * k) / mass[:, None],
            ],
            [(k / c)[:, None] * rows, np.zeros((k.size, n)), -np.diag(k / c)],
        ]
    )
    eigenvalues = np.linalg.eigvals(state)
    expected = eigenvalues[eigenvalues.imag > 1e-6 * np.abs(eigenvalues)]
    found = found[np.isfinite(found)]
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(expected), rel=1e-7)


def test_complex_modes_of_critically_damped_oscillator_do_not_vibrate():
    for ratio in (1.0, 1.5):
        story = {"mass": 1.0, "stiffness": 100.0, "dashpot": 20.0 * ratio}
        modes = assemble(model_of({"stories": [story], "damping": "none"})).complex_modes()
        assert np.isnan(modes.damping[0]) and np.isnan(modes.damped_period[0])


def test_complex_modes_omit_power_law_dampers():
    story = {"mass": 1.0, "stiffness": 100.0}
    power = {"coefficient": 5.0, "exponent": 0.5, "brace": 1e4}
    building = assemble(
        model_of({"stories": [story | {"dashpot": power}, story | {"dashpot": 1.0}]})
    )
    without = assemble(model_of({"stories": [story, story | {"dashpot": 1.0}]}))
    assert building.has_power_law_dampers and not without.has_power_law_dampers
    assert building.complex_modes().eigenvalues == pytest.approx(
        without.complex_modes().eigenvalues
    )
