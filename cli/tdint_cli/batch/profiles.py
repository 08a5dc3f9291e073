"""What commands of many runs tell of a suite: profiles.csv, its picture, a limit of drifts, buildings side by side."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

from tdint.errors import AnalysisError, TdintError, UsageError
from tdint.output import figures, tables
from tdint.written_numbers import how_many
from tdint_cli import options
from tdint_cli.options.headings import BESIDE, Declaration
from tdint_cli.options.output import check_picture
from tdint_cli.options.spectra import FloorRequest
from tdint_cli.options.values import Ratio
from tdint_cli.terminal import say, warn

if TYPE_CHECKING:
    from tdint.campaign.plan import Plan
    from tdint.campaign.profiles import Profile
    from tdint.campaign.store.store import Store
    from tdint.files import Content
    from tdint.output.tables.table import Table
    from tdint.output_units import OutputUnits

PROFILES, PICTURE, RATIOS = "profiles.csv", "profiles.png", "ratios.csv"
"""In the folder of -o."""


def drift_limit(*names: str) -> Declaration:
    """The option --drift-limit, under more names."""
    return options.analysis.option(
        *names,
        "--drift-limit",
        type=Ratio(0.0, 1.0, min_open=True),
        metavar="2%",
        help="Say whether the mean of the motions' largest drift ratios stays within this in every story; a line of "
        "the picture, too.",
    )


REQUIRE = options.analysis.option(
    is_flag=True,
    needs="--drift-limit",
    help="End with exit code 5 unless it does, under every motion without collapse.",
)
"""The option --require, behind it."""


@dataclass(frozen=True, kw_only=True)
class SuiteRequest:
    """What the command lines of many runs have in common: where and how they are written, in how many threads, a limit
    of drifts, a baseline, intensities of the motions."""

    output: str | None
    overwrite: bool
    output_units: OutputUnits | None
    plot: str | None
    report: str | None
    drift_limit: float | None
    require: bool
    jobs: int | None
    of_floors: FloorRequest
    baseline: str | None = None
    im: tuple[str, ...] | None = None

    def picture(self, folder: Path | None) -> Path | None:
        """The file of the picture, if one is asked for.

        Raises
        ------
        UsageError
            It has no name, and there is no folder.
        """
        if self.plot is None:
            return None
        if self.plot != BESIDE:
            check_picture(Path(self.plot))
            return Path(self.plot)
        if folder is None:
            raise UsageError("--plot alone puts the picture into the folder of -o: add -o DIR, or name it")
        return folder / PICTURE


@dataclass(frozen=True)
class Profiles:
    """Those of a store, found once for all that is made of them."""

    store: Store
    request: SuiteRequest
    units: OutputUnits

    @cached_property
    def found(self) -> list[Profile]:
        """Of each building and level."""
        from tdint.campaign.profiles import profiles

        return list(profiles(self.store))

    def ratios(self, *, stories: bool) -> Table:
        """The buildings over the baseline.

        Raises
        ------
        UsageError
            There is no such building.
        """
        from tdint.campaign.profiles import ratios

        self._need("--baseline")
        return tables.campaign.ratio_table(self.store, ratios(self.found, self.request.baseline or ""), stories=stories)

    def draw(self, file: Path) -> Content:
        """The picture.

        Raises
        ------
        AnalysisError
            No stories were kept.
        """
        self._need("--plot")
        limit, title = self.request.drift_limit, self.store.meta("name")
        draw = partial(figures.demands.profile_picture, self.found, self.units, limit=limit, title=title)
        return figures.style.picture(file.suffix, draw)

    def _need(self, option: str) -> None:
        if not self.found:
            raise AnalysisError(
                f"{option}: the peaks of stories are not kept; give the campaign `outputs: {{profiles: true}}`"
            )

    def report(self, plan: Plan) -> bytes:
        """The page of the suite."""
        from tdint.output.report_chapters import suite_page

        limit = self.request.drift_limit
        said = [] if limit is None else [self._told(one, _verdict(one, limit)[0]) for one in self.found]
        lost = [text for one in self.found if (text := self._lost(one))]
        warnings = [*(str(error) for error in plan.failures), *lost]
        return suite_page(plan, self.store, self.found, said=said, warnings=warnings, limit=limit, units=self.units)

    def _told(self, one: Profile, text: str) -> str:
        name = _name(one, self.found)
        return f"{name}: {text[0].lower()}{text[1:]}" if name else text

    def _lost(self, one: Profile) -> str:
        """What the means of a building do not hold; nothing if it stood under every motion."""
        lost = {"collapsed": one.collapsed, "failed": one.failed}
        told = " and ".join(f"{count} {what}" for what, count in lost.items() if count)
        if not told:
            return ""
        left = len(one.motions)
        others = f"{left} others" if left > 1 else "other"
        means = f"the means are those of the {others}" if left else "there is no mean"
        name = _name(one, self.found) or one.building
        return f"{name}: of {how_many(one.runs, 'motion')} {told}; {means}"

    def tell(self) -> list[TdintError]:
        """Say what means do not hold, and what the mean drifts are beside the limit.

        Returns
        -------
        list of TdintError
            That they are beyond, if that is required not to be.
        """
        limit = self.request.drift_limit
        for one in self.found:
            if text := self._lost(one):
                warn(text)
        if limit is None:
            return []
        self._need("--drift-limit")
        beyond = []
        for one in self.found:
            text, within = _verdict(one, limit)
            say(self._told(one, text))
            beyond += [] if within else [_name(one, self.found) or one.building]
        if beyond and self.request.require:
            return [AnalysisError(f"the drift limit of {100.0 * limit:g} % is not met: {'; '.join(beyond)}")]
        return []


def _name(profile: Profile, among: list[Profile]) -> str:
    """Building and level, as far as they tell it from others."""
    parts = [profile.building] if len({one.building for one in among}) > 1 else []
    levels = {(repr(one.scale), repr(one.level)) for one in among}
    if len(levels) > 1:
        parts.append(profile.level_text)
    return ", ".join(parts)


def _verdict(profile: Profile, limit: float) -> tuple[str, bool]:
    """What the drifts of a building are beside a limit, and whether they are within."""
    from tdint.campaign.profiles import check_drift

    check = check_drift(profile, limit)
    lost = profile.collapsed + profile.failed
    if check is None:
        return f"No motion of {profile.runs} came to its end, limit {100.0 * limit:g} %: beyond", False
    words = "within" if check.within else "beyond"
    if lost:
        words += f", for {lost} of {how_many(profile.runs, 'motion')} collapsed or failed"
    text = (
        f"Mean drift {100.0 * check.mean:.3g} % (story {check.story}), limit {100.0 * limit:g} %: {words}; largest "
        f"{100.0 * check.largest:.3g} %."
    )
    return text, check.within
