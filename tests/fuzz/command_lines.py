"""Command lines from a seed: a valid command line with added options, whose values are valid or
unusual.

Options and arguments are read from the commands, so that new commands are tested as soon as they
are in GROUPS of `tdint_cli.main`. SOUND contains the arguments that make a command valid and fast.
"""

import random
from collections.abc import Sequence

import click

from fuzz.sandbox import COMPOSITE_MODELS, MODELS, OLD, OUTPUT, STRANGE_NAMES
from fuzz.study_files import CAMPAIGN, COMPARE, MATCH, SELECT
from tdint_cli.main import COMMANDS, cli
from tdint_cli.options.option_types import FileName, ListOf

RECORDS = (
    "a.txt", "n.mseed", "s.sac", "counts.mseed", "table.csv", "many", "nan.txt",
    "cut.mseed", "none", *STRANGE_NAMES,
)  # fmt: skip
_MODELS = (*MODELS, *COMPOSITE_MODELS)
_CHEAP = ("--method", "newmark-average")

SOUND: dict[str, list[tuple[str, ...]]] = {
    "run": [
        *((model,) for model in _MODELS),
        ("linear.yaml", "a.txt"),
        ("devices.yaml", "a.txt", "n.mseed", "--units", "m/s^2"),
        ("elements.yaml", "a.txt", "n.mseed", "--units", "m/s^2", "--sequence"),
        ("limited.yaml", "a.txt", "n.mseed", "--units", "m/s^2"),
        ("limited.yaml", "n.mseed", "--units", "m/s^2", "--pair-demand", "mean"),
    ],
    "modes": [(model,) for model in _MODELS],
    "law": [
        (model, "--drift", "1%", "--points", "3")
        for model in ("linear.yaml", "bilinear.yaml", "elements.yaml")
    ],
    "pushover": [("bilinear.yaml",), ("linear.yaml",), ("elements.yaml",), ("devices.yaml",)],
    "match": list(MATCH),
    "inventory": [
        ("assets.xml", "--mapping", "mapping.csv", "--units", "m"),
        ("buildings.csv", "--units", "m"),
        ("buildings.csv", "--units", "ft"),
    ],
    "info": [("a.txt",), ("n.mseed", "--units", "m/s^2"), ("many",)],
    "spectrum": [
        ("a.txt", "--period", "0.2,1"),
        ("n.mseed", "--period", "0.5", "--units", "m/s^2"),
    ],
    "drift-spectrum": [("a.txt", "--period", "0.2,1"), ("many", "--period", "0.5")],
    "methods": [()],
    "init": [("-",), ("-", "--stories", "3"), (f"{OUTPUT}/m.yaml",)],
    "check": [(model,) for model in _MODELS],
    "scale": [
        SELECT,
        (*SELECT, "--events", "events.csv", "--per-event", "1", "--target-std", "scatter.csv"),
        ("a.txt", "--to", "pga=0.2g"),
        ("n.mseed", "--units", "m/s^2", "--to", "sa=1m/s^2", "--at", "0.5"),
    ],
    "sensitivity": [("linear.yaml", "a.txt", "--vary", "damping=2%:5%")],
    "ida": [("linear.yaml", "a.txt")],
    "fragility": [("stripes.csv",), ("capacities.csv",), ("cloud.csv", "--threshold", "1%")],
    "compare": list(COMPARE),
    "campaign": list(CAMPAIGN),
    "stability": [_CHEAP],
    "overshoot": [(*_CHEAP, "--steps", "3")],
    "order": [(*_CHEAP, "--load", "free")],
    "failures": [(*_CHEAP, "--problem", "large-step")],
    "chart": [
        (
            "linear.yaml",
            *_CHEAP,
            "--halvings",
            "0",
            "--repeat",
            "1",
            "--duration",
            "0.1",
            "--no-cache",
        )
    ],
}  # fmt: skip
"""Sound and cheap command lines; a command that is not here is tried with what its arguments are
called."""

LEFT_OUT = {"compile", "examples"}
"""Commands that take too long for thousands of cases."""

WEIGHTS = {
    "run": 20, "info": 12, "spectrum": 12, "drift-spectrum": 8, "ida": 1, "match": 3,
    "order": 1, "failures": 1, "chart": 1,
}  # fmt: skip
"""How often a command is tried; 5 where it is not here."""

_NUMBERS = ("0.02", "0.5", "1", "2", "0.1", "0.25", "10")
_STRANGE_NUMBERS = (
    "0", "-1", "nan", "inf", "-inf", "1e308", "1e-308", "5e-324", "1e-9", "1e9",
    "1e400", "", " ", "abc", "0x1", "1_000", "5%", "1e300%", "0,1", "\uff15", "1:2",
    "--", "1" * 400, "\x1b[31m1", "-0",
)  # fmt: skip
_COUNTS = ("1", "2", "3", "5")
_STRANGE_COUNTS = ("0", "-1", "1.5", "99999999999999999999", "1000000", "abc", "", "1e3")
_GRIDS = (
    "0.1:1:3", "0.2:0.2:1", "0.5", "1:0.1:5", "0.1:1:0", "0:1:5", "0.1:1:100000000",
    "a:b:c", "1e-308:1e308:4", "::",
)  # fmt: skip
_DRIFTS = (
    "1%", "20mm", "2dy", "0.001", "0.01,0.02", "1e308", "-1", "nan", "0", "1e-300",
    "5in", "200%", "1e5dy",
)  # fmt: skip
_UNITS = (
    "g", "m/s^2", "gal", "cm/s", "in", "2e-6 m/s^2", "1e300 g", "0 g", "-1 g",
    "1e-300 m/s^2", "furlong", "g\x1b[31m",
)  # fmt: skip
_METHODS = (
    "newmark-average", "impulse4", "exact", "newmark-average,exact", "newmark:beta=nan",
    "newmark:beta=1e308,gamma=0.5", "impulse:beta=1e-9", "newmark-average:x=1",
    "wilson:theta=1e300", "neumark", ":", "", "generalized-alpha:rho_inf=2",
)  # fmt: skip
_TEXTS = (
    "", "HNE", "N", "1", "2", "\x1b[0m", "caf\xe9", "0:1", "0.05:", ":", "1e308:",
    "-1:2", "5:1", "0.1,0.9", "1e308", "1" * 3000,
)  # fmt: skip
_OUTPUTS = (
    f"{OUTPUT}/t.csv", f"{OUTPUT}/new/t.csv", OUTPUT, f"{OUTPUT}/", f"{OUTPUT}/{OLD}",
    "/dev/null", "", "/nowhere/t.csv",
)  # fmt: skip


def names() -> list[str]:
    """Return the names of the commands, repeated by their weights."""
    return [name for name in COMMANDS if name not in LEFT_OUT for _ in range(WEIGHTS.get(name, 5))]


def command_line(name: str, seed: int) -> list[str]:
    """Return the arguments of `tdint` for a command, which are the same for the same seed."""
    source = random.Random(f"{name} {seed}")
    context = click.Context(cli)
    command = cli.get_command(context, name)
    assert command is not None
    arguments = [name, *_sound(command, name, source)]
    options = [
        parameter
        for parameter in command.params
        if isinstance(parameter, click.Option) and parameter.name != "debug"
    ]
    for _ in range(source.choice((0, 1, 1, 2, 3))):
        arguments += _option(source.choice(options), source)
    if source.random() < 0.1:
        _damage(arguments, source)
    return arguments


def _sound(command: click.Command, name: str, source: random.Random) -> tuple[str, ...]:
    if name in SOUND:
        return source.choice(SOUND[name])
    called = [
        str(parameter.metavar or parameter.name)
        for parameter in command.params
        if isinstance(parameter, click.Argument)
    ]
    return tuple("linear.yaml" if "model" in parameter.lower() else "a.txt" for parameter in called)


def _damage(arguments: list[str], source: random.Random) -> None:
    """Remove, duplicate or replace one argument."""
    index = source.randrange(1, len(arguments)) if len(arguments) > 1 else 0
    action = source.randrange(4)
    if action == 0 and index:
        del arguments[index]
    elif action == 1:
        arguments.insert(index, arguments[index])
    elif action == 2:
        arguments[index] = source.choice((*RECORDS, *_MODELS, *_STRANGE_NUMBERS))
    else:
        arguments.insert(
            index,
            source.choice(("--no-such", "-x", "--", "-", "--help", "--plot=", "--method", "--dt=")),
        )


def _option(option: click.Option, source: random.Random) -> list[str]:
    name = source.choice([*option.opts, *option.secondary_opts])
    if option.is_flag or option.count:
        return [name]
    if name == "--plot":  # Drawing a figure takes a second.
        return [name, f"{OUTPUT}/p.png"] if source.random() < 0.05 else ["--plot=none.gif"]
    value = _value(option, source)
    return [f"{name}={value}"] if name.startswith("--") and source.random() < 0.5 else [name, value]


def _value(option: click.Option, source: random.Random) -> str:
    option_type = option.type
    if isinstance(option_type, ListOf):
        count = source.choice((1, 1, 2, 3))
        return ",".join(
            _single_value(option.name or "", option_type.item, source) for _ in range(count)
        )
    return _single_value(option.name or "", option_type, source)


def _single_value(name: str, value_type: click.ParamType, source: random.Random) -> str:
    by_name = _BY_NAME.get(name.rstrip("s"))
    if by_name:
        return source.choice(by_name)
    for written, sound, strange in _BY_FORM:
        if value_type.name == written:
            return source.choice(sound if source.random() < 0.6 else strange)
    for type_, sound, strange in _BY_TYPE:
        if isinstance(value_type, type_):
            return source.choice(sound if source.random() < 0.6 else strange)
    if isinstance(value_type, click.Choice):
        return str(source.choice([*value_type.choices, "none", ""]))
    return source.choice(_TEXTS)


_BY_NAME = {
    "method": _METHODS,
    "unit": _UNITS,
    "dt": (
        "0.01",
        "0.005",
        "0.02",
        "0.03",
        "0.0099",
        "0",
        "-1",
        "nan",
        "1e-300",
        "1e308",
    ),  # Small values take long.
    "output": _OUTPUTS,
    "record": RECORDS,
    "job": ("1", "1", "0", "-1", "x"),  # Starting processes takes a second.
    "stories": ("1", "2", "3", "0", "1e9", "-1", "100"),
    "model": (OUTPUT, "", "/nowhere"),
}
_BY_FORM = (("grid", _GRIDS[:3], _GRIDS), ("drift", _DRIFTS[:5], _DRIFTS))
_BY_TYPE: tuple[tuple[type, Sequence[str], Sequence[str]], ...] = (
    (FileName, ("a.txt", "linear.yaml"), (*RECORDS, "", "/dev/null")),
    (click.types.IntRange, _COUNTS, _STRANGE_COUNTS),
    (click.types.IntParamType, _COUNTS, _STRANGE_COUNTS),
    (click.types.FloatRange, _NUMBERS, _STRANGE_NUMBERS),
    (click.types.FloatParamType, _NUMBERS, _STRANGE_NUMBERS),
)
