"""`tdint drift-spectrum`: maximum story drift of shear buildings over their period."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import UsageError
from tdint.grids import Grid
from tdint.response.defaults import DRIFT_PERIODS, HEIGHT_PERIOD, STORY_HEIGHT
from tdint_cli import options
from tdint_cli.commands.spectrum import Results, TablesRequest, TableType, make_tables

if TYPE_CHECKING:
    from tdint.ground_motion.record import Record

_HEIGHT_PERIOD = ",".join(f"{number:g}" for number in HEIGHT_PERIOD)


@options.request
class DriftRequest(TablesRequest):
    """The command line of `tdint drift-spectrum`."""

    DEFAULT_PERIODS = DRIFT_PERIODS

    damping: tuple[float, ...] = options.spectra.damping
    periods: tuple[float | Grid, ...] | None = options.spectra.periods
    stories: int | None = options.option(type=click.IntRange(1))
    story_height: float | None = options.option()
    height_period: str = options.option(default=_HEIGHT_PERIOD)
    beam: bool = options.option()

    def settings(self) -> dict[str, Any]:
        """Return the settings of all spectra, and the story height or its default value."""
        # The layout and the processing are in the descriptions of the records.
        settings = super().settings() | {"layout": None, "processing": None}
        if not self.beam and self.stories is None:
            settings["story_height"] = self.story_height or STORY_HEIGHT
        return settings


@options.command
@options.record.plain_record_options
@options.spectra.tables_of_records()
@options.of(DriftRequest)
def command(request: DriftRequest) -> None:
    """Compute drift spectra: maximum story drifts of shear buildings.

    RECORD is a file, or a directory for all records in it; - is standard input. All components are
    used unless --component specifies one component. The buildings are linear, with stories of equal
    mass, stiffness and height, and the same damping ratio in all modes. CSV: the maximum drift
    ratio of all stories, the story in which it occurs (empty for --beam), and the maximum roof
    displacement divided by the height of the building. The values are exact for a ground motion
    that is linear between its samples, including maxima between samples. An error in one record
    does not stop the processing of other records.

    A and B of some codes, in s and m: 0.0731,0.75 for moment frames of reinforced concrete in the
    Uniform Building Code of 1997, and in ASCE 7 for steel frames with eccentric or
    buckling-restrained braces; 0.0724,0.8 and 0.0466,0.9 for moment frames of steel and of concrete
    in ASCE 7; 0.0488,0.75 for other buildings in both codes.
    """
    make_tables(request, _DriftSpectra())


class _DriftSpectra(TableType):
    """Drift spectra of each component for each damping ratio."""

    def check(self, request: DriftRequest) -> None:
        if request.stories is not None and request.story_height is not None:
            raise UsageError("--stories cannot be used with --story-height; omit one")
        if request.beam and (request.stories is not None or request.story_height is not None):
            raise UsageError("--beam has no stories; omit --stories and --story-height")
        from tdint.response.spectra.drift import number_of_stories, parse_height_period

        # These functions raise UsageError for invalid coefficients of --height-period, and for
        # buildings with too many stories. Their results are computed again for each record.
        heights = parse_height_period(request.height_period).height(request.chosen_periods())
        if not request.beam:
            number_of_stories(heights, request.stories, request.story_height or STORY_HEIGHT)

    def compute(self, request: DriftRequest, records: Sequence[Record]) -> Results:
        """Return the spectra of each component for each damping ratio."""
        from tdint.response.spectra.drift import drift_spectrum, parse_height_period

        results = [
            drift_spectrum(
                record,
                request.chosen_periods(),
                damping,
                stories=request.stories,
                story_height=request.story_height or STORY_HEIGHT,
                height_period=parse_height_period(request.height_period),
                beam=request.beam,
            )
            for record in records
            for damping in request.damping
        ]
        return Results(results, records)
