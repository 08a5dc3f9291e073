"""What a model is, without running it: for a look before the first run, and to find what is wrong
with it."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

from tdint.analysis.given import AnyModel, model_of, model_record
from tdint.errors import ModelError, UsageError
from tdint.files import is_file
from tdint.methods.catalogue import DEFAULT_METHOD, parse
from tdint.model.building import assemble
from tdint.model.config.model_file import load_judged
from tdint.model.definition import Model
from tdint.model.modes import Modes
from tdint.model.plausibility import doubts, long_step
from tdint.tabular import Tabular
from tdint.written_numbers import how_many


@dataclass(frozen=True, repr=False)
class Overview(Tabular):
    """A model in a line.

    Attributes
    ----------
    model : Model
        The model.
    warnings : tuple of str
        What a run of it warns of before it begins.
    mass, height : float
        Of the whole building, kg, m; nan where a story has no height.
    period, damping : float
        Of the first mode: s, viscous damping ratio without power-law dashpots.
    """

    model: Model
    mass: float
    height: float
    period: float
    damping: float
    warnings: tuple[str, ...] = ()

    def _headline(self) -> str:
        stories = how_many(self.stories, "story")
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
        """The drift laws from the ground up, with the number of stories that have each where there
        are several."""
        counted = Counter(story.law.name for story in self.model.stories)
        return ", ".join(
            counted if len(counted) == 1 else (f"{count} {name}" for name, count in counted.items())
        )

    @property
    def method(self) -> str:
        """The method that runs it where the command line names none."""
        return parse(self.model.analysis.method or DEFAULT_METHOD).label

    @property
    def record(self) -> str | None:
        """The file of its ground motion."""
        record = self.model.excitation.record
        return record.file if record else None


def overview(source: str | Path) -> Overview:
    """Read a model and look at it.

    Parameters
    ----------
    source : str or Path
        The model file.

    Returns
    -------
    Overview
        Mass (kg), height (m), first period (s) and its damping ratio; `to_dict` has the row of
        `tdint check`.

    Raises
    ------
    ModelError
        All that is wrong with the file: what `load_model` refuses, an unknown method, a record that
        is not there, a building that cannot stand.
    RecordError
        The record that it names cannot be read.
    """
    model = load_judged(
        source, {"analysis.method": lambda text, _: parse(text), **dict.fromkeys(_RECORD, _there)}
    )
    try:
        building = assemble(model)
        omega, damping = building.first_mode()
    except ModelError as error:
        raise ModelError(f"{model.source}: {error}") from None
    # The ground motion that it names, processed and scaled; standard input is not read for a look.
    pga, interval, source_of_record = math.nan, None, model.excitation.record
    if (
        source_of_record is not None
        and source_of_record.file != "-"
        and (record := model_record(model))
    ):
        pga, interval = record.pga, record.dt
    period = 2.0 * math.pi / omega
    warnings = (
        *doubts(model, building, pga),
        *long_step(building, model.analysis.dt, interval),
    )
    return Overview(
        model, float(building.mass.sum()), float(building.rises.sum()), period, damping, warnings
    )


def modes(model: AnyModel) -> Modes:
    """The undamped modes of a model's initial stiffness, with their damping ratios.

    Parameters
    ----------
    model : Model, str, Path or mapping
        What `run` takes.

    Returns
    -------
    Modes
        Circular frequencies (rad/s), shapes, damping ratios and effective masses.

    Raises
    ------
    ModelError
        The model is none; P-delta larger than a story's stiffness.
    """
    building = assemble(model_of(model))
    result = building.modes()
    return replace(result, damping=result.damping_ratios(building.damping_matrix()))


_RECORD = ("excitation.record", "excitation.record.file", "excitation.record.inventory")


def _there(text: str, folder: Path) -> None:
    if text != "-" and not is_file(folder / text):
        raise UsageError(f"there is no file {folder / text}")
