"""`tdint init`: a first model file that runs as it is."""

from __future__ import annotations

import math
import shlex
from pathlib import Path

import click

from tdint.errors import UsageError
from tdint.files import write_files
from tdint_cli import options
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.options.option_types import Count, FileName, Written
from tdint_cli.terminal import emit, say

FILE, _CAMPAIGN = "building.yaml", "campaign.yaml"
_STORIES, _PERIOD_OF_A_STORY = 5, 0.1
"""Default number of stories, and default period of a building divided by this number, s."""
_MAX_STORIES = 200
"""Maximum number of stories; taller buildings do not exist, so that a larger number is an error."""
_MIN_PERIOD = 0.001
"""Minimum period of a building, s; shorter periods are typing errors."""


def _weights(text: str) -> tuple[float, ...]:
    """Return the weights of the floors from a comma-separated list of NUMBER or COUNTxNUMBER;
    BadParameter if a weight is not a positive number, or there are too many floors.
    """
    weights: list[float] = []
    for word in text.split(","):
        count, x, number = word.strip().rpartition("x")
        floors = 1  # a weight without a count
        if x:
            # `float` accepts any number of digits; `int` raises ValueError above 4300 digits.
            is_count = count.isascii() and count.isdecimal() and float(count) <= _MAX_STORIES
            floors = int(float(count)) if is_count else 0  # 0 is refused below
        try:
            weight = float(number)
        except ValueError:
            weight = math.nan
        if not (1 <= floors <= _MAX_STORIES and 0.0 < weight < math.inf):
            raise click.BadParameter(
                f"invalid weight {word.strip()!r}; write 4200, or 6x3900 for six floors of 3900"
            )
        weights += [weight] * floors
    if len(weights) > _MAX_STORIES:
        raise click.BadParameter(
            f"{len(weights)} weights exceed the maximum of {_MAX_STORIES} floors"
        )
    return tuple(weights)


@options.request
class Request:
    """The command line of `tdint init`."""

    file: str | None = options.argument("[FILE]", default=None, type=FileName(written=True))
    campaign: bool = options.option()
    stories: int = options.option(type=Count(1, _MAX_STORIES), default=_STORIES)
    period: float | None = options.option(type=click.FloatRange(0.0, 100.0, min_open=True))
    weights: tuple[float, ...] | None = options.option(type=Written("weight,...", _weights))
    units: str = options.option(default="si")
    overwrite: bool = options.option()


@options.command
@options.of(Request)
def command(request: Request) -> None:
    """Create a commented example model, ready to run.

    The model is written to FILE (building.yaml by default). An artificial ground motion is written
    next to it, so that `tdint run FILE` works before you have a record; its file has the name of
    the model with -motion.txt instead of the suffix. If FILE is - (standard output), the model has
    no ground motion and vibrates freely. With --campaign, FILE (campaign.yaml) is a campaign of the
    model FILE-model.yaml.
    """
    name = request.file or (_CAMPAIGN if request.campaign else FILE)
    _check(request, name)
    if name == "-":
        emit(_model("building", request, None).encode())
        return
    from tdint.ground_motion.pulse import VelocityPulse, motion_text
    from tdint.model.first_model import campaign_text

    file = Path(name)
    model = file.with_name(f"{file.stem}-model.yaml") if request.campaign else file
    motion = file.with_name(f"{file.stem}-motion.txt")
    unit = "g" if request.units == "us" else "m/s^2"
    texts = {
        model: _model(file.stem, request, motion.name),
        motion: motion_text(VelocityPulse(), unit=unit),
    }
    command, what = "run", "model"
    if request.campaign:
        texts[file] = campaign_text(file.stem, model.name, motion.name)
        command, what = "campaign", f"campaign of the model {model}"
    write_files({path: text.encode() for path, text in texts.items()}, overwrite=request.overwrite)
    say(f"{file}: {what}, ready to run under the artificial ground motion {motion}. Next:")
    quoted = shlex.quote(name)
    say(f"  tdint check {quoted}\n  tdint {command} {quoted} -o out --plot")


def _check(request: Request, name: str) -> None:
    """Check the options before the model is generated. UsageError is raised if the file name or the
    period is invalid, or options contradict each other.
    """
    # A file with the suffix .gz would be compressed, and models cannot be read from such files.
    is_name = Path(name).stem.strip() and Path(name).name != ".."
    if not is_name or name.lower().endswith(".gz") or (request.campaign and name == "-"):
        raise UsageError(f"{name!r} is not a valid file name; use a name such as {FILE}")
    # The name is also not printable if it contains bytes that are not UTF-8.
    if not name.isprintable():
        raise UsageError(f"{name!a:.100}: the file name must be UTF-8 without control characters")
    if request.period is not None and not request.period >= _MIN_PERIOD:
        raise UsageError(f"--period must be from {_MIN_PERIOD:g} to 100 s, got {request.period:g}")
    refuse_idle("weights" if request.weights else "equal")


def _model(name: str, request: Request, motion: str | None) -> str:
    """Return the text of the model file:

    `motion` is the name of the file of the ground motion; None for a model without a ground motion.
    """
    from tdint.model.first_model import story_model

    stories = len(request.weights) if request.weights else request.stories
    return story_model(
        name,
        floors=request.weights or stories,
        period=request.period or _PERIOD_OF_A_STORY * stories,
        system=request.units,
        motion=motion,
    )
