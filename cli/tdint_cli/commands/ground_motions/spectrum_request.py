"""The command lines of `spectrum` and `drift-spectrum`, and what a kind of table over the period must do with them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import click

from tdint.analysis.defaults import MOST_DUCTILE, PERIODS
from tdint.errors import UsageError
from tdint.written_numbers import Grid, parse_grid
from tdint_cli import options
from tdint_cli.options import headings
from tdint_cli.options.headings import BESIDE
from tdint_cli.options.record import RecordsRequest
from tdint_cli.options.values import FileName, Number, Ratio, pair_names

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

AXES = options.output.option(
    "--axes",
    needs="--plot",
    type=click.Choice(["periods", "tripartite", "adrs"]),
    help="Axes of the picture of elastic spectra: PSA and SD over the period (periods, the default), PSV over it with "
    "scales of the other two (tripartite), or PSA over SD (adrs).",
)

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


@options.request
class SpectrumRequest(TablesRequest):
    """The command line of `tdint spectrum`."""

    damping: tuple[float, ...] = options.spectra.damping()
    periods: Grid | None = options.spectra.periods(PERIODS)
    period: tuple[float, ...] | None = options.spectra.period(" 0 gives the peak ground acceleration.")
    method: str | None = options.analysis.method
    maxima: str | None = options.spectra.option(
        type=click.Choice(["exact", "peer", "samples"]),
        help="Where the largest values are looked for: between the samples, too (exact, the default), at ten or more "
        "steps per period (peer, as PEER's own spectra), or at the record's samples (samples, as those of USGS). "
        "Not with --method, whose steps have their own. Adds a column.",
    )
    interpolation: str | None = options.spectra.option(
        type=click.Choice(["linear", "band-limited"]),
        help="The ground motion between its samples: straight lines (linear, the default), or the motion without "
        "frequencies above half the sampling rate (band-limited). Adds a column.",
    )
    rotd: tuple[int, ...] | None = options.spectra.option(
        type=click.IntRange(0, 100),
        many=True,
        metavar="P,...",
        help="Spectra of two horizontal components instead: these percentiles of the pseudo-acceleration over all "
        "directions, such as 0,50,100 (RotD00, RotD50, RotD100).",
    )
    pairs: PairNames | None = options.spectra.option(
        needs="--rotd",
        type=pair_names,
        metavar="NAMES",
        help="How the two files of a motion are named, {} for what they share: '{}_N.AT2,{}_E.AT2'.",
    )
    ductility: tuple[float, ...] | None = options.spectra.option(
        type=Number(1.0, MOST_DUCTILE),
        many=True,
        metavar="MU,...",
        help="Inelastic spectra instead: the yield strength for each of these ratios of largest to yield displacement "
        "(the largest strength if there are several).",
    )
    strength: tuple[float, ...] | None = options.spectra.option(
        type=Ratio(0.0, min_open=True),
        many=True,
        metavar="RATIO,...",
        help="Inelastic spectra instead: the response for each of these ratios of yield force to weight.",
    )
    hardening: float | None = options.spectra.option(
        needs="--ductility or --strength",
        type=Ratio(0.0, 1.0, max_open=True),
        metavar="RATIO",
        help="With --ductility or --strength: stiffness after yielding over the initial one; 0 by default "
        "(elastoplastic).",
    )
    oscillator: tuple[float, ...] | None = options.spectra.option(
        needs="--history",
        type=Number(0.0, min_open=True),
        many=True,
        metavar="SECONDS,...",
        help="With --history: the motion of elastic oscillators of these periods instead.",
    )
    history: str | None = options.spectra.option(
        needs="--oscillator", metavar="", help="With --oscillator: a row for each sample."
    )
    target: str | None = options.studies.target(
        "Draw this spectrum over those of the records (--plot) or, without RECORD, write it as a table",
        headings.SPECTRUM,
    )
    against: str | None = options.spectra.option(
        type=FileName(),
        metavar="FILE",
        help="Difference to a published spectrum instead: CSV with names in its first line that say quantity and units "
        "(period_s, psa_g; T (s), SD (cm)); at its periods, unless others are given.",
    )
    against_column: str | None = options.spectra.option(
        needs="--against", metavar="NAME", help="Which column of the published spectrum, if it has several."
    )
    against_interpolation: str | None = options.spectra.option(
        needs="--against",
        type=click.Choice(["log-log"]),
        help="Take the published spectrum between its periods on straight lines in logarithms.",
    )
    axes: str | None
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
