"""Kinds of values that options take: numbers in a range, ratios, lists of them, grids, names that
complete."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING, Any, TypeVar, dataclass_transform

import click
from click.core import ParameterSource
from click.shell_completion import CompletionItem

from tdint.errors import UsageError
from tdint.files import STDIN, keep_input
from tdint.units import (
    ACCELERATION,
    FORCE,
    LENGTH,
    MASS,
    VELOCITY,
    OutputUnits,
    Units,
    parse_drift,
    parse_output_units,
    parse_units,
)
from tdint.written_numbers import LARGEST, SMALLEST, Grid, parse_grid, parse_ratio
from tdint_cli.terminal import Settings, emit

if TYPE_CHECKING:
    from tdint.ground_motion.horizontals import PairNames

    ValueType = click.ParamType[Any]
else:
    ValueType = (
        click.ParamType
    )  # generic for a type checker alone: click before 8.4 knows no brackets


class Number(click.FloatRange):
    """A number in a range; nan, infinity and what cannot be computed with are in none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        if number != 0.0 and not SMALLEST <= abs(number) <= LARGEST:
            self.fail(
                f"{value}: its size must lie between {SMALLEST:g} and {LARGEST:g}", param, ctx
            )
        return number


class Ratio(Number):
    """A ratio in a range: 0.05 or 5%."""

    name = "ratio"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not isinstance(value, str):
            return value
        try:
            ratio = parse_ratio(value)
        except UsageError as error:
            self.fail(str(error), param, ctx)
        try:
            return super().convert(ratio, param, ctx)
        except click.BadParameter as error:
            if 1.0 <= ratio < 100.0 and "%" not in value:
                self.fail(f"{error.message.rstrip('.')}; did you mean {value}%?", param, ctx)
            raise


class Nonzero(Number):
    """A number other than zero."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if number == 0.0:
            self.fail("must be a number other than zero", param, ctx)
        return number


class Count(click.IntRange):
    """A whole number in a range, how many there are of something."""

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """What the help calls it."""
        return "COUNT"


class ListOf(ValueType):
    """Values of one type with commas between them.

    An option of this type may be repeated; the command gets all of them, each once (or, without
    `once`, as they are), as a tuple, or None if there is none.
    """

    def __init__(self, member: ValueType, once: bool = True) -> None:
        self.item = member
        self.name = f"{member.name},..."
        self.once = once

    def joined(
        self, _: click.Context, __: click.Parameter, lists: tuple[tuple[Any, ...], ...]
    ) -> tuple[Any, ...] | None:
        """The callback of an option of this type."""
        values = [value for values in lists for value in values]
        return tuple(dict.fromkeys(values) if self.once else values) or None

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if isinstance(value, tuple):
            return value
        parts = value.split(",") if isinstance(value, str) else [value]
        return tuple(
            self.item.convert(part.strip() if isinstance(part, str) else part, param, ctx)
            for part in parts
        )

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete what stands after the last comma."""
        head, comma, last = incomplete.rpartition(",")
        items = self.item.shell_complete(ctx, param, last)
        return [
            CompletionItem(head + comma + item.value, type=item.type, help=item.help)
            for item in items
        ]


class OutputUnitsType(ListOf):
    """Units of the output, with commas between them."""

    def __init__(self) -> None:
        super().__init__(Name(lambda: (*FORCE, *LENGTH, *MASS, *VELOCITY, *ACCELERATION)))
        self.name = "unit,..."

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> OutputUnits:
        return parse_output_units(value) if isinstance(value, str) else value


class Written(ValueType):
    """What people write in a form of its own, such as 0.2:2:50, as `read` understands it.

    Parameters
    ----------
    name : str
        What the help calls it, in capitals.
    read : callable
        Gives the value of a text; click.BadParameter, or UsageError, for one that is none.
    """

    def __init__(self, name: str, read: Callable[[str], Any]) -> None:
        self.name = name
        self.read = read

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return self.read(value) if isinstance(value, str) else value


def grid(low: float = 0.0, high: float = math.inf) -> Written:
    """FIRST:LAST:COUNT, or a single number, within limits."""

    def read(text: str) -> Grid:
        try:
            values = parse_grid(text)
        except UsageError as error:
            raise click.BadParameter(str(error)) from None
        if not low <= values.first <= values.last <= high:
            raise click.BadParameter(f"{text!r} leaves the range {low:g} to {high:g}")
        return values

    return Written("grid", read)


def span_at(count: int) -> Written:
    """FIRST:LAST, at so many numbers in equal ratios, or FIRST:LAST:COUNT."""

    def read(text: str) -> Any:
        if ":" not in text:
            raise click.BadParameter(f"{text!r} is no range; write FIRST:LAST, such as 0.2:2")
        return grid().read(f"{text}:{count}" if text.count(":") == 1 else text)

    return Written("FIRST:LAST", read)


def _span(text: str) -> tuple[float, float]:
    try:
        low, high = (part.strip() for part in text.split(":"))
        both = (parse_ratio(low) if low else 0.0, parse_ratio(high) if high else math.inf)
    except (ValueError, UsageError):
        raise click.BadParameter(f"{text!r} is not LOW:HIGH, such as 0.001:0.1") from None
    if not 0.0 <= both[0] < both[1]:
        raise click.BadParameter(f"{text!r}: LOW must be below HIGH, and not negative")
    return both


def _period(text: str) -> float | None:
    return (
        None
        if text.strip().upper() == "T1"
        else float(Number(0.0, min_open=True).convert(text, None, None))
    )


span = Written("LOW:HIGH", _span)
"""LOW:HIGH, two numbers or ratios; without one of them 0 or infinity."""

period = Written("T1|SECONDS", _period)
"""A period in s, or T1 for None: the first one of the building."""

drift_size = Written("drift", parse_drift)
"""A drift: a ratio, a length with its unit, or a multiple of the yield drift."""


def intensity(*quantities: str) -> Written:
    """A peak or a pseudo-acceleration with its unit: 0.6g, '5.9 m/s^2', 40cm/s."""
    example = "40cm/s" if quantities == ("velocity",) else "0.6g or '5.9 m/s^2'"

    def read(text: str) -> Units:
        try:
            units = parse_units(text)
        except UsageError:
            units = None
        if units is None or not units.has_factor or units.quantity not in quantities:
            raise click.BadParameter(f"{text!r}: write a number with its unit, such as {example}")
        return units

    return Written("value", read)


def _pair_names(text: str) -> PairNames:
    from tdint.ground_motion.horizontals import PairNames

    return PairNames.parse(text)


pair_names = Written("names", _pair_names)
"""How the files of a pair are named: two names with {}."""


class PairsType(ValueType):
    """What stands for a pair of components, how their files are named ({}_N.AT2,{}_E.AT2), or
    both."""

    name = "pairs"

    def __init__(self, measures: Sequence[str]) -> None:
        self.measures = click.Choice(measures)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from tdint.ground_motion.horizontals import USUAL, PairNames

        if not isinstance(value, str):
            return value
        measures = [part for part in value.split(",") if "{}" not in part]
        if len(measures) > 1:
            self.fail(
                f"{value!r}: one of {', '.join(self.measures.choices)}, and two names with {{}}",
                param,
                ctx,
            )
        measure = str(self.measures.convert(measures[0], param, ctx)) if measures else None
        names = (
            PairNames.parse(",".join(part for part in value.split(",") if "{}" in part))
            if "{}" in value
            else USUAL
        )
        return PairWish(measure, names)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete what stands for a pair."""
        return self.measures.shell_complete(ctx, param, incomplete)


@dataclass(frozen=True)
class PairWish:
    """What stands for a pair of components, None where nobody said, and how their files are
    named."""

    measure: str | None
    names: PairNames


class Name(ValueType):
    """A text, and the names that it completes to, if any are known; they are asked for only then,
    and may take a while to load."""

    name = "name"

    def __init__(self, names: Callable[[], Iterable[str]] = tuple) -> None:
        self.names = names

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """The names that begin so."""
        return [CompletionItem(name) for name in self.names() if name.startswith(incomplete)]


class SampleUnitsType(Name):
    """Units of the samples of all records, or by file: `AT2=g,*.mseed=m/s^2`, or a table of them,
    which is read."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from tdint.ground_motion.reading.sample_units import units_of_text

        return units_of_text(value) if isinstance(value, str) else value


ELSEWHERE: ContextVar[Callable[[str, str, bool], str] | None] = ContextVar(
    "elsewhere", default=None
)
"""Where a command that is run again writes instead, by parameter, the name that was typed, and
whether it is that of a folder; None where outputs go where they are typed."""


class FileName(ValueType):
    """The name of a file or, if `folder`, of a folder: a text that completes to what is there.

    What is not `written` is read, and so never replaced by what the command writes; `tables` are
    what its command is for.
    """

    name = "file"

    def __init__(
        self, *, folder: bool = False, written: bool = False, tables: bool = False
    ) -> None:
        self.kind = "dir" if folder else "file"
        self.written = written
        self.tables = tables

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not self.written:
            keep_input(value)
        elif (elsewhere := ELSEWHERE.get()) and value not in ("", STDIN, BESIDE):
            return elsewhere(param.name or "" if param else "", value, self.kind == "dir")
        return value

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Leave it to the shell."""
        return [CompletionItem(incomplete, type=self.kind)]


# ---- Options stand in the help of a command under headings: whose they are, not the order of
# declaration

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
    "--plot": re.compile(
        r".*\.(png|pdf|svg|jpe?g|gif|e?ps|tiff?|webp|bmp|svgz|pgf)", re.IGNORECASE | re.DOTALL
    ),
    "--history": re.compile(r".*\.csv(\.gz)?", re.IGNORECASE | re.DOTALL),
}
"""What follows such an option and names its file; pictures that cannot be are refused later, in
words."""


class HeadedOption(click.Option):
    """An option that knows its heading, without which others of the command line it has nothing to
    act on, whether it is `common`: shown by --help, too, and not by --help-all only, and whether it
    is `recorded` in the JSON files of results."""

    def __init__(
        self,
        *arguments: Any,
        heading: str,
        needs: str = "",
        rare: bool = True,
        recorded: bool = True,
        **settings: Any,
    ) -> None:
        super().__init__(*arguments, **settings)
        self.heading = heading
        self.needs = needs
        self.common = not rare
        self.recorded = recorded


if TYPE_CHECKING:

    class _Value(Any):  # type: ignore[misc]
        """In a request a declaration stands for the value that is given."""
else:
    _Value = object


@dataclass(frozen=True)
class Declaration(_Value):
    """An option or an argument: what declares it of a command, or of a field of its request
    (`request`).

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
        return together(self.declare(*self.names, **self.settings), *self.behind)(command)

    def of_field(self, name: str, kind: str) -> Declaration:
        """The same for a field of a request, which names what has no name, and is what the command
        gets it as; one of the kind `bool` is given by a flag."""
        flags = [flag for flag in self.names if flag.startswith("-")]
        if not flags and self.declare is click.option:
            flags = [f"--{name.replace('_', '-')}"]
        settings = self.settings | ({"is_flag": True} if kind == "bool" else {})
        return replace(self, names=(*flags, name), settings=settings)


def option(
    *names: str,
    heading: str = OWN,
    rare: bool = False,
    needs: str = "",
    recorded: bool = True,
    behind: Sequence[Callable[[Any], Any]] = (),
    **settings: Any,
) -> Declaration:
    """As `click.option`, under a heading.

    `rare`: most people never type it, so that it stands in `--help-all` alone; `COMMAND --help`
    shows all others, with the first clauses of their help. A command has at most `COMMON` of these,
    and its help at most `LINES` lines: what is declared once for many commands is shown by all of
    them.

    `needs`: what it acts on, as in `--history`, `--ductility or --strength`, `--im sa or sa-avg`:
    an option, one of several, or one with one of these values, its default among them. Given alone
    the option is refused.

    `recorded`: the JSON file of a result records the option, and `tdint rerun` accepts it. An
    option that specifies where or how a command runs, and on which no result depends, is not
    recorded: the author of a JSON file must not choose it for others.
    """
    kind = settings.get("type")
    if type(kind) is ListOf:
        settings |= {"multiple": True, "callback": kind.joined}
    settings |= {"cls": HeadedOption, "heading": heading, "needs": needs, "rare": rare}
    settings |= {"recorded": recorded}
    return Declaration(click.option, names, settings, behind)


def argument(metavar: str, **settings: Any) -> Declaration:
    """As `click.argument`, of a field of a request."""
    return Declaration(click.argument, (), settings | {"metavar": metavar})


@dataclass_transform(frozen_default=True, kw_only_default=True)
def request(kind: type[Kind]) -> type[Kind]:
    """A command line as a frozen dataclass: a field whose default is an option is given by it
    (`of`), in the order of the fields, others by what else the command has."""
    declared = {name: value for name, value in vars(kind).items() if isinstance(value, Declaration)}
    for name in declared:
        delattr(kind, name)
    made = dataclass(frozen=True, kw_only=True)(kind)
    _OPTIONS[made] = tuple(
        value.of_field(name, kind.__annotations__[name]) for name, value in declared.items()
    )
    return made


def of(kind: type[Any], among: str = "") -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The options that are declared in a request, not in those it is derived from; the command gets
    the request, or among others by a name."""

    def declared(command: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(command)
        def collected(**given: Any) -> Any:
            if not among:
                return command(kind(**given))
            own_values = {part.name: given.pop(part.name) for part in fields(kind)}
            return command(**given, **{among: kind(**own_values)})

        return together(*_OPTIONS[kind])(collected)

    return declared


def together(*declarations: Callable[[Any], Any]) -> Callable[[Function], Function]:
    """Options, in their order, as one declaration."""

    def declared(command: Function) -> Function:
        for declaration in reversed(declarations):
            command = declaration(command)
        return command

    return declared


def with_named_files(
    arguments: Sequence[str], options: Collection[str] = tuple(_NAMES)
) -> list[str]:
    """A command line in which every option of these has its value: the next word if that is such a
    name or empty."""
    result: list[str] = []
    words = iter(enumerate(arguments))
    # As click does, nothing behind -- is an option.
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


def recorded_words(command: click.Command, words: Sequence[str]) -> tuple[str, ...]:
    """Return the words of a command line without the options that are not recorded.

    Parameters
    ----------
    command : Command
        The command, whose options declare whether they are recorded.
    words : sequence of str
        The command line after the name of the command.
    """
    unrecorded = {
        name: item
        for item in command.params
        if isinstance(item, click.Option) and not is_recorded(item)
        for name in item.opts
    }
    letters = "".join(name[1] for name in unrecorded if not name.startswith("--"))
    result: list[str] = []
    remaining = iter(words)
    for word in remaining:
        if word == "--":
            return (*result, word, *remaining)
        item = unrecorded.get(word.partition("=")[0])
        if item is None:
            # Flags of one letter may precede another option in the same word: -qo DIR.
            if word[:1] == "-" and word[1:2] and word[1:2] in letters:
                word = f"-{word[1:].lstrip(letters)}"
                result += [word] if word != "-" else []
            else:
                result.append(word)
        elif not item.is_flag and "=" not in word:
            next(remaining, None)
    return tuple(result)


def is_recorded(option: click.Parameter) -> bool:
    """Return True if an option is declared as recorded in the JSON files of results."""
    return isinstance(option, HeadedOption) and option.recorded


def shown_when_asked(
    text: Callable[[click.Context], str],
) -> Callable[[click.Context, click.Parameter, bool], None]:
    """The callback of a flag in place of the command: a text goes where data go, and the command
    exits."""

    def show(ctx: click.Context, _: click.Parameter, is_asked: bool) -> None:
        if is_asked and not ctx.resilient_parsing:
            emit(f"{text(ctx)}\n".encode("utf-8", "replace"))
            ctx.exit()

    return show


class HelpAsData(click.Command):
    """A command whose help goes where its data go, with the same errors; its options stand under
    headings."""

    def get_help_option(self, ctx: click.Context) -> click.Option | None:
        option = super().get_help_option(ctx)
        if option is not None:
            option.callback = shown_when_asked(click.Context.get_help)
        return option

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the help of the options, a section for each heading."""
        sections: dict[str, list[tuple[str, str]]] = {heading: [] for heading in ORDER}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx) if isinstance(parameter, click.Option) else None
            if record is not None:
                sections[getattr(parameter, "heading", GENERAL)].append(record)
        for heading, records in sections.items():
            if records:
                with formatter.section(heading):
                    formatter.write_dl(records)


COMMON, LINES = 20, 50
"""Of `COMMAND --help`: so many options and, on 80 columns, lines at most. It is read on one
screen."""


class Command(HelpAsData):
    """A command with help in two levels and the options that every command has.

    `--help` shows the first two sentences of its function's docstring, `examples`, the options that
    are not `rare` and `exits`, what an exit code means here; `--help-all` the whole docstring and
    all options under their headings.
    """

    def __init__(
        self,
        name: str | None,
        examples: Sequence[str] = (),
        exits: Mapping[int, str] | None = None,
        **settings: Any,
    ) -> None:
        text = "Show all options, and what the command does in detail, and exit."
        all_help = flag(["--help-all"], shown_when_asked(self.all_help), text)
        settings["params"] = [*(settings.get("params") or ()), *general(), all_help]
        super().__init__(name, **settings)
        self.examples = examples
        self.exits = exits or {}

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write what most people ask for, on one screen."""
        self.format_usage(ctx, formatter)
        with formatter.indentation():
            formatter.write_paragraph()
            formatter.write_text(" ".join(_SENTENCE.split(" ".join((self.help or "").split()))[:2]))
        with formatter.section("Examples"):
            formatter.write("".join(f"  {example}\n" for example in self.examples))
        # Of each option the beginning of its help, which is enough to remember it by
        common = [option for option in self.params if getattr(option, "common", False)]
        brief: list[tuple[str, str]] = []
        for option in sorted(
            common, key=lambda option: ORDER.index(getattr(option, "heading", GENERAL))
        ):
            record = option.get_help_record(ctx)
            assert record is not None and isinstance(option, click.Option)
            text, *more = _CLAUSE.split(option.help or "")
            for clause in more:
                if len(text) + len(clause) > _ENOUGH:
                    break
                text += f" {clause}"
            brief.append((record[0], text if text.endswith(".") else f"{text.rstrip(';')}."))
        with formatter.section("Options"):
            formatter.write_dl(brief, col_max=_OPTION_WIDTH)
        if self.exits:
            with formatter.section("Exit codes"):
                formatter.write_dl([(str(code), meaning) for code, meaning in self.exits.items()])
        with formatter.indentation():
            formatter.write_paragraph()
            formatter.write_text(
                f"All options, and more of what it does: {ctx.command_path} --help-all"
            )

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does, after `--plot` and the like have got their values; refuse what has nothing
        to act on."""
        flags = {name for parameter in self.params for name in parameter.opts}
        # An option behind one that needs a value would be taken for the value.
        valued = {
            name
            for item in self.params
            if isinstance(item, click.Option) and not item.is_flag
            for name in item.opts
        }
        typed = takewhile(lambda pair: pair[0] != "--", pairwise(args))
        for word, following in typed:
            if word in valued and word not in _NAMES and following in flags:
                raise UsageError(f"{word} needs a value, and {following} is an option")
        try:
            rest = super().parse_args(ctx, with_named_files(args, flags))
        except click.NoSuchOption as error:
            now, example = _FORMER.get(error.option_name, ("", ""))
            if now not in flags:
                raise
            raise UsageError(f"{error.option_name} is now {now}: {now} {example}") from None
        if ctx.resilient_parsing:
            return rest
        # An option without what it needs would be passed over in silence.
        named = {
            name: item
            for item in self.params
            for name in (*item.opts, (item.metavar or "").strip("[]."))
        }
        for option in self.params:
            needs = getattr(option, "needs", "")
            if not needs or not _is_given(ctx, option):
                continue
            words = needs.split(" or ")
            needed, _, value = words[0].partition(" ")
            if value:
                is_met = ctx.params[named[needed].name or ""] in (value, *words[1:])
            else:
                is_met = any(_is_given(ctx, named[word]) for word in words)
            if not is_met:
                name = option.opts[-1]
                raise UsageError(
                    f"{name} has nothing to act on without {needs}; add it, or leave {name} out"
                )
        return rest

    def all_help(self, ctx: click.Context) -> str:
        """All that there is to say, the options in a section for each heading."""
        formatter = ctx.make_formatter()
        super().format_help(ctx, formatter)
        return formatter.getvalue().rstrip("\n")


_FORMER = {
    "--drift-limit": ("--limit", "2%"),
    "--figure-width": ("--style", "90mm"),
    "--font": ("--style", "\"font='Times New Roman'\""),
    "--label": ("--style", "'label:moment4=present method'"),
    "--no-title": ("--style", "title=no"),
}
"""Options that went, what does their work and with which value, for those who type them from
memory."""

_SENTENCE = re.compile(r"(?<=[.])\s+(?=[A-Z`-])")
_CLAUSE = re.compile(r"(?<=[;.])\s+(?![^(]*\))")
_ENOUGH = 90
"""Letters of an option's help to which another clause or sentence is still added: two lines beside
its name."""

_OPTION_WIDTH = 22
"""Characters; a longer option has a line of its own in --help, so that texts have wide columns."""


def _is_given(ctx: click.Context, parameter: click.Parameter) -> bool:
    # To click before 8.2 an argument of any number of values, given none, comes from the command
    # line, too.
    name = parameter.name or ""
    return (
        ctx.get_parameter_source(name) == ParameterSource.COMMANDLINE and ctx.params.get(name) != ()
    )


@dataclass(frozen=True)
class Mode:
    """A way in which a command is used.

    Attributes
    ----------
    words : str
        What refusals call it, as in "--period has nothing to act on with --fourier".
    takes : frozenset of str
        Its options, by the names of their parameters, of those that not every mode takes.
    advice : mapping of str to str
        What else to do with some that it does not take; the others are to be left out.
    """

    words: str
    takes: frozenset[str] = frozenset()
    advice: Mapping[str, str] = field(default_factory=dict)


def refuse_idle(mode: Mode, modes: Iterable[Mode]) -> None:
    """Raise UsageError for an option that was given and has nothing to act on in this mode of the
    command that runs."""
    context = click.get_current_context()
    idle = frozenset[str]().union(*(other.takes for other in modes)) - mode.takes
    for parameter in context.command.params:
        if parameter.name not in idle or not _is_given(context, parameter):
            continue
        name = (
            parameter.opts[-1]
            if isinstance(parameter, click.Option)
            else (parameter.metavar or "").strip("[].")
        )
        if parameter.secondary_opts and not context.params[parameter.name]:
            name = parameter.secondary_opts[-1]  # --no-cache
        advice = mode.advice.get(parameter.name, f"leave {name} out")
        raise UsageError(f"{name} has nothing to act on {mode.words}; {advice}")


def command(
    name: str, *examples: str, exits: Mapping[int, str] | None = None
) -> Callable[[Callable[..., Any]], Command]:
    """Make a function a command of this name; two `examples` that run beside what `tdint init
    office.yaml` writes, and the `exits` that mean something special."""
    return click.command(name, cls=Command, examples=examples, exits=exits)


def general() -> list[click.Parameter]:
    """The options that every command has."""
    return [
        _setting(
            ["-q", "--quiet"],
            "quiet",
            "Say nothing but warnings that change what a number means, and errors.",
        ),
        _setting(["--debug"], "debug", "Show a traceback with an error."),
    ]


def _setting(names: list[str], field: str, text: str) -> HeadedOption:
    """A flag that sets a field of the settings, before or after the command's name."""

    def switch(ctx: click.Context, _: click.Parameter, is_asked: bool) -> None:
        if is_asked:
            setattr(ctx.ensure_object(Settings), field, True)

    return flag(names, switch, text)


def flag(
    names: list[str], callback: Callable[[click.Context, click.Parameter, bool], None], text: str
) -> HeadedOption:
    """A flag of all commands, or of none, whose value nobody gets."""
    return HeadedOption(
        names,
        heading=GENERAL,
        recorded=False,
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=callback,
        help=text,
    )
