"""The command lines of `spectrum` and `drift-spectrum`, and what a kind of table over the period must do with them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from tdint.analysis.defaults import PERIODS
from tdint.errors import UsageError
from tdint.written_numbers import Grid, parse_grid
from tdint_cli.options.plot import BESIDE
from tdint_cli.options.record import RecordsRequest

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tdint.analysis.spectra.elastic import SpectrumSettings
    from tdint.analysis.spectra.published import PublishedSpectrum
    from tdint.campaign.suites.target import TargetSpectrum
    from tdint.ground_motion.pairing import PairNames
    from tdint.ground_motion.record import Record
    from tdint.output.figures.style import Figure
    from tdint.output.tables.table import Table
    from tdint.output_units import OutputUnits

_NOT_SETTINGS = ("records", "output", "plot", "axes", "jobs", "overwrite", "period", "output_units", "history")


@dataclass(frozen=True)
class Results:
    """What a command makes of one record.

    Attributes
    ----------
    lines : sequence
        Its results, one per line of a picture.
    records : sequence of Record
        The components that they are of.
    notes : sequence of str
        What there is to say beside the notes of the components.
    """

    lines: Sequence[Any]
    records: Sequence[Record]
    notes: Sequence[str] = ()


class Kind:
    """A kind of table over the period, of a command's name and the periods that it has where none are asked for."""

    command = "spectrum"
    default_periods = PERIODS

    def check(self, request: Any) -> None:
        """Refuse, before any work, a request that makes no sense (UsageError)."""

    def gather(self, request: Any, files: Sequence[str]) -> list[tuple[str, ...]]:
        """From the request and all files the files of each record; here each is a record by itself."""
        return [(file,) for file in files]

    def compute(self, request: Any, records: Sequence[Record]) -> Results:
        """The results of the components of one record."""
        raise NotImplementedError

    def table(self, request: Any, lines: Sequence[Any]) -> Table:
        """The table of results."""
        raise NotImplementedError

    def picture(self, request: Any, lines: Sequence[Any]) -> Figure:
        """The figure of results."""
        raise NotImplementedError

    def remark(self, request: Any, interval: float) -> str:
        """What is to be said at the end for the longest sampling interval of all records (s); empty for nothing."""
        return ""


@dataclass(frozen=True)
class TablesRequest(RecordsRequest):
    """What the command lines have in common that make a table over the period of each record."""

    damping: tuple[float, ...]
    periods: Grid | None
    period: tuple[float, ...] | None
    output: str | None
    plot: str | None
    jobs: int
    overwrite: bool
    output_units: OutputUnits | None

    @property
    def shown_units(self) -> OutputUnits:
        """The units of all that is written."""
        from tdint.output_units import SI

        return self.output_units or SI

    @property
    def is_folder(self) -> bool:
        """Whether -o names a folder: one that exists, or by a separator at its end."""
        from tdint.input_bytes import is_folder

        output = self.output
        return output is not None and (output.endswith(("/", os.sep)) or is_folder(output))

    def check_plot(self) -> None:
        """Raise UsageError for one picture of what goes into several tables."""
        if self.is_folder and self.plot not in (None, BESIDE):
            raise UsageError("--plot=FILE is one picture of all records; give -o a file, or --plot alone for one each")

    def settings(self, default_periods: str) -> dict[str, Any]:
        """All that the numbers depend on beside the records, for the JSON file."""
        settings = {name: value for name, value in asdict(self).items() if name not in _NOT_SETTINGS}
        return settings | {"periods": list(self.period or ()) or str(self.periods or default_periods)}

    def chosen_periods(self, default: str) -> NDArray[np.float64]:
        """The periods, s.

        Raises
        ------
        UsageError
            They are given in two ways, or their text is wrong.
        """
        import numpy as np

        if self.periods is not None and self.period:
            raise UsageError("--periods and --period are given; leave one of them out")
        return np.array(self.period) if self.period else (self.periods or parse_grid(default)).values()


@dataclass(frozen=True)
class SpectrumRequest(TablesRequest):
    """The command line of `tdint spectrum`."""

    method: str | None
    maxima: str | None
    interpolation: str | None
    rotd: tuple[int, ...] | None
    pairs: PairNames | None
    ductility: tuple[float, ...] | None
    strength: tuple[float, ...] | None
    hardening: float | None
    oscillator: tuple[float, ...] | None
    history: str | None
    axes: str | None
    target: str | None
    against: str | None
    against_column: str | None
    against_interpolation: str | None
    scale: float | None

    def read(self, file: str) -> list[Record]:
        """The components of a file, times the factor that is asked for."""
        found = super().read(file)
        return found if self.scale is None else [record.scaled(self.scale) for record in found]

    def settings(self, default_periods: str) -> dict[str, Any]:
        """As those of all tables, with what is chosen where nothing is given."""
        manner = self.manner
        yields = self.ductility or self.strength
        return super().settings(default_periods) | {
            "method": self.method or "exact",
            "hardening": self.hardening or 0.0 if yields else None,
            "maxima": manner.maxima.name,
            "interpolation": manner.interpolation.name,
            "against_sha256": self.published(self.damping[0]).input.sha256 if self.against else None,
        }

    def published(self, damping: float) -> PublishedSpectrum:
        """The published spectrum for a damping ratio."""
        from tdint.analysis.spectra.published import read_published

        assert self.against is not None
        return read_published(self.against, damping, self.against_column)

    @property
    def aim(self) -> TargetSpectrum | None:
        """The target spectrum, if one is asked for."""
        from tdint.campaign.suites.target import read_target

        return read_target(self.target) if self.target is not None else None

    @property
    def manner(self) -> SpectrumSettings:
        """How elastic spectra are made."""
        from tdint.analysis.spectra.elastic import choose_settings

        return choose_settings(self.method, self.maxima, self.interpolation)

    @property
    def stated(self) -> tuple[str, ...]:
        """What was chosen by name and therefore has a column."""
        return tuple(name for name in ("maxima", "interpolation") if getattr(self, name) is not None)

    def refuse(self, options: tuple[str, ...], reason: str) -> None:
        """Raise UsageError for one of these options if it is given."""
        for name in options:
            if getattr(self, name) is not None:
                raise UsageError(f"--{name} {reason}")
