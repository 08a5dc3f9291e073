"""Damage states of a building after runs: demand, probability of each state, mean loss.

A completed run has a demand. The probability of reaching or exceeding a state is
Phi(ln(demand / median) / dispersion). A collapse is an outcome with the probability 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from tdint.arrays import Array
from tdint.errors import ModelError
from tdint.model.building import assemble
from tdint.model.damage_states import DEMANDS, DamageStates
from tdint.model.definition import Model
from tdint.model.status import DONE, FALLEN
from tdint.response.runs.outcome import StoryPeaks
from tdint.response.runs.run_values import demand_cells


@dataclass(frozen=True, kw_only=True)
class RunDamage:
    """Damage of a building after one or several runs.

    Attributes
    ----------
    demand : ndarray, shape (runs,)
        Demand of the damage states, SI units; nan for a run without a result. After a collapse, it
        is the demand that was reached, and a residual drift is nan.
    probability : ndarray, shape (runs, outcomes)
        Probability of each of `states.outcomes`; nan for a run without a result.
    """

    states: DamageStates
    status: list[str]
    demand: Array
    probability: Array

    @property
    def state(self) -> list[str]:
        """State of the building after each run: the highest state with a median up to the demand,
        or the type of collapse; empty without a result."""
        reached_counts = np.sum(self.demand[:, np.newaxis] >= np.array(self.states.medians), axis=1)
        states = []
        for reached_count, status in zip(reached_counts.tolist(), self.status, strict=True):
            if status == DONE:
                states.append(self.states.outcomes[reached_count])  # outcome 0 is no damage
            else:
                states.append(status if status in FALLEN else "")
        return states

    @property
    def known(self) -> NDArray[np.bool_]:
        """True for runs that have a result."""
        return np.array([status == DONE or status in FALLEN for status in self.status])

    @property
    def loss(self) -> Array:
        """Mean loss ratio after each run, shape (runs,); nan without a result."""
        return np.asarray(self.probability @ np.array(self.states.outcome_losses))

    @property
    def squared_loss(self) -> Array:
        """Mean of the squared loss ratio, shape (runs,)."""
        return np.asarray(self.probability @ np.square(self.states.outcome_losses))


def probabilities(states: DamageStates, demand: Array, status: Sequence[str]) -> Array:
    """Return the probability of each of `states.outcomes` after runs, shape (runs, outcomes); nan
    for a run without a result.
    """
    # The probability of a state is the probability of reaching it minus the probability of reaching
    # the next state. The first outcome is no damage; the last outcomes are the types of collapse.
    exceeding = exceedance(demand, np.array(states.medians), states.dispersion)
    reaching = np.column_stack([np.ones(demand.size), exceeding, np.zeros(demand.size)])
    result = np.zeros((demand.size, len(states.outcomes)))
    result[:, : -len(FALLEN)] = reaching[:, :-1] - reaching[:, 1:]
    for run, run_status in enumerate(status):
        if run_status in FALLEN:
            result[run] = [float(outcome == run_status) for outcome in states.outcomes]
        elif run_status != DONE:
            result[run] = math.nan
    return result


def exceedance(demand: Array, medians: Array, dispersion: float) -> Array:
    """Return the probability of reaching or exceeding each damage state at the demand of each run,
    Phi(ln(demand / median) / dispersion).

    Returns
    -------
    ndarray, shape (runs, states)
        Probabilities. Without dispersion, they are 0 or 1.
    """
    if dispersion == 0.0:
        return np.asarray(demand[:, np.newaxis] >= medians, float)
    with np.errstate(divide="ignore"):  # a demand of zero has the probability 0
        return np.asarray(ndtr(np.log(demand[:, np.newaxis] / medians) / dispersion))


def damage_of_run(model: Model, stories: StoryPeaks, status: str) -> RunDamage | None:
    """Return the damage of a building after a single run; None if its model has no damage states.

    Parameters
    ----------
    stories : StoryPeaks
        Peak responses of the run, in arrays of shape (1, stories).

    Raises
    ------
    ModelError
        The model lacks data for the computation of the demand.
    """
    states = model.damage
    if states is None:
        return None
    # The divisor converts a peak of the run to the demand, for example a displacement to a ratio.
    (cells,) = demand_cells(stories)
    divisor, _ = divisor_and_period(model, states.demand)
    demand = np.array([abs(cells[DEMANDS[states.demand].quantity])]) / divisor
    return RunDamage(
        states=states,
        status=[status],
        demand=demand,
        probability=probabilities(states, demand, [status]),
    )


def divisor_and_period(model: Model, demand: str) -> tuple[float, float]:
    """Return the divisor that converts a peak of a run to a demand, and the first period (s).

    The divisor is the total height for the roof drift ratio, the participation factor of the first
    mode for the spectral displacement, and 1 for other demands. Period and factor are those of the
    complete building, as `tdint modes` prints them. ModelError is raised if a drift ratio is
    required, but heights of stories are missing.
    """
    # Other drift ratios require the height of at least one story.
    heights = [story.height for story in model.stories]
    lacks_height = None in heights if DEMANDS[demand].per else not any(heights)
    if "ratio" in demand and lacks_height:
        raise ModelError(
            f"{model.source or model.name}: damage by {demand} requires the heights of the "
            "stories; add the heights"
        )
    building = assemble(model)
    divisors = {"": 1.0, "height": math.fsum(filter(None, heights))}
    per = DEMANDS[demand].per
    divisor = divisors[per] if per in divisors else float(building.modes().participation[0])
    return divisor, building.first_period
