"""Summary of a model without running it, and validation of its file."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path

from tdint.errors import ModelError, UsageError
from tdint.files import is_file
from tdint.ground_motion.axes import pga_of
from tdint.methods.catalogue import method_of, parse
from tdint.model.building import assemble, period
from tdint.model.config.model_file import load_with_checks
from tdint.model.definition import Model
from tdint.model.model_notes import POWER_LAW_OMITTED, model_notes
from tdint.model.modes import Modes
from tdint.model.plausibility import long_step, plausibility_warnings
from tdint.number_parsing import pluralize
from tdint.response.arguments import AnyModel, model_of, model_record
from tdint.response.time_steps import moves_without_record
from tdint.tabular import WithTable


@dataclass(frozen=True, repr=False)
class Overview(WithTable):
    """Summary of a model.

    Attributes
    ----------
    model : Model
        Model.
    warnings : tuple of str
        Warnings that a run prints before it starts.
    notes : tuple of str
        Notes on the model (`tdint.model.model_notes`), and on dampers that the damping ratios omit.
    mass, height : float
        Total mass (kg) and height (m) of the building; the height is nan if a story has no height.
    period, damping : float
        Period (s) and viscous damping ratio of the first mode; power-law dashpots and dampers
        with a brace are not included.
    complex_period, complex_damping : float or None
        Period (s) and damping ratio of the first complex mode, which includes all linear dampers;
        None if the building has no dampers.
    """

    model: Model
    mass: float
    height: float
    period: float
    damping: float
    warnings: tuple[str, ...] = ()
    complex_period: float | None = None
    complex_damping: float | None = None
    notes: tuple[str, ...] = ()

    def _headline(self) -> str:
        stories = pluralize(self.stories, "story")
        return (
            f"of {self.model.name!r}: {stories}, T1 {self.period:.4g} s, laws {self.laws}, "
            f"{self.method}"
        )

    @property
    def stories(self) -> int:
        """Number of stories."""
        return len(self.model.stories)

    @property
    def laws(self) -> str:
        """Hysteresis models from the ground up, with the number of stories of each if there are
        several.
        """
        counted = Counter(story.law_text for story in self.model.stories)
        return ", ".join(
            counted if len(counted) == 1 else (f"{count} {name}" for name, count in counted.items())
        )

    @property
    def method(self) -> str:
        """Method that a run uses if the command line specifies no method."""
        return parse(method_of(self.model)).label

    @property
    def record(self) -> str | None:
        """File of the ground motion."""
        record = self.model.excitation.record
        return record.file if record else None


_MAX_COMPLEX_STORIES = 100
"""Maximum number of stories for which an overview includes the first damped mode."""


def overview(source: str | Path) -> Overview:
    """Read a model file and summarize the model.

    Parameters
    ----------
    source : str or Path
        Model file.

    Returns
    -------
    Overview
        Mass (kg), height (m), first period (s) and its damping ratio; `to_dict` contains the row
        that `tdint check` prints.

    Raises
    ------
    ModelError
        All errors in the file: entries that `load_model` rejects, an unknown method, a missing
        record file, or a building that is unstable under gravity.
    RecordError
        The record that the model specifies cannot be read.
    """
    return overview_in_campaign(source)


def overview_in_campaign(
    source: str | Path,
    given_times: Collection[str] = (),
    change: Callable[[Model], Model] = lambda model: model,
) -> Overview:
    """Read and summarize a model, like `overview`, for a campaign that uses it.

    Parameters
    ----------
    given_times : collection of str
        `dt` and `duration` if the campaign specifies them, so that the model does not need them.
    change : callable
        Function that changes the model.
    """
    # The model layer has no access to the methods and does not open records. These checks are added
    # by the key of the entry, so that errors are reported at its line.
    read = load_with_checks(
        source,
        {
            "analysis.method": lambda text, _: parse(text),
            **dict.fromkeys(_RECORD_KEYS, _check_exists),
        },
    )
    model = change(read)
    try:
        buildings = [(assemble(part), part) for part in model.directions]
        # Of two directions, the direction with the longer period determines the values.
        building, part = min(buildings, key=lambda item: item[0].first_mode()[0])
        omega, damping = building.first_mode()
    except ModelError as error:
        raise ModelError(f"{model.source}: {error}") from None
    # Warnings depend on the processed and scaled ground motion of the model. A record that would be
    # read from standard input is ignored, because a summary must not wait for input.
    pga, interval, source_of_record = math.nan, None, model.excitation.record
    if (
        source_of_record is not None
        and source_of_record.file != "-"
        and (record := model_record(model))
    ):
        pga, interval = pga_of(record), record.dt
    first_period = period(omega)
    # The damped modes of taller buildings need seconds.
    has_complex_modes = part.has_dashpots and building.stories <= _MAX_COMPLEX_STORIES
    complex_modes = building.complex_modes() if has_complex_modes else None
    warnings = (
        *plausibility_warnings(part, building, pga, has_motion=source_of_record is not None),
        *long_step(building, model.analysis.dt, interval),
    )
    if source_of_record is None and moves_without_record(model):
        # Imported here, because most models have a record.
        from tdint.response.runs.load_notes import missing_times

        warnings += missing_times(model, given_times)
    notes = model_notes(model)
    if building.has_power_law_dampers:
        notes.append(f"damping ratios: {POWER_LAW_OMITTED}")
    complex_period, complex_damping = (
        (float(complex_modes.natural_period[0]), float(complex_modes.damping[0]))
        if complex_modes
        else (None, None)
    )
    return Overview(
        part,
        float(building.mass.sum()) + (part.matrices.base_inertia[1] if part.matrices else 0.0),
        float(building.height_contributions.sum()),
        first_period,
        damping,
        warnings,
        complex_period,
        complex_damping,
        tuple(notes),
    )


def modes(model: AnyModel) -> Modes:
    """Return the undamped modes of the initial stiffness of a model, with their damping ratios.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Argument that `run` accepts.

    Returns
    -------
    Modes
        Circular frequencies (rad/s), mode shapes, damping ratios and effective masses.

    Raises
    ------
    ModelError
        The model is invalid, or P-delta exceeds the stiffness of a story.
    """
    building = assemble(model_of(model))
    result = building.modes()
    if building.system is not None and building.system.lag is not None:
        return result  # rows without mass couple the modes
    return replace(result, damping=result.own_damping(building.damping_matrix()))


# Keys of a model file with the names of files of the ground motion.
_RECORD_KEYS = tuple(
    f"excitation.{direction}{name}"
    for direction in ("", "x.", "y.")
    for name in ("record", "record.file", "record.inventory")
)


def _check_exists(text: str, folder: Path) -> None:
    """Raise UsageError if the file does not exist; "-" is standard input."""
    if text != "-" and not is_file(folder / text):
        raise UsageError(f"file {folder / text} not found")
