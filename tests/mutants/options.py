"""Mutants of the options of all commands (see `inputs.py`).

The words of the command line are changed before click converts them, so that the callbacks of the
options also receive the default. An option without a value of its own in the command, such as
`--quiet`, is the same in all commands.
"""

from collections.abc import Callable, Iterator, MutableMapping
from typing import Any

import click

from mutants.places import Mutant, Place

ENDING = {"help", "help_all", "version"}
"""Options that end the command; nothing can receive their value."""

ALL_COMMANDS = "all commands"


class Options:
    """Patch of `click.Option`; see `inputs.Inputs`."""

    def __init__(self) -> None:
        self.specified: set[Place] = set()
        self.mutant: Mutant | None = None
        self._unchanged = click.Parameter.handle_parse_result
        self._changed: object = None
        click.Parameter.handle_parse_result = self._parse()  # type: ignore[method-assign]

    def _parse(self) -> Callable[..., Any]:
        """Return a function in place of `click.Parameter.handle_parse_result`."""
        options = self

        def handle_parse_result(
            parameter: click.Parameter, context: click.Context, values: Any, words: Any
        ) -> Any:
            if options._changed is not values:  # the first parameter of a command line
                options._changed = values
                options._change(context.command, values)
            return options._unchanged(parameter, context, values, words)

        return handle_parse_result

    def _change(self, command: click.Command, values: MutableMapping[str, Any]) -> None:
        """Record the specified options of a command, and change the values in place."""
        given = {
            _place(command.name or "", option): str(option.name)
            for option in _options(command)
            if str(option.name) in values
        }
        self.specified |= given.keys()
        if self.mutant is None or self.mutant.place not in given:
            return
        name, receiver = given[self.mutant.place], self.mutant.receiver
        value = values.pop(name)
        if receiver in values:
            values[name] = values[receiver]
        if receiver:
            values[receiver] = value

    def mutants(self) -> Iterator[Mutant]:
        """Yield the mutants of the options of all commands."""
        from tdint_cli.main import COMMANDS, cli

        group, seen = click.Context(cli), set[Place]()
        for command_name in COMMANDS:
            command = cli.get_command(group, command_name)
            options = _options(command) if command else []
            for index, option in enumerate(options):
                place = _place(command_name, option)
                if place in seen:
                    continue
                seen.add(place)
                yield Mutant(place)
                kind = _kind(option)
                similar = [other for other in options[index + 1 :] if _kind(other) == kind]
                if similar:
                    yield Mutant(place, str(similar[0].name))


def _options(command: click.Command) -> list[click.Option]:
    """Return the options that do not end the command."""
    return [
        option
        for option in command.params
        if isinstance(option, click.Option) and option.name not in ENDING
    ]


def _place(command: str, option: click.Option) -> Place:
    """Return the place of an option of a command."""
    return (command if option.expose_value else ALL_COMMANDS), str(option.name)


def _kind(option: click.Option) -> tuple[Any, ...]:
    """Return what two options must have in common, so that one can receive the value of the
    other."""
    return (
        type(option.type),
        option.is_flag,
        option.multiple,
        option.nargs,
        option.metavar,
        option.expose_value,
        getattr(option.type, "choices", None),
    )
