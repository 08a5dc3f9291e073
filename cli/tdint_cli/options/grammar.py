"""Declaration and help of options."""

from __future__ import annotations

import csv
import functools
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from itertools import pairwise, takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast, dataclass_transform

import click
from click.core import ParameterSource

from tdint.errors import UsageError
from tdint_cli.options.option_types import ListOf, argument_name, named_type
from tdint_cli.terminal import Settings, emit

# The help of a command lists options under headings, which do not depend on the order of
# declaration.

Function = TypeVar("Function", bound=Callable[..., Any])
RequestT = TypeVar("RequestT")

_OPTIONS: dict[type[Any], Sequence[Callable[[Any], Any]]] = {}
"""Declared options of each request class."""

OWN, RECORD, SPECTRUM, INTENSITY = "Options", "Record", "Spectrum", "Intensity"
ANALYSIS, OUTPUT, GENERAL = "Analysis", "Output", "General"
ORDER = (OWN, RECORD, SPECTRUM, INTENSITY, ANALYSIS, OUTPUT, GENERAL)
"""The headings in the order of the help; `OWN` is for options specific to one command."""

_NAMED_FILES = {
    "--plot": r"(?is).*\.(png|pdf|svg|jpe?g|gif|e?ps|tiff?|webp|bmp|svgz|pgf)",
    "--history": r"(?is).*\.csv(\.gz)?",
}
"""Patterns of the file names that may follow these options. Figure formats that are not supported
are included, because a later check refuses them with a message."""


@cache
def _removed_options() -> dict[tuple[str, str], str]:
    """Return the other way for each removed option, by command and option (removed.csv).

    Version 0.3.0 removes this function and the file.
    """
    from tdint.files import declared_rows  # not needed by a valid command line

    return {
        (command, row["option"]): row["instead"]
        for row in declared_rows(str(Path(__file__).with_name("removed.csv")))
        for command in row["commands"].split()
    }


class HeadedOption(click.Option):
    """An option with a heading in the help.

    Attributes
    ----------
    heading : str
        The heading, an item of `ORDER`.
    needs : str
        Options that the option requires; empty if it requires no other option.
    common : bool
        True if --help shows the option; otherwise only --help-all shows it.
    recorded : bool
        True if the JSON files of results record the option.
    """

    def __init__(
        self,
        *arguments: Any,
        heading: str = OWN,
        needs: str = "",
        rare: bool = True,
        recorded: bool = True,
        **settings: Any,
    ) -> None:
        """Create an option with the attributes of the class; `rare` is the opposite of `common`.

        The remaining arguments are arguments of `click.Option`.
        """
        super().__init__(*arguments, **settings)
        self.heading = heading
        self.needs = needs
        self.common = not rare
        self.recorded = recorded


if TYPE_CHECKING:

    class _Value(Any):  # type: ignore[misc]
        """For type checkers, a declaration in a request has the type of the value of its field."""
else:
    _Value = object


@dataclass(frozen=True)
class Declaration(_Value):
    """Declaration of an option or an argument, for a command or for a field of a `request`.

    Attributes
    ----------
    declare : callable
        `click.option` or `click.argument`.
    names : tuple of str
        Names for click; they may be omitted in a request.
    behind : sequence of callable
        Declarations of further options that follow this option in the help, and that have no field
        in the request.
    """

    declare: Any
    names: tuple[str, ...]
    settings: dict[str, Any]
    behind: Sequence[Callable[[Any], Any]] = ()

    def __call__(self, command: Function) -> Function:
        """Add the option to the function of a command; a declaration is used as a decorator."""
        settings = self.settings
        if self.declare is click.option:
            name = [word for word in self.names if word.startswith("-")][-1].partition("/")[0]
            listed = listed_settings(_command_name(command), name)
            settings = {"cls": HeadedOption} | listed | settings
            value_type = settings.get("type")
            # Subclasses of ListOf are options that are not repeated.
            if type(value_type) is ListOf:
                settings = {"multiple": True, "callback": value_type.joined} | settings
            # In the help, brackets enclose the parts that may be omitted. One of several values
            # must be given.
            if isinstance(value_type, click.Choice):
                settings = {"metavar": "|".join(map(str, value_type.choices))} | settings
        return together(self.declare(*self.names, **settings), *self.behind)(command)

    def for_field(self, name: str, annotation: str) -> Declaration:
        """Return the declaration for a field of a request.

        Parameters
        ----------
        name : str
            Name of the field. It is also the name of the option if the option has no other name.
        annotation : str
            Type annotation of the field; options of type `bool` are flags.
        """
        option_names = [option_name for option_name in self.names if option_name.startswith("-")]
        if not option_names and self.declare is click.option:
            option_names = [f"--{name.replace('_', '-')}"]
        settings = self.settings | ({"is_flag": True} if annotation == "bool" else {})
        return replace(self, names=(*option_names, name), settings=settings)


def option(
    *names: str, behind: Sequence[Callable[[Any], Any]] = (), **settings: Any
) -> Declaration:
    """Declare an option as `click.option` does. Its other settings are in `options.csv`
    (`listed_settings`); an argument replaces the setting in the table."""
    return Declaration(click.option, names, settings, behind)


def _command_name(function: Callable[..., Any]) -> str:
    """Return the name of the command that a function defines, which is the name of its module."""
    return function.__module__.rpartition(".")[2].replace("_", "-")


def _rows_of(name: str) -> list[dict[str, str]]:
    """Return the rows of a table in the directory of this module."""
    with Path(__file__).with_name(name).open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@cache
def listed_commands() -> dict[str, dict[str, str]]:
    """Return the rows of `commands.csv` by command: its group in the help, the package of its
    module, the first sentence of its help, two examples, which run in a directory with the files
    that `tdint init office.yaml` writes, and exit codes with a special meaning."""
    return {row["command"]: row for row in _rows_of("commands.csv")}


@cache
def _rows() -> dict[tuple[str, str], dict[str, str]]:
    """Return the rows of `options.csv` by command (empty: every other command) and option."""
    return {
        (command, row["option"]): row
        for row in _rows_of("options.csv")
        for command in row["commands"].split(" ")
    }


def listed_settings(command: str, option: str) -> dict[str, Any]:
    """Return the settings of an option that `options.csv` contains: a row for a command replaces
    the row for all commands, but an empty help means the same text.

    The columns are the heading in the help; `level`, which is `rare` for an option that most users
    never need, so that only `--help-all` shows it (a command has at most `COMMON` other options);
    the type of the values (`named_type`) and their name in the help; `needs`, the options that the
    option requires; and `recorded`, which is `no` if the JSON files of results do not record the
    option, because it specifies where or how a command runs.

    `needs` is an option (`--history`), one of several options (`--ductility or --strength`), or an
    option with one of several values (`--im sa or sa-avg`), which its default value also fulfills.
    Without these options, the option is refused.
    """
    general = _rows().get(("", option), {})
    row = _rows().get((command, option), general)
    settings: dict[str, Any] = {
        name: row[name] for name in ("heading", "metavar", "needs") if row.get(name)
    }
    if text := row.get("help") or general.get("help"):
        settings["help"] = text
    if type_name := row.get("type"):
        settings["type"] = named_type(type_name)
    return settings | {
        "rare": row.get("level") == "rare",
        "recorded": row.get("recorded") != "no",
    }


def argument(metavar: str, **settings: Any) -> Declaration:
    """Declare an argument as `click.argument` does, for a field of a request.

    Parameters
    ----------
    metavar : str
        Name of the argument in the help text.
    """
    return Declaration(click.argument, (), settings | {"metavar": metavar})


@dataclass_transform(frozen_default=True, kw_only_default=True)
def request(request_class: type[RequestT]) -> type[RequestT]:
    """Convert a class to a frozen dataclass that contains the values of a command line.

    A field whose default is the declaration of an option receives the value of this option. The
    decorator `of` adds these options to a command, in the order of the fields. Fields without such
    a default are filled by other declarations of the command.
    """
    declarations = {
        name: value for name, value in vars(request_class).items() if isinstance(value, Declaration)
    }
    # A declaration must not become the default value of the field.
    for name in declarations:
        delattr(request_class, name)
    frozen_class = dataclass(frozen=True, eq=False, repr=False, kw_only=True)(request_class)
    _OPTIONS[frozen_class] = tuple(
        declaration.for_field(name, request_class.__annotations__[name])
        for name, declaration in declarations.items()
    )
    return frozen_class


def adapted(adapt: Callable[[dict[str, Any]], dict[str, Any]]) -> Callable[[Function], Function]:
    """Return a decorator that adapts the values of the options before the command receives them.

    Parameters
    ----------
    adapt : callable
        Returns the arguments of the command for the values of its options, both by name.
    """

    def decorate(command: Function) -> Function:
        """Return the command that receives the adapted values."""

        @functools.wraps(command)
        def call_with_adapted_values(**values: Any) -> Any:
            return command(**adapt(values))

        return cast("Function", call_with_adapted_values)

    return decorate


def of(
    request_class: type[Any], argument: str = "request"
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that adds the options of a request class to a command.

    Options that are declared in base classes of the request are not added; other decorators of the
    command add them.

    Parameters
    ----------
    request_class : type
        Class that was decorated with `request`.
    argument : str
        Argument of the command for the request; other arguments are unchanged.
    """

    def gather(values: dict[str, Any]) -> dict[str, Any]:
        """Replace the values of the fields of the request by the request."""
        names = [item.name for item in fields(request_class) if item.name in values]
        request = request_class(**{name: values.pop(name) for name in names})
        return {**values, argument: request}

    return together(*_OPTIONS[request_class], adapted(gather))


def together(*declarations: Callable[[Any], Any]) -> Callable[[Function], Function]:
    """Return a decorator that adds several options to a command, in the order of `declarations`."""

    def decorate(command: Function) -> Function:
        """Return the command with all options."""
        # Python applies decorators from the last to the first, and click lists them in the order of
        # the source.
        for declaration in reversed(declarations):
            command = declaration(command)
        return command

    return decorate


_FILE = r"(?is)-|.*[/\\].*|.*\.[a-z]\w*"
"""Pattern of words that are files rather than values of options: `-`, `frame.yaml`."""


def with_values(arguments: Sequence[str], defaults: Mapping[str, str]) -> list[str]:
    """Return a command line (words after the name of the command) where options with an optional
    value have their value in the same word, because click would use a following file as the value.

    The value of `--plot` and `--history` is the next word if it is empty or a file name with a
    suffix that fits the option, otherwise the default value: `--plot` becomes `--plot=VALUE`. Other
    options have their default value only if the next word is a file: `--transfer frame.yaml`
    becomes `--transfer=ground frame.yaml`. `defaults` contains the default values by option.
    """
    result: list[str] = []
    remaining = iter(enumerate(arguments))
    # As in click, words after -- are not options.
    for i, word in remaining:
        if word == "--":
            return [*result, *arguments[i:]]
        following = arguments[i + 1] if i + 1 < len(arguments) else None
        pattern = _NAMED_FILES.get(word)
        if word not in defaults:
            result.append(word)
        elif (
            following is not None
            and pattern
            and (not following or re.fullmatch(pattern, following))
        ):
            next(remaining)
            result.append(f"{word}={following}")
        elif pattern or (following is not None and re.fullmatch(_FILE, following)):
            result.append(f"{word}={defaults[word]}")
        else:
            result.append(word)
    return result


def recorded_words(command: click.Command, arguments: Sequence[str]) -> tuple[str, ...]:
    """Return the words of a command line without the options that are not recorded.

    Parameters
    ----------
    command : Command
        The command, whose options declare whether they are recorded.
    arguments : sequence of str
        The command line after the name of the command.
    """
    unrecorded = {
        name: not parameter.is_flag
        for parameter in command.params
        if isinstance(parameter, click.Option) and not getattr(parameter, "recorded", False)
        for name in parameter.opts
    }
    return tuple(_split_options(arguments, unrecorded)[1])


def shown_when_asked(
    text: Callable[[click.Context], str],
) -> Callable[[click.Context, click.Parameter, bool], None]:
    """Return the callback of a flag that writes a text to standard output and ends the program.

    The command is not run. `text` is a function that returns the text for the context of the
    command.
    """

    def show(ctx: click.Context, _: click.Parameter, is_set: bool) -> None:
        """Write the text and exit if the flag is set."""
        # During the completion of a command line, no output is written.
        if is_set and not ctx.resilient_parsing:
            emit(f"{text(ctx)}\n".encode("utf-8", "replace"))
            ctx.exit()

    return show


class HelpAsData(click.Command):
    """A command with options under headings.

    The help is written to standard output as data are, so that a closed pipe or a full disk has the
    same effect.
    """

    def get_help_option(self, ctx: click.Context) -> click.Option | None:
        """Return the option --help of click, with a callback that writes the help as data."""
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
"""Maximum number of options, and of lines on 80 columns, of `COMMAND --help`, so that it fits on
one screen."""


class Command(HelpAsData):
    """A command with help in two levels and the options that every command has.

    `--help` shows the first two sentences of the docstring of the function, `examples`, the options
    that are not `rare`, and `exits`, the meanings of exit codes of the command. `--help-all` shows
    the complete docstring and all options under their headings.

    Parameters
    ----------
    examples : sequence of str
        Command lines for the help.
    exits : mapping of str to str, optional
        Meanings of exit codes with a special meaning in this command.
    """

    def __init__(
        self,
        name: str | None,
        examples: Sequence[str] = (),
        exits: Mapping[str, str] | None = None,
        **settings: Any,
    ) -> None:
        text = "Show all options and a detailed description of the command, and exit."
        all_help = flag(["--help-all"], shown_when_asked(self.all_help), text)
        settings["params"] = [*(settings.get("params") or ()), *general(), all_help]
        super().__init__(name, **settings)
        self.examples = examples
        self.exits = exits or {}

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the short help: the most common options, on one screen."""
        self.format_usage(ctx, formatter)
        with formatter.indentation():
            formatter.write_paragraph()
            formatter.write_text(
                " ".join(re.split(_SENTENCE, " ".join((self.help or "").split()))[:2])
            )
        with formatter.section("Examples"):
            formatter.write("".join(f"  {example}\n" for example in self.examples))
        if rows := self._short_option_help(ctx):
            with formatter.section("Options"):
                formatter.write_dl(rows, col_max=_OPTION_WIDTH)
        if self.exits:
            with formatter.section("Exit codes"):
                formatter.write_dl([*self.exits.items()])
        with formatter.indentation():
            formatter.write_paragraph()
            formatter.write_text(
                f"All options and a detailed description: {ctx.command_path} --help-all"
            )

    def _short_option_help(self, ctx: click.Context) -> list[tuple[str, str]]:
        """Return the names of each option that --help shows, and the first clauses of its help."""
        common = [option for option in self.params if getattr(option, "common", False)]
        common.sort(key=lambda option: ORDER.index(getattr(option, "heading", GENERAL)))
        lines: list[tuple[str, str]] = []
        for option in common:
            names_and_help = option.get_help_record(ctx)
            assert names_and_help is not None and isinstance(option, click.Option)
            text, *more_clauses = re.split(_CLAUSE, option.help or "")
            for clause in more_clauses:
                if len(text) + len(clause) > _MAX_SHORT_HELP:
                    break
                text += f" {clause}"
            text = text if text.endswith(".") else f"{text.rstrip(';')}."
            lines.append((names_and_help[0], text))
        return lines

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the command line (words after the name of the command) with click, and refuse
        options without an effect. Return the words that belong to no parameter.

        Raises
        ------
        UsageError
            An option has no value, was replaced by another option, or has no effect.
        """
        option_names = {name for parameter in self.params for name in parameter.opts}
        # Click would use an option as the value of the preceding option that requires a value.
        for word, next_word in takewhile(lambda pair: pair[0] != "--", pairwise(args)):
            if word in self._valued_options() and next_word in option_names:
                raise UsageError(f"{word} requires a value, but {next_word} is an option")
        args = with_values(args, self._default_values())
        if "--to" in option_names:
            args = _with_measures(args)
        try:
            remaining = super().parse_args(ctx, [*args])  # click removes the words that it parses
        except click.NoSuchOption as error:
            if instead := _removed_options().get((str(ctx.info_name), error.option_name)):
                option = f"{error.option_name} of {ctx.info_name}"
                raise UsageError(f"{option} was removed in 0.2.0; {instead}") from None
            if error.option_name in DESCRIBED_OPTIONS and "--inventory" in option_names:
                raise UsageError(self._described_line(ctx, args, error.option_name)) from None
            raise
        if not ctx.resilient_parsing:
            self._check_needs(ctx)
        return remaining

    def _described_line(self, ctx: click.Context, args: Sequence[str], option: str) -> str:
        """Return the error for an option of the layout or the processing of records in a command
        without such options, with the two command lines that replace it."""
        moved, rest = _split_options(args, DESCRIBED_OPTIONS)
        reading, _ = _split_options(
            args, dict.fromkeys(("--units", "--component", "--inventory"), True)
        )
        ctx.resilient_parsing = True  # no callbacks, no missing arguments
        super().parse_args(ctx, with_values(rest, self._default_values()))
        records = ctx.params.get("records") or ()
        replaced = [word for word in rest if word not in (*records, *reading)]
        first = next((i for i, word in enumerate(rest) if word in records), 0)
        replaced.insert(min(first, len(replaced)), DESCRIPTION)
        described = shlex.join(
            ["tdint", "info", *records, *moved, *reading, "--export", DESCRIPTION]
        )
        return (
            f"{option} is an option of run, info, spectrum and chart; describe the records once: "
            f"{described}, then: {shlex.join(['tdint', str(ctx.info_name), *replaced])}"
        )

    def _default_values(self) -> dict[str, str]:
        """Return the default values of the options with an optional value."""
        return {
            name: parameter.flag_value
            for parameter in self.params
            if isinstance(parameter, click.Option) and isinstance(parameter.flag_value, str)
            for name in parameter.opts
            if not parameter.is_flag
        }

    def _valued_options(self) -> set[str]:
        """Return the names of the options that require a value."""
        options = [
            item for item in self.params if isinstance(item, click.Option) and not item.is_flag
        ]
        return {name for item in options for name in item.opts} - self._default_values().keys()

    def _check_needs(self, ctx: click.Context) -> None:
        """Raise UsageError for an option that would have no effect without another option.

        The attribute `needs` of an option names the options that it requires, each with its values
        if only these have the effect: `--target or --to sa or sa-avg`.
        """
        # `needs` names an option by any of its names, and an argument by its name in the help.
        parameters: dict[str, click.Parameter] = {}
        for parameter in self.params:
            parameters |= dict.fromkeys((*parameter.opts, argument_name(parameter)), parameter)
        for option in self.params:
            needs = getattr(option, "needs", "")
            if not needs or not _is_given(ctx, option):
                continue
            if not _is_met(ctx, parameters, needs):
                name = option.opts[-1]
                raise UsageError(
                    f"{name} has no effect without {needs}; add {needs}, or omit {name}"
                )

    def all_help(self, ctx: click.Context) -> str:
        """Return the complete help, with the options in a section for each heading."""
        formatter = ctx.make_formatter()
        super().format_help(ctx, formatter)
        return formatter.getvalue().rstrip("\n")


def _is_met(ctx: click.Context, parameters: Mapping[str, click.Parameter], needs: str) -> bool:
    """Return True if one of the options that `needs` names is given, with one of its values."""
    name = ""
    for alternative in re.split(", | or ", needs):
        if alternative in parameters:
            is_met = _is_given(ctx, parameters[alternative])
        else:
            option, _, value = alternative.rpartition(" ")
            name = option or name
            actual = ctx.params[parameters[name].name or ""]
            # An option of a measure with its value has the name of the measure first.
            is_met = value == (actual[0] if isinstance(actual, tuple) and actual else actual)
        if is_met:
            return True
    return False


DESCRIPTION = "records.yaml"
"""Name of a description of records in messages."""


DESCRIBED_OPTIONS = {
    "--step": True,
    "--column": True,
    "--skip-lines": True,
    "--rows": False,
    "--one-sided": False,
    "--trim": True,
    "--baseline": True,
    "--pad": True,
    "--highpass": True,
    "--lowpass": True,
    "--filter-order": True,
    "--resample": True,
    "--time-scale": True,
}
"""Options of the layout and the processing of records, with True if they have a value. Commands
without these options take both from a description of records."""


def _split_options(args: Sequence[str], options: Mapping[str, bool]) -> tuple[list[str], list[str]]:
    """Return the words of some options, with their values, and the other words of a command line;
    `options` is True for an option with a value."""
    selected: list[str] = []
    others: list[str] = []
    # `letters` contains the letter of each short name, such as q for -q.
    letters = "".join(name[1] for name in options if not name.startswith("--"))
    words = iter(args)
    for word in words:
        if word == "--":
            return selected, [*others, word, *words]
        name, equals, _ = word.partition("=")
        if name in options:
            selected.append(word)
            if options[name] and not equals:
                selected.append(next(words, ""))
        # Flags of a single letter may precede another option in the same word: -qo DIR.
        elif word[:1] == "-" and word[1:2] and word[1:2] in letters:
            others += [f"-{rest}"] if (rest := word[1:].lstrip(letters)) else []
        else:
            others.append(word)
    return selected, others


_MEASURES = ("--sa", "--sa-avg", "--pga", "--pgv", "--arias", "--cav")


def _with_measures(args: Sequence[str]) -> list[str]:
    """Return a command line with --to MEASURE=VALUE in place of the former options --pga VALUE and
    similar, which remain valid."""
    result: list[str] = []
    words = iter(args)
    for word in words:
        name, equals, value = word.partition("=")
        if name in _MEASURES:
            value = value if equals else next(words, "")
            result += ["--to", f"{name.removeprefix('--')}={value}"]
        else:
            result.append(word)
    return result


# The short help contains the first sentences of a docstring and the first clauses of the help of an
# option. A clause ends with a semicolon or a period outside of parentheses.
_SENTENCE = r"(?<=[.])\s+(?=[A-Z`-])"
_CLAUSE = r"(?<=[;.])\s+(?![^(]*\))"
_MAX_SHORT_HELP = 90
"""Maximum length, in characters, of the help of an option in --help: two lines next to its name."""

_OPTION_WIDTH = 22
"""Width of the column of option names in --help, characters; a longer name has a separate line, so
that the column of texts is wide."""


def _is_given(ctx: click.Context, parameter: click.Parameter) -> bool:
    """Return True if the command line specifies a value of the parameter."""
    # Click before 8.2 reports the command line as the source of an argument without values.
    name = parameter.name or ""
    return (
        ctx.get_parameter_source(name) == ParameterSource.COMMANDLINE and ctx.params.get(name) != ()
    )


@dataclass(frozen=True)
class Mode:
    """A mode of a command, such as Fourier spectra of `tdint spectrum`.

    Attributes
    ----------
    label : str
        Name of the mode in messages, as in "--period has no effect with --fourier".
    takes : frozenset of str
        Parameter names of the options that the mode supports and that some other mode does not.
    advice : mapping of str to str
        Remedies for options that the mode does not support; by default, to omit the option.
    """

    label: str
    takes: frozenset[str] = frozenset()
    advice: Mapping[str, str] = field(default_factory=dict)


READING = frozenset(("units", "component", "inventory")) | {
    flag.removeprefix("--").replace("-", "_") for flag in DESCRIBED_OPTIONS
}
"""Names of the parameters by which a record is read and processed, without the scale factor."""


def modes_of(command: str) -> dict[str, Mode]:
    """Return the modes of a command by their names, from `modes.csv`: `takes` contains parameter
    names, and `reading` for the parameters of `READING`."""
    modes = {}
    for row in _rows_of("modes.csv"):
        if row["command"] == command:
            names = frozenset(row["takes"].split())
            takes = names - {"reading"} | READING if "reading" in names else names
            advice = dict(text.split(": ", 1) for text in row["advice"].split(" | ") if text)
            modes[row["mode"]] = Mode(row["label"], takes, advice)
    return modes


def refuse_idle(name: str) -> None:
    """Raise UsageError if the command line has an option without an effect in a mode of its
    command, an entry of `modes_of`."""
    context = click.get_current_context()
    modes = modes_of(context.command.name or "")
    mode = modes[name]
    # An option that is listed for no mode has an effect in all modes, so that only options of other
    # modes are refused.
    without_effect = frozenset[str]().union(*(other.takes for other in modes.values())) - mode.takes
    for parameter in context.command.params:
        if parameter.name not in without_effect or not _is_given(context, parameter):
            continue
        if isinstance(parameter, click.Option):
            option = parameter.opts[-1]
        else:
            option = argument_name(parameter)
        # If a flag with two names, such as --cache/--no-cache, is False, its second name was typed.
        if parameter.secondary_opts and not context.params[parameter.name]:
            option = parameter.secondary_opts[-1]
        advice = mode.advice.get(parameter.name, f"omit {option}")
        raise UsageError(f"{option} has no effect {mode.label}; {advice}")


def command(function: Callable[..., Any]) -> Command:
    """Return the command of `tdint` that a function of its module defines, with the examples and
    the exit codes in `commands.csv`."""
    name = _command_name(function)
    row = listed_commands()[name]
    exits = dict(text.split(" ", 1) for text in row["exits"].split(" | ") if text)
    examples = (row["example_1"], row["example_2"])
    return click.command(name, cls=Command, examples=examples, exits=exits)(function)


def general() -> list[click.Parameter]:
    """Return the options of every command, --quiet and --debug."""
    return [
        _setting(["-q", "--quiet"], "quiet", "Print only errors and warnings that affect results."),
        _setting(["--debug"], "debug", "Show tracebacks and step times."),
    ]


def _setting(names: list[str], field: str, text: str) -> HeadedOption:
    """Return a flag that sets a field of the settings, before or after the name of the command."""

    def switch(ctx: click.Context, _: click.Parameter, is_set: bool) -> None:
        """Set the field of the settings if the flag is set."""
        if is_set:
            setattr(ctx.ensure_object(Settings), field, True)

    return flag(names, switch, text)


def flag(
    names: list[str], callback: Callable[[click.Context, click.Parameter, bool], None], text: str
) -> HeadedOption:
    """Return a general flag with a callback; its value is not passed to the command.

    Parameters
    ----------
    callback : callable
        Function of the context, the parameter and the value; click calls it during parsing.
    """
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
