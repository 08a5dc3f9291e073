"""Response spectrum analysis: modal and combined peak responses of a linear building for a design
spectrum.

Each response, including drifts and shears, is combined from modal peaks of the same response and
never computed as a difference of combined responses. The combination rules are the square root of
the sum of squares (Rosenblueth 1951) and the complete quadratic combination (Der Kiureghian 1981),
with cross terms that apply to stationary motion of modes with close frequencies. All modes of the
building are included, so no mass is missing.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tdint.arrays import Array, immutable
from tdint.errors import ModelError, UsageError
from tdint.kernels import layout as rows
from tdint.model.building import assemble
from tdint.model.definition import Model
from tdint.response.arguments import AnyModel, model_of
from tdint.response.spectra.target import TargetSpectrum, read_target
from tdint.tabular import Tabular

_DEFAULT_DAMPING = 0.05
"""Damping ratio for the correlation of modes if the target spectrum does not state its damping
ratio; design spectra usually apply to 5 %."""


@immutable
class ModalResponse(Tabular):
    """Peak responses of a linear building for a design spectrum; arrays over the stories have the
    shape (n,).

    Attributes
    ----------
    model : Model
        The building, with the initial stiffness of its stories.
    target : TargetSpectrum
        The design spectrum.
    period : ndarray, shape (n,)
        Period of each mode, s.
    spectral_acceleration : ndarray, shape (n,)
        Spectral acceleration of each mode, m/s^2; 0 for an omitted mode.
    mass_ratio : ndarray, shape (n,)
        Effective modal mass of each mode divided by the total mass.
    rigid, left_out : int
        Number of modes with periods below the shortest period of the target, if the target has a
        value at period 0 (`rigid`) or has no such value (`left_out`).
    base_shear, applied_force : ndarray, shape (n,)
        Restoring force of the first story and sum of the forces on the floors of each mode, N. They
        differ by P-delta.
    drift_srss, drift_cqc : ndarray, shape (n,)
        Story drifts, m, combined by the square root of the sum of squares (SRSS) or by the complete
        quadratic combination (CQC).
    shear_srss, shear_cqc : ndarray, shape (n,)
        Story shears (restoring forces), N: the sums of the forces on the floors above, and P-delta.
    displacement_srss, displacement_cqc : ndarray, shape (n,)
        Floor displacements relative to the ground, m.
    force_cqc, acceleration_cqc : ndarray, shape (n,)
        Forces on the floors, N, and forces divided by masses: absolute accelerations, m/s^2.
    moment_cqc : ndarray, shape (n,)
        Overturning moment at the base of each story by the forces above, N m; nan if the height of
        the story or of a story above is not specified.
    device_deformation_cqc : ndarray
        Strokes of the attachments, then deformations of the links, m.
    """

    model: Model
    target: TargetSpectrum
    period: Array
    spectral_acceleration: Array
    mass_ratio: Array
    rigid: int
    left_out: int
    base_shear: Array
    applied_force: Array
    drift_srss: Array
    drift_cqc: Array
    shear_srss: Array
    shear_cqc: Array
    displacement_srss: Array
    displacement_cqc: Array
    force_cqc: Array
    acceleration_cqc: Array
    moment_cqc: Array
    device_deformation_cqc: Array

    def _headline(self) -> str:
        return (
            f"of {self.model.name!r} under {self.target.source}: base shear "
            f"{self.shear_cqc[0]:.4g} N (CQC)"
        )

    @property
    def height(self) -> Array:
        """Heights of the stories, m; nan for stories without a height."""
        return np.array([story.drift_height or math.nan for story in self.model.stories])


def response_spectrum_analysis(model: AnyModel, target: TargetSpectrum | str) -> ModalResponse:
    """Compute the peak responses of a building with its initial stiffness for a design spectrum.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Model, model file or its content, as for `tdint.run`.
    target : TargetSpectrum or str
        Design spectrum, or its text: the name of a code with parameters, or a file. The spectrum is
        used for all modes without conversion to another damping ratio.

    Returns
    -------
    ModalResponse
        Peak responses by mode and combined.

    Raises
    ------
    ModelError
        The model is invalid, a story has no initial stiffness, or P-delta effects exceed the
        stiffness of a story.
    UsageError
        The first period of the building is longer than the maximum period of the spectrum.
    """
    model = model_of(model)
    model.require_floors("the response spectrum analysis")
    demand = read_target(target) if isinstance(target, str) else target
    # The damping of the model is not used: that of the design spectrum applies to all modes.
    building = assemble(replace(model, damping=None))
    if model.links and building.system is not None:
        raise UsageError(
            f"{model.source}: the response spectrum analysis does not support links beside "
            "flexural stories, a base or a stiffness matrix; use time histories, or omit them"
        )
    modes = building.modes()
    if not modes.omega[0]:
        raise ModelError(
            f"{model.name}: the response spectrum analysis needs the periods, and a story has no "
            "initial stiffness; use time histories"
        )
    period = modes.period
    # Modes with shorter periods than the table of the target are rigid. Their acceleration is the
    # peak ground acceleration if the target states it.
    is_rigid = period < (0.0 if demand.curve else demand.periods[0])
    if period[0] > demand.periods[-1] * (1.0 + 1e-9):
        raise UsageError(
            f"{demand.source}: the maximum period of the spectrum is {demand.periods[-1]:g} s, but "
            f"the first period of the building is {period[0]:.4g} s; extend the spectrum"
        )
    acceleration = np.full(period.size, demand.zero if demand.zero is not None else 0.0)
    acceleration[~is_rigid] = demand.at(period[~is_rigid])
    # The arrays of modal peaks have a row for each mode and one column for each story.
    system = building.system
    # Modal participation factors: inerters are not loaded by the ground motion.
    factor = (modes.mass if modes.load is None else modes.load) @ modes.shapes
    inertia = modes.mass[:, None] * modes.shapes if system is None else system.mass @ modes.shapes
    displacement = (modes.shapes * (factor * acceleration / modes.omega**2)).T
    forces = (inertia * (factor * acceleration)).T
    floors = slice(building.floors)  # without the rotations of floors
    # The force on a story is the sum of the forces above, from the roof down, attachments included.
    # The restoring force also resists P-delta; links carry a part beside the stories.
    loads = forces[:, floors].copy()
    for i, attachment in enumerate(model.attachments, start=building.floors):
        if attachment.floor:
            loads[:, attachment.floor - 1] += forces[:, i]
    applied = np.cumsum(loads[:, ::-1], axis=1)[:, ::-1]
    deformation = building.drifts(displacement)
    drift = deformation[:, floors]
    geometric = building.linear_terms[rows.GEOMETRIC, :-1][floors]
    beside_devices = model.devices and building.system is None
    peaks = {
        "drift": drift,
        "shear": building.story_laws[rows.STIFFNESS][floors] * drift
        if beside_devices
        else applied - geometric * drift,
        "device_deformation": deformation[:, building.device_columns],
        "displacement": displacement[:, floors],
        "force": forces[:, floors],
        # A floor of a matrix can have no mass.
        "acceleration": (forces / modes.mass)[:, floors]
        if system is None
        else (modes.shapes * (factor * acceleration)).T[:, floors],
    }
    # The overturning moment at the base of a story is the sum of force times height over this story
    # and the stories above. Bearings do not contribute, because they have no height.
    contributions = applied * building.height_contributions
    turning = [i for i, story in enumerate(model.stories) if story.rotary_inertia]
    rotations = forces[:, building.floors + len(model.attachments) :]
    contributions[:, turning] += rotations[:, : len(turning)]
    peaks["moment"] = np.cumsum(contributions[:, ::-1], axis=1)[:, ::-1]
    correlation = correlations(modes.omega, demand.damping or _DEFAULT_DAMPING)
    srss_names = ("drift", "shear", "displacement")
    combined = {f"{name}_srss": np.sqrt(np.sum(peaks[name] ** 2, axis=0)) for name in srss_names}
    # CQC: sum over the modes i and k of peak i times correlation i k times peak k, for each story
    # j. If contributions of modes cancel, rounding errors can make the sum negative.
    combined |= {
        f"{name}_cqc": np.sqrt(
            np.maximum(np.einsum("ij,ik,kj->j", values, correlation, values), 0.0)
        )
        for name, values in peaks.items()
    }
    # Rigid modes are omitted if the peak ground acceleration is unknown.
    count = int(is_rigid.sum())
    rigid, left_out = (count, 0) if demand.zero is not None else (0, count)
    ratios, base = modes.mass_ratio, peaks["shear"][:, 0]
    return ModalResponse(
        model,
        demand,
        period,
        acceleration,
        ratios,
        rigid,
        left_out,
        base,
        applied[:, 0],
        **combined,
    )


def correlations(omega: Array, damping: float) -> Array:
    """Return the correlation coefficients of the complete quadratic combination (Der Kiureghian
    1981).
    """
    r = omega[None, :] / omega[:, None]
    numerator = 8.0 * damping**2 * (1.0 + r) * r**1.5
    return np.asarray(numerator / ((1.0 - r**2) ** 2 + 4.0 * damping**2 * r * (1.0 + r) ** 2))
