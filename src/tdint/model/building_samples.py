"""Random samples of a building as arrays, which equal the buildings of the changed models."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.kernels import layout as rows
from tdint.kernels.laws.law import can_fall
from tdint.model.building import Building, assemble, highest_frequency_bound, law_columns
from tdint.model.damping import (
    add_damping,
    falling_message,
    has_tangent_damping,
)
from tdint.model.dashpots import dashpot_rows
from tdint.model.definition import Model, damped_by
from tdint.model.modes import FreeVibration
from tdint.model.parameters import changes_of
from tdint.model.story import (
    DASHPOT,
    FIRST_LAW_PARAMETER,
    HEIGHT,
    MASS,
    POWER,
    STIFFNESS,
    Story,
    spring_columns,
    spring_label,
    story_numbers,
)
from tdint.model.story_laws import LAWS
from tdint.units import STANDARD_GRAVITY


@dataclass(frozen=True)
class DrawnBuildings:
    """Random samples of a building, as arrays with the samples on the first axis.

    The samples have the same stories and laws, with different parameters.

    Attributes
    ----------
    linear_terms, law_parameters : ndarray, shape (draws, rows, n + 1)
        Tables of each sample, as in `Building`.
    modal : sequence of ndarray
        Rows of the modal damping of each sample, as in `Building`.
    heights, yield_drift : ndarray, shape (draws, n)
        Story heights and yield drifts of each sample, as in `Building`.
    """

    base: Building
    linear_terms: Array
    law_parameters: Array
    modal: Sequence[Array]
    heights: Array
    yield_drift: Array

    @property
    def mass(self) -> Array:
        """Masses of the floors, kg, shape (draws, n)."""
        return self.linear_terms[:, rows.MASS, : self.base.masses]

    @property
    def fastest(self) -> Array:
        """Upper bound of the circular frequencies of each sample, rad/s, shape (draws,)."""
        if self.base.branched:
            tables = zip(self.linear_terms, self.law_parameters, strict=True)
            return np.array(
                [replace(self.base, linear_terms=a, law_parameters=b).fastest for a, b in tables]
            )
        stiffness = (
            self.law_parameters[:, rows.STIFFNESS, : self.base.stories]
            + self.linear_terms[:, rows.GEOMETRIC, :-1]
        )
        return highest_frequency_bound(stiffness, self.base.linear_terms[rows.LINK], self.mass)

    def combine_runs(self, draws: Sequence[int]) -> Building:
        """Return the buildings of several runs as one `Building` with an additional axis of runs.

        For n stories, linear terms and law parameters have the shape (rows, runs, n + 1), with a
        last column for a fictitious story above the roof. Heights and yield drifts have the shape
        (runs, n).

        Parameters
        ----------
        draws : sequence of int
            Index of the sample of each run.
        """
        return replace(
            self.base,
            linear_terms=np.moveaxis(self.linear_terms[draws], 0, 1),
            law_parameters=np.moveaxis(self.law_parameters[draws], 0, 1),
            heights=self.heights[draws],
            yield_drift=self.yield_drift[draws],
        )

    @property
    def with_devices(self) -> NDArray[np.bool_]:
        """Mask of the samples with a dashpot in any story, shape (draws,)."""
        coefficients = self.linear_terms[:, [rows.DASHPOT, rows.POWER_DAMPER, rows.BRACE], :-1]
        return np.asarray(np.any(coefficients != 0.0, axis=(1, 2)))


def draw_buildings(
    model: Model, base: Building, values: Mapping[str, Array], draws: Sequence[int]
) -> DrawnBuildings:
    """Assemble the buildings of all samples.

    The results are equal to the bit to the results of `assemble` for each changed model.

    Parameters
    ----------
    values : mapping of str to ndarray, shape (draws,)
        Values of parameters by name (`Model.replace`); nan if a sample does not change the
        parameter.
    draws : sequence of int
        Indices of the samples, from 0, which messages name (from 1).

    Raises
    ------
    UsageError
        A value is out of range, or the parameters of a story are invalid with the value.
    ModelError
        P-delta exceeds the stiffness of a story.
    """
    model.require_springs("a random or varied parameter")
    draw_count, n = len(next(iter(values.values()))), base.stories
    if base.branched:
        return _draw_branched(model, base, values, draw_count)
    # The keys are the index of the story and the index of the value in `story_numbers`.
    changed_values = _changed_numbers(model, values, draw_count)

    linear_terms = np.repeat(base.linear_terms[None], draw_count, axis=0)
    law_parameters = np.repeat(base.law_parameters[None], draw_count, axis=0)
    heights = np.repeat(base.heights[None], draw_count, axis=0)
    _insert_numbers(model, changed_values, linear_terms, law_parameters, heights)
    for i, columns in enumerate(law_columns(model.stories)):
        if model.stories[i].elements:
            law_parameters[:, rows.STIFFNESS, i] = sum(
                law_parameters[:, rows.STIFFNESS, column] for column in columns
            )
    # Compute the rows of the tables that follow from other rows.
    linear_terms[:, rows.INVERSE_MASS, :n] = 1.0 / linear_terms[:, rows.MASS, :n]
    linear_terms[:, rows.STORY_DAMPER, :n] = linear_terms[:, rows.DASHPOT, :n]
    linear_terms[:, rows.FLOOR_DAMPER, :n] = 0.0
    if model.has_p_delta:
        story_heights = [
            np.broadcast_to(
                changed_values.get((i, HEIGHT), story_numbers(story)[HEIGHT])
                if has_p_delta
                else math.inf,
                draw_count,
            )
            for i, (story, has_p_delta) in enumerate(
                zip(model.stories, model.p_delta_stories, strict=True)
            )
        ]
        # P-delta depends on the weight above each story: sum the masses from the roof downwards.
        mass_above = np.cumsum(linear_terms[:, rows.MASS, :n][:, ::-1], axis=1)[:, ::-1]
        weight_above = STANDARD_GRAVITY * mass_above
        linear_terms[:, rows.GEOMETRIC, :n] = -(weight_above / np.stack(story_heights, axis=1))
    yield_drift = _yield_drifts(model, base, changed_values, law_parameters, draws)
    # If no sample changes a mass or a stiffness (with P-delta, a height), all samples have the
    # vibration of the base.
    is_vibration_changed = any(
        column in (MASS, STIFFNESS)
        or (column == HEIGHT and model.has_p_delta)
        or (column >= FIRST_LAW_PARAMETER and model.stories[i].elements)
        for i, column in changed_values
    )
    ratios = values["damping"].tolist() if "damping" in values else [math.nan] * draw_count
    # A sample without a damping ratio (nan) keeps the damping of the model.
    damped_models = [
        model if math.isnan(ratio) else replace(model, damping=damped_by(model, ratio))
        for ratio in ratios
    ]
    modal, vibration = [], base.vibration
    for draw, damped_model in enumerate(damped_models):
        stiffness = law_parameters[draw, rows.STIFFNESS, :n]
        if is_vibration_changed:
            vibration = FreeVibration(
                linear_terms[draw, rows.MASS, :n],
                stiffness + linear_terms[draw, rows.GEOMETRIC, :n],
                linear_terms[draw, rows.LINK, :n],
            )
        modal.append(add_damping(linear_terms[draw], stiffness, damped_model, vibration))
    return DrawnBuildings(base, linear_terms, law_parameters, modal, heights, yield_drift)


def _draw_branched(
    model: Model, base: Building, values: Mapping[str, Array], draw_count: int
) -> DrawnBuildings:
    """Return the result of `draw_buildings` for a building with attachments or links, whose samples
    are assembled one by one."""
    buildings = [
        assemble(
            model.replace(
                **{
                    name: float(samples[draw])
                    for name, samples in values.items()
                    if not math.isnan(samples[draw])
                }
            )
        )
        for draw in range(draw_count)
    ]
    tables = (
        np.stack([getattr(building, name) for building in buildings])
        for name in ("linear_terms", "law_parameters", "heights", "yield_drift")
    )
    linear_terms, law_parameters, heights, yield_drift = tables
    modal = [building.modal for building in buildings]
    return DrawnBuildings(base, linear_terms, law_parameters, modal, heights, yield_drift)


def _insert_numbers(
    model: Model,
    changed_values: Mapping[tuple[int, int], Array],
    linear_terms: Array,
    law_parameters: Array,
    heights: Array,
) -> None:
    """Insert the values that the samples change into the tables of the buildings.

    `linear_terms`, `law_parameters` and `heights`: tables of the buildings, which are changed.
    """
    columns = law_columns(model.stories)
    for (i, column), values_of_draws in changed_values.items():
        if column == STIFFNESS or column >= FIRST_LAW_PARAMETER:
            row, table_column = _table_position(model.stories[i], columns[i], column)
            law_parameters[:, row, table_column] = values_of_draws
        elif column == HEIGHT and not model.stories[i].isolator:
            heights[:, i] = values_of_draws
        elif column == MASS:
            linear_terms[:, rows.MASS, i] = values_of_draws
        elif column == DASHPOT:
            factor = model.stories[i].damper_factor ** 2
            linear_terms[:, rows.DASHPOT, i] = values_of_draws * factor
    # The rows of a power-law dashpot depend on several numbers. They are computed in Python as in
    # `assemble`: powers of NumPy can differ in the last bit.
    for i in {i for i, column in changed_values if POWER.start <= column < POWER.stop}:
        story = model.stories[i]
        numbers = story_numbers(story)
        dashpot_values = [
            np.broadcast_to(changed_values.get((i, column), numbers[column]), len(linear_terms))
            for column in range(POWER.start, POWER.stop)
        ]
        for draw, dashpot in enumerate(np.stack(dashpot_values, axis=1).tolist()):
            for row, number in dashpot_rows(story, *dashpot):
                linear_terms[draw, row, i] = number


def _table_position(story: Story, columns: range, number: int) -> tuple[int, int]:
    """Return row and column of the table of the laws for an index in `story_numbers`.

    `columns` are the columns of the springs of the story.
    """
    for column, spring in zip(columns, spring_columns(story), strict=True):
        if number == spring.stiffness:
            return rows.STIFFNESS, column
        if spring.first <= number < spring.end:
            return rows.FIRST_PARAMETER + number - spring.first, column
    raise IndexError(number)


def _yield_drifts(
    model: Model,
    base: Building,
    changed_values: Mapping[tuple[int, int], Array],
    law_parameters: Array,
    draws: Sequence[int],
) -> Array:
    """Verify the laws of all samples and return their yield drifts, shape (draws, stories). The
    changed values are the values of `_changed_numbers`; the first axis of `law_parameters` is the
    sample, with its index in `draws`. UsageError is raised if the parameters are invalid.
    """
    yield_drift = np.repeat(base.yield_drift[None], len(law_parameters), axis=0)
    # All other stories keep the yield drift of the base.
    changed_stories = {
        i for i, column in changed_values if column == STIFFNESS or column >= FIRST_LAW_PARAMETER
    }
    columns = law_columns(model.stories)
    for i in changed_stories:
        drifts = []
        for column, spring in zip(columns[i], model.stories[i].springs, strict=True):
            law = LAWS[spring.law.name]
            end = rows.FIRST_PARAMETER + len(spring.law.parameters)
            table_rows = [rows.STIFFNESS, *range(rows.FIRST_PARAMETER, end)]
            numbers = law_parameters[:, table_rows, column].tolist()
            for draw, (stiffness, *parameters) in zip(draws, numbers, strict=True):
                if fault := law.fault(stiffness, parameters):
                    raise UsageError(
                        f"{model.name}: invalid variation of {spring_label(i, spring)}: {fault} "
                        f"(sample {draw + 1})"
                    )
                if has_tangent_damping(model.damping) and can_fall(law, stiffness, parameters):
                    raise UsageError(
                        f"{model.name}: invalid variation of {spring_label(i, spring)}: "
                        f"{falling_message(law.name, i + 1)} (sample {draw + 1})"
                    )
            drifts.append(
                [law.yield_drift(stiffness, parameters) for stiffness, *parameters in numbers]
            )
        # The smallest yield drift of the springs; nan if no spring yields
        yield_drift[:, i] = np.fmin.reduce(drifts)
    return yield_drift


def _changed_numbers(
    model: Model, values: Mapping[str, Array], draws: int
) -> dict[tuple[int, int], Array]:
    """Return the values of the stories that the samples change: an array of shape (draws,) by the
    index of the story and the index of the value in `story_numbers`.

    A parameter in `values` is nan if a sample does not change it.
    """
    base_numbers = [list(story_numbers(story)) for story in model.stories]
    changed: dict[tuple[int, int], Array] = {}
    stories_with_set_law = set()
    set_by_name: set[tuple[int, int]] = set()
    for name, sampled_values in values.items():
        for change in changes_of(model.name, model.stories, name):
            if change.is_superseded(set_by_name):
                continue
            value_index = change.story, change.column
            # Several parameters can change the same value; they are applied in order.
            current = changed.get(value_index, base_numbers[change.story][change.column])
            changed_value = (
                current * sampled_values if change.factor else sampled_values * change.scale
            )
            changed[value_index] = np.where(np.isnan(sampled_values), current, changed_value)
            if change.sets_law_parameter:
                stories_with_set_law.add(change.story)
    # Some laws define the initial stiffness by their parameters: compute it again. These laws have
    # no parameter `stiffness` (`changes_of`), so that no sampled value is replaced.
    for i in stories_with_set_law:
        story = model.stories[i]
        for spring, indices in zip(story.springs, spring_columns(story), strict=True):
            compute_stiffness = LAWS[spring.law.name].initial_stiffness
            if compute_stiffness:
                columns = [
                    np.broadcast_to(changed.get((i, column), base_numbers[i][column]), draws)
                    for column in range(indices.first, indices.end)
                ]
                parameters_of_draws = np.stack(columns, axis=1).tolist()
                changed[i, indices.stiffness] = np.array(
                    [compute_stiffness(parameters) for parameters in parameters_of_draws]
                )
    return changed
