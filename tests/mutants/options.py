"""Mutants of the options of all commands: an option that is ignored, or exchanged with another.

`python tests/mutants/options.py` runs the tests of the commands once, and records the options that
each test specifies. It then tries two mutants of each option, in copies of this process: the
command receives the default in place of the value (`ignored`), and another option of the same type
receives the value (`exchanged`). The tests that specify the option run, the fastest first, until
one fails. The report names the mutants that no test notices, and the options that no test
specifies. `--only scale` restricts the commands, `--last N` the number of tests of each mutant.
"""

import argparse
import os
import resource
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from mutants.first_stage import Session, in_copy, result_of  # noqa: E402

TESTS = ("tests/cli", "tests/campaign", "tests/faults", "tests/documentation/test_examples.py")
"""Tests that execute commands."""

CPU_SECONDS = 60.0
"""Time limit of the tests of a mutant, in addition to three times their time with unchanged
commands, s of processor time. A mutant that exceeds it is noticed."""

OTHER = {"help", "help_all", "version"}
"""Options that end the command; nothing can receive their value."""

Place = tuple[str, str]
"""Command and option."""


@dataclass(frozen=True)
class Mutant:
    """Change of an option.

    Attributes
    ----------
    place : tuple of str
        Command and name of the parameter.
    receiver : str
        Name of the parameter that receives the value; empty if the value is ignored.
    """

    place: Place
    receiver: str = ""

    def __str__(self) -> str:
        command, name = self.place
        return f"{command} {name}: " + (f"as {self.receiver}" if self.receiver else "ignored")


class Options:
    """Patch of `click.Option` that records the specified options, and applies one mutant.

    Attributes
    ----------
    specified : set of tuple of str
        Options with a value on a command line since the last `clear`.
    mutant : Mutant or None
        Mutant that is applied.
    """

    def __init__(self) -> None:
        self.specified: set[Place] = set()
        self.mutant: Mutant | None = None
        self._unchanged = click.Option.handle_parse_result
        click.Option.handle_parse_result = self._parse()  # type: ignore[method-assign]

    def _parse(self) -> Callable[..., Any]:
        """Return a function in place of `click.Option.handle_parse_result`."""
        options = self

        def handle_parse_result(
            option: click.Option, context: click.Context, values: Any, arguments: Any
        ) -> Any:
            name = str(option.name)
            result = options._unchanged(option, context, values, arguments)
            source = context.get_parameter_source(name)
            if source is not click.core.ParameterSource.COMMANDLINE:
                return result
            place = str(context.command.name), name
            options.specified.add(place)
            mutant = options.mutant
            if mutant is not None and mutant.place == place and name in context.params:
                value = context.params[name]
                context.params[name] = option.type_cast_value(context, option.get_default(context))
                if mutant.receiver:
                    context.meta.setdefault("exchanged", {})[mutant.receiver] = value
                if not mutant.receiver:
                    context.set_parameter_source(name, click.core.ParameterSource.DEFAULT)
            return result

        return handle_parse_result


def exchange_after_parsing() -> None:
    """Give the value of a mutated option to its receiver, after all options have been parsed."""
    unchanged = click.Command.invoke

    def invoke(command: click.Command, context: click.Context) -> Any:
        context.params.update(context.meta.pop("exchanged", {}))
        return unchanged(command, context)

    click.Command.invoke = invoke  # type: ignore[method-assign]


def mutants(only: str) -> Iterator[Mutant]:
    """Yield the mutants of all options of the commands whose name contains `only`."""
    from tdint_cli.main import COMMANDS, cli

    group = click.Context(cli)
    for command_name in COMMANDS:
        command = cli.get_command(group, command_name)
        if only not in command_name or command is None:
            continue
        options = [
            option
            for option in command.params
            if isinstance(option, click.Option) and option.name not in OTHER
        ]
        for index, option in enumerate(options):
            place = command_name, str(option.name)
            yield Mutant(place)
            kind = _kind(option)
            similar = [str(other.name) for other in options[index + 1 :] if _kind(other) == kind]
            if similar:
                yield Mutant(place, similar[0])


def _kind(option: click.Option) -> tuple[Any, ...]:
    """Return what two options must have in common, so that one can receive the value of the
    other."""
    return (
        type(option.type),
        option.is_flag,
        option.multiple,
        option.nargs,
        option.metavar,
        getattr(option.type, "choices", None),
    )


@dataclass
class Measured:
    """Test with unchanged commands: time, s, and specified options."""

    seconds: float
    specified: set[Place]


def measure(session: Session, options: Options) -> dict[str, Measured]:
    """Run all tests, and return those that pass."""
    measured = {}
    began = time.monotonic()
    for name, failed in session.run(list(session.items)):
        if failed:
            print(f"fails with unchanged commands, not used: {name}", flush=True)
        else:
            measured[name] = Measured(time.monotonic() - began, set(options.specified))
        options.specified.clear()
        began = time.monotonic()
    return measured


def noticed_by(session: Session, names: list[str]) -> str:
    """Return the first test that fails; empty if all pass."""
    return next((name for name, failed in session.run(names) if failed), "")


def try_all(session: Session, options: Options, arguments: argparse.Namespace) -> None:
    """Try all mutants, and print the report."""
    measured = measure(session, options)
    found, survivors, untested = 0, [], set()
    with TemporaryDirectory() as folder:
        for number, mutant in enumerate(mutants(arguments.only)):
            names = sorted(
                (name for name, test in measured.items() if mutant.place in test.specified),
                key=lambda name: measured[name].seconds,
            )[: arguments.last]
            if not names:
                untested.add(mutant.place)
                continue

            def work(mutant: Mutant = mutant, names: list[str] = names) -> str:
                limit = int(CPU_SECONDS + 3.0 * sum(measured[name].seconds for name in names))
                used = int(time.process_time())
                resource.setrlimit(resource.RLIMIT_CPU, (used + limit, used + limit))
                options.mutant = mutant
                return noticed_by(session, names)

            output = Path(folder) / f"{number}.json"
            if result_of(in_copy(work, output), output) == "":
                survivors.append(mutant)
                print(f"not noticed by {len(names)} tests: {mutant}", flush=True)
            else:
                found += 1
    for command, name in sorted(untested):
        print(f"no test: {command} {name}")
    tried = found + len(survivors)
    print(f"{tried} mutants, {found} noticed ({found / max(tried, 1):.1%})")
    print(f"{len(untested)} options without a test")


def main() -> None:
    """Collect the tests, and try the mutants."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--only", default="", help="part of the name of a command")
    parser.add_argument("--last", type=int, default=40, help="tests of each mutant")
    parser.add_argument("tests", nargs="*", default=TESTS)
    arguments = parser.parse_args()
    os.environ.update(OPENBLAS_NUM_THREADS="1", TDINT_COMPILE="wait")
    os.chdir(ROOT)
    options = Options()
    exchange_after_parsing()
    session = Session(lambda session: try_all(session, options, arguments))
    call = ["-q", "-p", "no:cacheprovider", "-p", "no:faulthandler", *arguments.tests]
    sys.exit(int(pytest.main(call, plugins=[session])))


if __name__ == "__main__":
    main()
