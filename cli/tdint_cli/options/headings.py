"""Options stand in the help of a command under headings: whose they are, not the order of declaration."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeVar, dataclass_transform

import click
from click.core import ParameterSource

from tdint.errors import UsageError
from tdint_cli.options.values import ListOf
from tdint_cli.terminal import Settings

Function = TypeVar("Function", bound=Callable[..., Any])
Kind = TypeVar("Kind")

_OPTIONS: dict[type[Any], Sequence[Callable[[Any], Any]]] = {}
"""Of each request."""

OWN, RECORD, SPECTRUM, INTENSITY = "Options", "Record", "Spectrum", "Intensity"
ANALYSIS, OUTPUT, GENERAL = "Analysis", "Output", "General"
ORDER = (OWN, RECORD, SPECTRUM, INTENSITY, ANALYSIS, OUTPUT, GENERAL)
"""The headings in the order of the help; `OWN` is for what is peculiar to one command."""


BESIDE = "\0"
"""The value of such an option alone; no file has such a name."""

_NAMES = {
    "--plot": re.compile(r".*\.(png|pdf|svg|jpe?g|gif|e?ps|tiff?|webp|bmp|svgz|pgf)", re.IGNORECASE | re.DOTALL),
    "--history": re.compile(r".*\.csv(\.gz)?", re.IGNORECASE | re.DOTALL),
}
"""What follows such an option and names its file; pictures that cannot be are refused later, in words."""


class HeadedOption(click.Option):
    """An option that knows its heading, and without which others of the command line it has nothing to act on."""

    def __init__(self, *arguments: Any, heading: str = OWN, needs: str = "", **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self.heading = heading
        self.needs = needs


if TYPE_CHECKING:

    class _Value(Any):  # type: ignore[misc]
        """In a request a declaration stands for the value that is given."""
else:
    _Value = object


@dataclass(frozen=True)
class Declaration(_Value):
    """An option or an argument: what declares it of a command, or of a field of its request (`request`).

    Attributes
    ----------
    declare : callable
        `click.option` or `click.argument`.
    names : tuple of str
        As click takes them; in a request they may be left out.
    settings : dict
        What click is told of it.
    behind : sequence of callable
        What is declared with it, behind it; no field has their values.
    """

    declare: Any
    names: tuple[str, ...]
    settings: dict[str, Any]
    behind: Sequence[Callable[[Any], Any]] = ()

    def __call__(self, command: Function) -> Function:
        return with_options((self.declare(*self.names, **self.settings), *self.behind), command)

    def of_field(self, name: str) -> Declaration:
        """The same for a field of a request, which names what has no name, and is what the command gets it as."""
        flags = [flag for flag in self.names if flag.startswith("-")]
        if not flags and self.declare is click.option:
            flags = [f"--{name.replace('_', '-')}"]
        return replace(self, names=(*flags, name))


def option(
    *names: str,
    heading: str = OWN,
    many: bool = False,
    needs: str = "",
    once: bool = True,
    behind: Sequence[Callable[[Any], Any]] = (),
    **settings: Any,
) -> Declaration:
    """As `click.option`, under a heading.

    `needs`: what it acts on, as in `--history`, `--ductility or --strength`, `--im sa or sa-avg`: an option, one of
    several, or one with one of these values, its default among them. Given alone the option is refused.

    `many`: values with commas between them, and the option may be repeated; the command gets all of them, each once
    (or, without `once`, as they are), as a tuple, or None if there is none.
    """
    if many:
        settings |= {"type": ListOf(settings["type"]), "multiple": True, "callback": _each_once if once else _each}
    return Declaration(
        click.option, names, settings | {"cls": HeadedOption, "heading": heading, "needs": needs}, behind
    )


def argument(metavar: str, **settings: Any) -> Declaration:
    """As `click.argument`, of a field of a request."""
    return Declaration(click.argument, (), settings | {"metavar": metavar})


@dataclass_transform(frozen_default=True, kw_only_default=True)
def request(kind: type[Kind]) -> type[Kind]:
    """A command line as a frozen dataclass: a field whose default is an option is given by it (`of`), in the order of
    the fields, others by what else the command has."""
    declared = {name: value for name, value in vars(kind).items() if isinstance(value, Declaration)}
    for name in declared:
        delattr(kind, name)
    made = dataclass(frozen=True, kw_only=True)(kind)
    _OPTIONS[made] = tuple(value.of_field(name) for name, value in declared.items())
    return made


def of(kind: type[Any], among: str = "") -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The options that are declared in a request, not in those it is derived from; the command gets the request, or
    among others by a name."""

    def declared(command: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(command)
        def collected(**given: Any) -> Any:
            if not among:
                return command(kind(**given))
            own = {one.name: given.pop(one.name) for one in fields(kind)}
            return command(**given, **{among: kind(**own)})

        return with_options(_OPTIONS[kind], collected)

    return declared


def with_options(declarations: Iterable[Callable[[Any], Any]], command: Function) -> Function:
    """The command with options, in their order."""
    for declared in reversed(tuple(declarations)):
        command = declared(command)
    return command


def _each(_: click.Context, __: click.Parameter, lists: tuple[tuple[Any, ...], ...]) -> tuple[Any, ...] | None:
    return tuple(value for values in lists for value in values) or None


def _each_once(ctx: click.Context, option: click.Parameter, lists: tuple[tuple[Any, ...], ...]) -> Any:
    return tuple(dict.fromkeys(_each(ctx, option, lists) or ())) or None


def with_named_files(arguments: Sequence[str], options: Collection[str] = tuple(_NAMES)) -> list[str]:
    """A command line in which every option of these has its value: the next word if that is such a name or empty."""
    result: list[str] = []
    words = iter(enumerate(arguments))
    for i, word in words:
        if word == "--":
            return [*result, *arguments[i:]]
        if word not in _NAMES or word not in options:
            result.append(word)
            continue
        following = arguments[i + 1] if i + 1 < len(arguments) else BESIDE
        if following == "" or _NAMES[word].fullmatch(following):
            next(words)
            result.append(f"{word}={following}")
        else:
            result.append(f"{word}={BESIDE}")
    return result


class Command(click.Command):
    """A command whose help has headings, with the options that every command has."""

    def __init__(self, name: str | None, **settings: Any) -> None:
        settings["params"] = [*(settings.get("params") or ()), *general()]
        super().__init__(name, **settings)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does, after `--plot` and the like have got their values; refuse what has nothing to act on."""
        own = {name for parameter in self.params for name in parameter.opts}
        rest = super().parse_args(ctx, with_named_files(args, own))
        if not ctx.resilient_parsing:
            _refuse_idle(ctx, self.params)
        return rest

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, a section for each heading."""
        write_options(self.get_params(ctx), ctx, formatter)


def _refuse_idle(ctx: click.Context, parameters: Sequence[click.Parameter]) -> None:
    """Raise UsageError for an option that is given without what it needs: it would be passed over in silence."""
    named = {name: one for one in parameters for name in (*one.opts, (one.metavar or "").strip("[]."))}
    for option in parameters:
        needs = getattr(option, "needs", "")
        if needs and _is_given(ctx, option) and not _is_met(ctx, needs, named):
            name = option.opts[-1]
            raise UsageError(f"{name} has nothing to act on without {needs}; add it, or leave {name} out")


def _is_given(ctx: click.Context, parameter: click.Parameter) -> bool:
    # To click before 8.2 an argument of any number of values, given none, comes from the command line, too.
    name = parameter.name or ""
    return ctx.get_parameter_source(name) == ParameterSource.COMMANDLINE and ctx.params.get(name) != ()


def _is_met(ctx: click.Context, needs: str, named: Mapping[str, click.Parameter]) -> bool:
    """Whether one of the needed options is given or, where values are named, has one of them."""
    words = needs.split(" or ")
    name, _, value = words[0].partition(" ")
    if value:
        return ctx.params[named[name].name or ""] in (value, *words[1:])
    return any(_is_given(ctx, named[word]) for word in words)


def command(name: str) -> Callable[[Callable[..., Any]], Command]:
    """Make a function a command of this name."""
    return click.command(name, cls=Command)


def write_options(parameters: list[click.Parameter], ctx: click.Context, formatter: click.HelpFormatter) -> None:
    """Write the help of options, a section for each heading."""
    sections: dict[str, list[tuple[str, str]]] = {heading: [] for heading in ORDER}
    for parameter in parameters:
        record = parameter.get_help_record(ctx) if isinstance(parameter, click.Option) else None
        if record is not None:
            sections[getattr(parameter, "heading", GENERAL)].append(record)
    for heading, records in sections.items():
        if records:
            with formatter.section(heading):
                formatter.write_dl(records)


def general() -> list[click.Parameter]:
    """The options that every command has."""
    return [
        _setting(["-q", "--quiet"], "quiet", "Say nothing but warnings that change what a number means, and errors."),
        _setting(["--debug"], "debug", "Show a traceback with an error."),
    ]


def _setting(names: list[str], field: str, text: str) -> HeadedOption:
    """A flag that sets a field of the settings, before or after the command's name."""

    def switch(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
        if wanted:
            setattr(ctx.ensure_object(Settings), field, True)

    return HeadedOption(
        names, heading=GENERAL, is_flag=True, is_eager=True, expose_value=False, callback=switch, help=text
    )
