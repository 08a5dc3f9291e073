"""The command `tdint`: a group that imports the module of a command only when this command runs.

Help and version load only click. A new command requires a module in `commands` with the click
command `command`, and a row in `options/commands.csv`.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Sequence
from contextvars import copy_context
from functools import partial
from importlib import import_module
from typing import Any, NoReturn

import click

from tdint.errors import did_you_mean
from tdint.files import INPUT_DIGESTS, PROTECTED, is_encodable
from tdint_cli.options.grammar import (
    HelpAsData,
    flag,
    general,
    listed_commands,
    recorded_words,
    shown_when_asked,
)
from tdint_cli.terminal import Settings, end_in_time, exit_code_of

COMMANDS: dict[str, tuple[str, str]] = {}
"""The module of each command, and the first sentence of its help, in the order of the help."""

GROUPS: dict[str, dict[str, str]] = {}
"""The commands in the groups of the help, with the first sentence of the help of each command."""

for _name, _row in listed_commands().items():
    _module = f"tdint_cli.{_row['package']}.{_name.replace('-', '_')}"
    COMMANDS[_name] = (_module, _row["sentence"])
    GROUPS.setdefault(_row["group"], {})[_name] = _row["sentence"]


class LazyGroup(HelpAsData, click.Group):
    """A group of commands that imports only the module of the requested command.

    The modules are in `tdint_cli.commands`. Importing all modules would delay each command.
    """

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of all commands in the order of the help."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return a command; None for an unknown name."""
        if cmd_name not in COMMANDS:
            return None
        command = import_module(COMMANDS[cmd_name][0]).command
        assert isinstance(command, click.Command)
        return command

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse a command line, and return the words after the general options.

        Raises
        ------
        UsageError
            A word contains a character that cannot be encoded.
        """
        if unreadable := next((word for word in args if not is_encodable(word)), None):
            raise click.UsageError(
                f"the argument {unreadable!a:.80} contains a character that the encoding "
                f"{sys.getfilesystemencoding()} of this system does not have; use other "
                "characters",
                ctx,
            )
        return super().parse_args(ctx, args)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the name of the requested command, the command and its arguments.

        Its option names and its command line are stored in the settings, for messages and for the
        JSON files of results.

        Parameters
        ----------
        args : list of str
            Command line after the general options; the first item is the name of the command.

        Raises
        ------
        UsageError
            The name is unknown; the message lists similar names, or all names.
        """
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            hint = did_you_mean(name, COMMANDS) or f"; the commands are {', '.join(COMMANDS)}"
            raise click.UsageError(f"No such command {name!r}{hint}", ctx)
        resolved_name, command, arguments = super().resolve_command(ctx, args)
        if command:
            settings = ctx.ensure_object(Settings)
            settings.options = frozenset(flag for option in command.params for flag in option.opts)
            settings.arguments = (name, *recorded_words(command, arguments))
        return resolved_name, command, arguments

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the help of the general options, then the names and the first sentences of the
        commands, in a section for each group."""
        super().format_options(ctx, formatter)
        width = max(map(len, COMMANDS))
        for heading, commands in GROUPS.items():
            with formatter.section(heading):
                formatter.write_dl(
                    [(name.ljust(width), sentence) for name, sentence in commands.items()]
                )

    def main(  # type: ignore[override]
        self, args: Sequence[str] | None = None, prog_name: str | None = None, **extra: Any
    ) -> NoReturn:
        """Run a command line and exit with its exit code; each error is printed as one line.

        Parameters
        ----------
        args : sequence of str, optional
            Command line after `tdint`; by default, the command line of the process.
        **extra
            Keyword arguments of the context of click. `obj` is the `Settings` of the command line.
        """
        # Without standalone mode, click raises errors instead of printing them and exiting.
        extra.pop("standalone_mode", None)
        settings = extra.setdefault("obj", Settings())
        run = partial(super().main, args, prog_name, standalone_mode=False, **extra)
        # Options set context variables, such as the figure style. In a copy of the context, these
        # values end with the command. The lists of input files are empty at the start of a command.
        context = copy_context()
        for input_files in (INPUT_DIGESTS, PROTECTED):
            context.run(input_files.set, {})
        sys.exit(context.run(exit_code_of, run, settings))


def _version(_: click.Context) -> str:
    """Return the text of --version."""
    from tdint.system import __version__

    return f"tdint {__version__}"


@click.group(
    cls=LazyGroup,
    params=[
        *general(),
        flag(["--version"], shown_when_asked(_version), "Show the version and exit."),
    ],
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
def cli() -> None:
    """Earthquake response of shear buildings, with a time-integration method of your choice.

    Results are written to standard output or to -o, messages to standard error. Exit codes: 0
    success, 1 internal error, 2 usage, 3 model file, 4 record, 5 analysis, 6 output, 130
    interrupted, 143 terminated.
    """


_ALLOCATIONS = 200_000
"""Number of allocated objects before a search for reference cycles; Python's default is 700."""


def use_one_thread() -> None:
    """Limit linear algebra to a single thread, unless the environment specifies the number.

    The matrices are small: starting threads needs more time than they save, and on a busy machine
    the threads wait for each other.
    """
    for library in ("OPENBLAS", "OMP", "MKL", "VECLIB", "BLIS"):
        # Apple's vecLib reads a variable with another ending than the other libraries.
        name = "VECLIB_MAXIMUM_THREADS" if library == "VECLIB" else f"{library}_NUM_THREADS"
        os.environ.setdefault(name, "1")


def main() -> None:
    """Run the command line of the process and exit (entry point of the program `tdint`).

    Imported modules remain in memory. Repeated garbage collection of their objects, also at exit,
    would need a fifth of the time of a short command.
    """
    gc.set_threshold(_ALLOCATIONS)
    use_one_thread()
    on_end = end_in_time()
    try:
        cli.main(prog_name="tdint")
    except SystemExit as end:
        # If a signal ended the command, `on_end` ends the process immediately.
        on_end(end.code)
        raise
    finally:
        gc.freeze()
