"""`tdint init`: a first model file that runs as it is."""

from __future__ import annotations

import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tdint.errors import UsageError
from tdint.files import write_files
from tdint.number_parsing import pluralize
from tdint_cli import options
from tdint_cli.options.grammar import Count, FileName, Mode, Name, Written, refuse_idle
from tdint_cli.terminal import emit, say

if TYPE_CHECKING:
    from tdint.model.story_curves import FittedLaw

FILE = "building.yaml"
_STORIES, _PERIOD_OF_A_STORY = 5, 0.1
_MOST_STORIES = 200
_MAX_LISTED_MISFITS = 12  # misfits that are told
_SHORTEST = 0.001
"""Period of a building, s: shorter ones are slips of the pen."""


def _structures() -> list[str]:
    from tdint.model.mdof_lu import STRUCTURES

    return list(STRUCTURES)


def _weights(text: str) -> tuple[float, ...]:
    """Positive numbers with commas between them, equal ones as COUNTxNUMBER: one for each floor."""
    weights: list[float] = []
    for word in text.split(","):
        count, times, number = word.strip().rpartition("x")
        # Without a count before it a weight is that of one floor.
        whole = int(count) if count.isascii() and count.isdecimal() else 0 if times else 1
        try:
            weight = float(number)
        except ValueError:
            weight = math.nan
        if not (1 <= whole <= _MOST_STORIES and 0.0 < weight < math.inf):
            raise click.BadParameter(
                f"{word.strip()!r} is no weight; write 4200, or 6x3900 for six floors"
            )
        weights += [weight] * whole
    if len(weights) > _MOST_STORIES:
        raise click.BadParameter(f"{len(weights)} floors are more than {_MOST_STORIES}")
    return tuple(weights)


_EQUAL = Mode("without --weights and --type", frozenset(("stories", "period")))
_WEIGHTS = Mode(
    "with --weights", frozenset(("weights", "period")), {"stories": "there is one for each weight"}
)
_CURVES = Mode(
    "with --from-pushover", frozenset({"weights"}), {"period": "the curves give the stiffness"}
)
_TYPE = Mode(
    "with --type",
    frozenset({"stories"}),
    {
        "weights": "the rules of the type give the masses",
        "period": "the rules of the type give the period",
    },
)
MODES = (_EQUAL, _WEIGHTS, _CURVES, _TYPE)


@options.request
class Request:
    """The command line of `tdint init`."""

    file: str = options.argument("[FILE]", default=FILE, type=FileName(written=True))
    stories: int = options.option(
        type=Count(1, _MOST_STORIES), default=_STORIES, help=f"Stories; {_STORIES} by default."
    )
    period: float | None = options.option(
        type=click.FloatRange(0.0, 100.0, min_open=True),
        metavar="SECONDS",
        help="Fundamental period of equal floors on bilinear stories; 0.1 s for each story by "
        "default.",
    )
    weights: tuple[float, ...] | None = options.option(
        type=Written("weight,...", _weights),
        help="Weights of the floors from the ground up, kN (kip of --units us), equal ones as "
        "6x3900: one story each, stiffnesses such that the first mode is a straight line with "
        "--period.",
    )
    from_pushover: str | None = options.option(
        type=FileName(),
        needs="--weights",
        metavar="CURVES.csv",
        help="Fit the law of each story to its curve in this CSV file, with the columns story, "
        "drift_m and shear_N (or in other units); says the misfit.",
    )
    law: str = options.option(
        needs="--from-pushover",
        type=click.Choice(["bilinear", "trilinear", "multilinear"]),
        default="bilinear",
        help="What is fitted; bilinear by default. A multilinear one has four points and may "
        "fall; none of them pinches.",
    )
    motion: str | None = options.option(
        metavar="NAME:PARAMETERS",
        help="The artificial motion beside the model: sine:frequency=1.5,duration=20,pga=0.1g "
        "(Hz, s), sweep:first=0.5,last=10,duration=40,pga=0.1g, or pulse:period=1.2,velocity=0.4 "
        "(m/s).",
    )
    structure: str | None = options.option(
        "--type",
        type=Name(_structures),
        help="A building of this Hazus type instead, by rules: W1, S1, C1, RM1, URM, ...; with "
        "--year and --area.",
    )
    year: int | None = options.option(
        type=click.IntRange(1000, 2200),
        needs="--type",
        metavar="YEAR",
        help="Its year of construction.",
    )
    area: float | None = options.option(
        needs="--type",
        type=click.FloatRange(0.0, min_open=True),
        metavar="AREA",
        help="The area of one floor, in m^2, of --units us in ft^2.",
    )
    units: str = options.option(
        type=click.Choice(["si", "us"]),
        default="si",
        help="Units of the file and of its output: kN, m, t, or kip, in and weights; si by "
        "default.",
    )
    overwrite: bool = options.output.overwrite


@options.command(
    "init",
    "tdint init office.yaml --stories 5 --period 0.8",
    "tdint init shop.yaml --type C1 --year 1985 --area 600 --stories 3",
)
@options.of(Request)
def command(request: Request) -> None:
    """Create a commented example model, ready to run.

    FILE (building.yaml if there is none) gets the model; beside it lies an artificial ground
    motion, so that `tdint run FILE` shows something until you have a record. The motion is FILE
    without its suffix and with -motion.txt. FILE may be -, standard output: that model vibrates
    freely, without a record.
    """
    _check(request)
    if request.file == "-":
        emit(_model("building", request, None).encode())
        return
    from tdint.ground_motion.pulse import VelocityPulse, motion_text, parse_motion

    file = Path(request.file)
    motion = file.with_name(f"{file.stem}-motion.txt")
    unit = "g" if request.units == "us" else "m/s^2"
    texts = {
        file: _model(file.stem, request, motion.name),
        motion: motion_text(
            parse_motion(request.motion) if request.motion else VelocityPulse(), unit=unit
        ),
    }
    write_files({path: text.encode() for path, text in texts.items()}, overwrite=request.overwrite)
    say(f"{file} is a model that runs as it is, under the artificial motion {motion}. Next:")
    name = shlex.quote(str(file))
    say(f"  tdint check {name}\n  tdint run {name} -o out --plot")


def _check(request: Request) -> None:
    """Refuse what does not go together.

    Raises
    ------
    UsageError
        A name or a period that no model has; a period beside a type, or a type without its facts.
    """
    # Of a name that ends in .gz the content would be packed, which no model is.
    if (
        not Path(request.file).stem.strip()
        or Path(request.file).name == ".."
        or request.file.lower().endswith(".gz")
    ):
        raise UsageError(f"{request.file!r} is no name of a file; give one such as {FILE}")
    if not request.file.isprintable():  # nor are bytes that are no UTF-8
        raise UsageError(
            f"{request.file!a:.100}: a model's name is a line of UTF-8 without control characters"
        )
    if request.period is not None and not request.period >= _SHORTEST:
        raise UsageError(f"--period must be from {_SHORTEST:g} to 100 s, got {request.period:g}")
    if request.motion and request.file == "-":
        raise UsageError("--motion is a file beside the model's; give that a name")
    if request.structure is None:
        of_weights = _CURVES if request.from_pushover else _WEIGHTS
        refuse_idle(of_weights if request.weights else _EQUAL, MODES)
        return
    refuse_idle(_TYPE, MODES)
    structures = _structures()
    if request.structure not in structures:
        raise UsageError(f"unknown type {request.structure!r}; known: {', '.join(structures)}")
    if request.year is None or request.area is None:
        raise UsageError("--type needs --year and --area, such as --type C1 --year 1985 --area 600")


def _laws(request: Request) -> list[FittedLaw]:
    """The laws of the stories, fitted to their curves, and how well they fit."""
    from tdint.model.story_curves import fit_story, read_story_curves

    assert request.from_pushover is not None and request.weights is not None
    curves = read_story_curves(request.from_pushover)
    # Each floor stands on one story: there is a curve for each weight.
    if len(curves) != len(request.weights):
        stories, floors = pluralize(len(curves), "story"), pluralize(len(request.weights), "floor")
        raise UsageError(f"{request.from_pushover} has {stories}, --weights {floors}")
    fits = [fit_story(story, drift, shear, request.law) for story, (drift, shear) in curves.items()]
    worst = max(fits, key=lambda fit: fit.misfit)
    listed = ", ".join(f"{100.0 * fit.misfit:.2g}" for fit in fits[:_MAX_LISTED_MISFITS]) + (
        " ..." if len(fits) > _MAX_LISTED_MISFITS else ""
    )
    say(
        f"Misfit of the stories (root mean square over the largest shear): {listed} %; the worst "
        f"is story {worst.story}, {100.0 * worst.misfit:.2g} %."
    )
    return [fit.law for fit in fits]


def _model(name: str, request: Request, motion: str | None) -> str:
    from tdint.model.story_curves import story_model, type_model

    if request.structure is None:
        weights = request.weights
        stories = len(weights) if weights else request.stories
        return story_model(
            name,
            stories=stories,
            period=request.period or _PERIOD_OF_A_STORY * stories,
            system=request.units,
            motion=motion,
            weights=weights,
            laws=_laws(request) if request.from_pushover else None,
        )
    assert request.year is not None and request.area is not None
    return type_model(
        name,
        structure=request.structure,
        stories=request.stories,
        year=request.year,
        area=request.area,
        system=request.units,
        motion=motion,
    )
