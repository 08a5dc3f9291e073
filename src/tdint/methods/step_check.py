"""Check of the compiled step of a method, executed in plain Python with checks of array bounds.

A building with two yielding stories is integrated. Its displacements are compared with the
displacements of `impulse4`, and the imbalance of its energies must be small or converge to zero.
Clearing the scratch arrays must not change the displacements, and halving a step may at most double
their error.
"""

from __future__ import annotations

import math
import sys
import traceback
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from tdint.arrays import Array, max_absolute
from tdint.errors import AnalysisError, TdintError
from tdint.kernels import layout as rows
from tdint.kernels.located_peaks import update_located_peaks
from tdint.kernels.stepping import Scene
from tdint.kernels.time_loop.loop import integrate
from tdint.kernels.time_loop.observer import initialize_laws, sum_law_energies
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.methods.workspace import HALVINGS, Workspace, state_jumps, workspace
from tdint.model.building import assemble
from tdint.model.definition import simple_model
from tdint.model.story import simple_story
from tdint.model.story_laws import LAWS, Law


def faults_of_step(integrator: Integrator) -> list[str]:
    """Return messages about the faults of the step function of a method; an empty list if correct.

    The step is executed in plain Python. The faults are access to undeclared rows and wrong results
    for yielding stories. Only a single hysteresis model (bilinear) is tested because the user waits
    for the result (3 s). A method for linear buildings is tested with linear stories only. The
    energies are not tested (`energy_faults_of_step`), because studies of elastic oscillators do not
    need them.
    """
    try:
        # Linear stories, with the time step `_H` (1 step in `_H`), reveal wrong indices.
        integrate_in_python("linear", integrator, 1)
        if integrator.family.linear_only:
            return []
        return list(faults_with_yielding(integrator, ["bilinear"], energies=False).values())
    except AnalysisError as error:
        return [str(error)]


def energy_faults_of_step(integrator: Integrator) -> list[str]:
    """Return a message if the energies of bilinear stories are not balanced; an empty list if the
    step is correct or the method integrates linear buildings only."""
    if integrator.family.linear_only:
        return []
    try:
        balance = energy_balance(integrator, "bilinear")
    except AnalysisError as error:
        return [str(error)]
    return [balance.fault] if balance.fault else []


class _Beyond(IndexError):
    """Error for an index outside an array of the check."""


class GuardedArray(np.ndarray):
    """Array that raises an error with its name if an index is out of bounds.

    Compiled code does not check indices and would write after the end of the array.
    """

    name = ""

    @classmethod
    def of(cls, array: Array, name: str) -> GuardedArray:
        """Return a view of an array that checks its indices; `name` identifies it in messages."""
        view = array.view(cls)
        view.name = name
        return view

    def __getitem__(self, key: Any) -> Any:
        """Return the elements with the index `key` after a check of the index (`_check`)."""
        self._check(key)
        return super().__getitem__(key)

    def __setitem__(self, key: Any, value: Any) -> None:
        """Set the elements with the index `key` after a check of the index (`_check`)."""
        self._check(key)
        super().__setitem__(key, value)

    def _check(self, key: Any) -> None:
        """Raise `_Beyond` if an integer index is outside the array.

        `key` is an index or a tuple of indices, one for each axis (row, column). Slices are not
        checked.
        """
        # A negative index counts from the end of the axis and is valid down to minus its length.
        for axis, index in enumerate(key if isinstance(key, tuple) else (key,)):
            if (
                isinstance(index, int | np.integer)
                and not -self.shape[axis] <= index < self.shape[axis]
            ):
                axis_name = "row" if axis == 0 else "column"
                raise _Beyond(
                    f"{axis_name} {index} of {self.name} is used, but only {self.shape[axis]} are "
                    "declared (numbered from 0)"
                )


_YIELDING = {"bilinear": (30.0, 0.05), "tanh": (30.0,), "peak-oriented": (30.0, 0.05, 0.3)}
"""Parameters of three hysteresis models: piecewise linear, curved, and deteriorating."""

# Largest time step and duration of the check, s. The building has periods of 0.35 and 0.13 s and
# yields from 0.1 s on.
_H, _SECONDS = 0.01, 1.2
# Order of convergence of methods that do not locate the kinks of the forces within their steps
_KINK_ORDER = 2
# Tolerance of the observed order of convergence. The positions of the kinks within the time steps
# change the errors by up to half.
_ORDER_TOLERANCE = 0.6
# Fraction of the maximum displacement. Smaller errors are accepted, because they are comparable to
# the error of the reference.
_NEGLIGIBLE = 1e-6
# Imbalance of the energies, as a fraction of the maximum input energy, that is accepted without
# measuring its order. Methods of order 2 are within 1e-3 with the time step _H / 4.
_ENERGY_TOLERANCE = 1e-2
# Numbers of time steps in _H that a larger imbalance is measured with. The energy that is lost by
# numerical damping of order 1 is halved with the time step only if the damping per step is small:
# the observed order of backward Euler is 0.7 to 0.9 from 1 to 4 steps, and 0.89 to 0.95 here.
_ENERGY_PARTS = (8, 16)
# Tolerance of the order of the imbalance. Energy that is never accumulated is a constant part of
# the imbalance: 1 % of the input energy reduces the order of backward Euler to 0.7.
_ENERGY_ORDER_TOLERANCE = 0.25


def integrate_in_python(
    law: str, integrator: Integrator, parts: int, *, fresh_at: int = -1, halve_at: int = -1
) -> Workspace:
    """Integrate a building of two stories in plain Python with the time step `_H` / parts; return
    the arrays after the last step, with the complete history.

    The building has an initial velocity and a harmonic ground motion of the duration `_SECONDS`,
    sampled at multiples of `_H`; no forces act on its floors. The arrays of the step are guarded:
    an index out of bounds raises an error.

    Parameters
    ----------
    fresh_at : int
        Number of the step before which the scratch arrays are cleared, as if the integration were
        interrupted and continued with other arrays. The default, -1, clears no array.
    halve_at : int
        Number of the call of the step, from 1 on, that is reported as not converged, so that this
        step is halved. The default is -1, no step.

    Raises
    ------
    AnalysisError
        The method failed. After an exception in the code of a plug-in, the message contains the
        file, the line and the error (`faults_in`).
    """
    story = simple_story(1.0, Law(law, _YIELDING.get(law, ())), stiffness=1000.0, dashpot=1.0)
    building = assemble(simple_model(law, [story, story]))
    forces = np.zeros((0, rows.FORCE_COLUMNS))
    h, count = _H / parts, round(_SECONDS / _H) * parts
    arrays = workspace(building, integrator, count + 1)
    arrays.state[rows.VELOCITY, :-1] = 0.2, 0.3
    ground = 9.0 * np.sin(14.0 * np.arange(round(_SECONDS / _H) + 1) * _H)
    guarded_memory = [
        GuardedArray.of(array, name) for name, array in arrays.memory._asdict().items()
    ]
    scene = Scene(
        building.linear_terms, building.modal, building.law_parameters, forces, arrays.flags
    )
    scene = Scene(*(GuardedArray.of(array, name) for name, array in scene._asdict().items()))
    plugin_module = sys.modules.get(integrator.family.step.function.__module__)
    calls = 0

    def step(*arguments: Any) -> int:
        """Execute the step of the method in plain Python, or report that it does not converge."""
        nonlocal calls
        calls += 1
        if calls == halve_at:
            return rows.NOT_CONVERGED
        return int(integrator.family.step.function(*arguments))

    # Between two calls of the time loop, the arrays are cleared.
    step_ranges = [(0, fresh_at), (fresh_at, count)] if fresh_at > 0 else [(0, count)]
    for first_step, last_step in step_ranges:
        if first_step:
            _clear_scratch(arrays)
        with np.errstate(all="ignore"), faults_in(plugin_module, integrator.label):
            code = integrate.function(
                count,
                first_step,
                last_step,
                # `parts` time steps have the length of 1 sampling interval (`_H`).
                parts,
                1,
                step,
                initialize_laws.function,
                sum_law_energies.function,
                update_located_peaks.function,
                1,  # steps per row of the history
                0,  # rows of the complete history before the first row of the array
                HALVINGS if integrator.family.halvable else 0,
                h,
                ground,
                np.zeros(0),  # no tables of forces
                integrator.coefficients(building, forces, h),
                state_jumps(integrator, h),
                *scene,
                *guarded_memory,
                np.zeros(rows.LOAD_SIZE),
                *arrays.seen,
            )
        if code < 0:
            failure = (
                "a step does not converge"
                if code == rows.NOT_CONVERGED
                else "the response is not finite"
            )
            raise AnalysisError(
                f"{integrator.label}: {failure} with dt {h:.4g} s, stories of law {law}"
            )
    return arrays


def _clear_scratch(arrays: Workspace) -> None:
    """Clear the scratch array and the step status, as if an integration were continued with new
    arrays.

    Of the step status, the number of steps and the ground acceleration for which the state is valid
    are kept.
    """
    kept_status = arrays.step_status[rows.STEPS_DONE], arrays.step_status[rows.STATE_GROUND]
    arrays.step_status[:], arrays.scratch[:] = 0.0, 0.0
    arrays.step_status[[rows.STEPS_DONE, rows.STATE_GROUND]] = kept_status


@contextmanager
def faults_in(module: Any, name: str) -> Iterator[None]:
    """Convert an exception in the code of a plug-in to an `AnalysisError` with file and line
    number.

    The line is the last one of the traceback in the module of the plug-in; without such a line or
    module, the message contains `name`. Errors of tdint are not changed.
    """
    try:
        yield
    except TdintError:
        raise
    except Exception as error:
        file = getattr(module, "__file__", None) or ""
        # The innermost call is last.
        lines = [
            frame.lineno
            for frame in traceback.extract_tb(error.__traceback__)
            if frame.filename == file
        ]
        location = f"{file}:{lines[-1]}" if lines else name
        # The message of `_Beyond` is complete. The message of another exception, such as the key of
        # a KeyError, requires the type of the exception.
        error_type = "" if isinstance(error, _Beyond) else f"{type(error).__name__}: "
        raise AnalysisError(f"{location}: {error_type}{error}") from None


@cache
def _reference_displacements(law: str) -> Array:
    """Return the reference displacements of the floors at multiples of `_H`, m, one row per time.

    The error of `impulse4` with the time step `_H` / 16 is below 1e-7 of the maximum displacement.
    """
    return _displacements(integrate_in_python(law, parse("impulse4"), 16), 16)


def faults_with_yielding(
    integrator: Integrator, laws: Iterable[str] = _YIELDING, *, energies: bool = True
) -> dict[str, str]:
    """Return the faults of a method for stories that yield, type -> message; empty for a correct
    method. `energies` False omits the test of the energies.

        failed     an integration fails; the other keys are then not tested for this model
        order      the displacements do not converge with the expected order to the reference
                   displacements, computed with `impulse4`
        energy     the imbalance of the energies does not converge to zero (`EnergyBalance`)
        scratch    clearing the scratch arrays between two steps changes the displacements
        halved     halving a step increases the error to more than twice the error without a halved
                   step (`_halving_fault`)

    If a test fails for several hysteresis models, the dictionary contains the message for the first
    model. Only the key `failed` contains the message for the last model.
    """
    faults: dict[str, str] = {}
    for law in laws:
        reference = _reference_displacements(law)
        try:
            integrations = {
                parts: integrate_in_python(law, integrator, parts) for parts in (1, 2, 4)
            }
        except AnalysisError as error:
            faults["failed"] = str(error)
            continue
        messages = {
            "order": _order_fault(integrator, law, integrations, reference),
            "energy": energy_balance(integrator, law, integrations[4]).fault if energies else "",
            "scratch": _scratch_fault(integrator, law, integrations[1], reference),
            "halved": _halving_fault(integrator, law, integrations[1], reference),
        }
        for fault_type, message in messages.items():
            if message:
                faults.setdefault(fault_type, message)
    return faults


def _relative_error(arrays: Workspace, parts: int, reference: Array) -> float:
    """Return the maximum error of the displacements of an integration, divided by the maximum
    reference displacement.

    `reference` contains the reference displacements at multiples of `_H`, m.
    """
    maximum = max_absolute(reference)
    return _distance(_displacements(arrays, parts), reference) / maximum


def _order_fault(
    integrator: Integrator, law: str, integrations: Mapping[int, Workspace], reference: Array
) -> str:
    """Return a message if the displacements do not converge to the reference; otherwise an empty
    text.

    They must converge with the order of the method, or with the order that the kinks of the
    hysteresis model permit.
    """
    errors = {
        parts: _relative_error(arrays, parts, reference) for parts, arrays in integrations.items()
    }
    # An order above 4 is not required, because the reference is computed by a method of order 4.
    expected_order = min(integrator.order, _KINK_ORDER if LAWS[law].kinked else 4)
    # If the error with _H / 4 is exactly zero, the order is infinite.
    observed_orders = [math.inf]
    if errors[4]:
        observed_orders = [
            0.5 * math.log2(errors[1] / errors[4]),
            math.log2(errors[2] / errors[4]),
        ]
    if max(observed_orders) >= expected_order - _ORDER_TOLERANCE or errors[4] <= _NEGLIGIBLE:
        return ""
    measured = [f"{error:.2g} at dt {_H / parts:g} s" for parts, error in errors.items()]
    return (
        f"{integrator.label}: with stories of law {law} the relative errors of the displacements "
        f"are {', '.join(measured)}: order {max(observed_orders):.1f}, the expected order is "
        f"{expected_order:.2g}; the state of each story must be committed once per step, with the "
        "drift at its end"
    )


@dataclass(frozen=True)
class EnergyBalance:
    """Imbalance of the energies of yielding stories at the end of the check.

    The imbalance is the input energy minus the stored, damped and dissipated energy. Numerical
    damping is part of the imbalance and vanishes with the time step. Dissipated energy that a step
    does not accumulate is missing with any time step.

    Attributes
    ----------
    dt : float
        Smallest time step that the imbalance was measured with, s.
    imbalance : float
        Absolute imbalance with this time step, divided by the maximum input energy.
    order : float
        Observed order of the imbalance; nan if the imbalance is below `_ENERGY_TOLERANCE`.
    fault : str
        Message if the energies are not balanced, otherwise empty.
    """

    law: str
    dt: float
    imbalance: float
    order: float
    fault: str

    @property
    def text(self) -> str:
        """Description of the imbalance and its observed order for messages."""
        return (
            f"the imbalance is {100.0 * self.imbalance:.2g} % of the largest input energy at dt "
            f"{self.dt:.4g} s, of order {self.order:.2f} in the time step"
        )


def energy_balance(
    integrator: Integrator, law: str, arrays: Workspace | None = None
) -> EnergyBalance:
    """Measure the imbalance of the energies, and its order if it is not negligible.

    The order must be the order of the method, or `_KINK_ORDER` if that is lower.

    Parameters
    ----------
    law : str
        Name of the hysteresis model of the stories.
    arrays : Workspace, optional
        Results with the time step `_H` / 4. By default, they are computed.

    Raises
    ------
    AnalysisError
        An integration fails.
    """
    if arrays is None:
        arrays = integrate_in_python(law, integrator, 4)
    imbalance = abs(_imbalance(arrays.totals))
    if imbalance <= _ENERGY_TOLERANCE:
        return EnergyBalance(law, _H / 4, imbalance, math.nan, "")
    coarse, fine = (
        abs(_imbalance(integrate_in_python(law, integrator, parts).totals))
        for parts in _ENERGY_PARTS
    )
    order = math.log2(coarse / fine) if coarse and fine else math.inf
    balance = EnergyBalance(law, _H / _ENERGY_PARTS[-1], fine, order, "")
    expected_order = min(integrator.order, _KINK_ORDER)
    if order >= expected_order - _ENERGY_ORDER_TOLERANCE:
        return balance
    return replace(
        balance,
        fault=f"{integrator.label}: with stories of law {law} the energies are not balanced: "
        f"{balance.text} (expected: {expected_order:.2g}); the dissipated energy must "
        "be accumulated (`commit`, or `accumulate_dissipation` before "
        "`commit_without_dissipation`)",
    )


def _scratch_fault(integrator: Integrator, law: str, arrays: Workspace, reference: Array) -> str:
    """Return a message if the result depends on the scratch arrays of previous steps; otherwise an
    empty text.

    A method must keep all its memory in the state. `arrays` contains the results without clearing.
    """
    # Step 60 of 120 is after the first yielding.
    continued = _displacements(integrate_in_python(law, integrator, 1, fresh_at=60), 1)
    limit = _NEGLIGIBLE * max_absolute(reference)
    if _distance(continued, _displacements(arrays, 1)) <= limit:
        return ""
    return (
        f"{integrator.label}: the result changes if the scratch rows are cleared between steps: "
        "values that a later step needs must be stored in the state"
    )


def _halving_fault(integrator: Integrator, law: str, arrays: Workspace, reference: Array) -> str:
    """Return a message if a halved step increases the error of the method; otherwise an empty text.

    One step is reported as not converged, so that the time loop halves it. `arrays` contains the
    results without a halved step.
    """
    if not integrator.family.halvable:
        return ""
    # Step 60 of 120 is after the first yielding.
    halved_arrays = integrate_in_python(law, integrator, 1, halve_at=60)
    halved_error = _relative_error(halved_arrays, 1, reference)
    error = _relative_error(arrays, 1, reference)
    if halved_error <= 2.0 * error + _NEGLIGIBLE:
        return ""
    return (
        f"{integrator.label}: the relative error of the displacements is {halved_error:.2g} with a "
        f"halved step, and {error:.2g} without; the coefficients must be valid for any step "
        "(otherwise set `Family.halvable` to False), and a step that does not converge must not "
        "change the state"
    )


def _imbalance(totals: Array) -> float:
    """Return the imbalance of the energies at the end, divided by the maximum input energy;
    positive if energy is missing at the end.

    ENERGY_REFERENCE is positive, because the building has initial velocities.
    """
    spent = float(np.sum(totals[rows.ENERGY_INPUT + 1 : rows.ENERGY_TERMS]))
    received = float(totals[rows.ENERGY_INITIAL] + totals[rows.ENERGY_INPUT])
    return (received - spent) / float(totals[rows.ENERGY_REFERENCE])


def _displacements(arrays: Workspace, parts: int) -> Array:
    """Return the displacements of all floors at multiples of the time step `_H`, m: one row per
    time, one column per floor.
    """
    floors = arrays.state.shape[1] - 1
    return arrays.history[::parts, 1 : 1 + floors]


def _distance(array: Array, other: Array) -> float:
    """Return the maximum absolute difference of two arrays of the same shape, in their unit."""
    return max_absolute(np.asarray(array) - other)
