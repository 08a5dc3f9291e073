"""The command group: help and version without heavy imports, the list of commands, help of every
option."""

import subprocess
import sys

import click
import pytest

import tdint as library
from tdint_cli.main import COMMANDS, GROUPS, cli

HEAVY = ("numpy", "scipy", "numba", "obspy", "matplotlib", "yaml", "pkg_resources")


@pytest.mark.long
def test_help_and_version_import_only_click():
    """The calls run in a single process, which reports the first call with other imports. The group
    imports no command."""
    calls = [["--help"], ["-h"], ["--version"], *([name, "-h"] for name in COMMANDS)]
    code = (
        "import sys\nfrom tdint_cli.main import main\n"
        "assert not any(name.startswith('tdint_cli.commands.') for name in sys.modules)\n"
        f"for arguments in {calls!r}:\n"
        "    sys.argv = ['tdint', *arguments]\n"
        "    try:\n        main()\n    except SystemExit as end:\n        assert not end.code, "
        "arguments\n"
        f"    assert not {set(HEAVY)!r} & set(sys.modules), arguments\n"
        "print('all')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.splitlines()[-1:]) == (0, ["all"]), done.stderr


@pytest.mark.parametrize("name", COMMANDS)
def test_the_command_list_matches_the_command_help_and_every_option_has_help(name):
    sentence = COMMANDS[name][1]
    command = cli.get_command(click.Context(cli), name)
    assert command.name == name
    assert command.get_short_help_str(limit=200).removesuffix(".") == sentence.removesuffix(".")
    assert command.help.splitlines()[0] == sentence
    chosen = [parameter for parameter in command.params if isinstance(parameter, click.Option)]
    assert all(option.help for option in chosen)
    assert "--debug" in [text for option in chosen for text in option.opts]


@pytest.mark.parametrize("arguments", [["--help"], ["-h"], []])
def test_help_lists_all_commands_in_order(tdint, arguments):
    result = tdint(*arguments)
    # Without arguments, click 8.2 and later end with a usage error.
    assert result.exit_code == 0 or not arguments
    output = result.stdout + result.stderr
    positions = [output.index(f"\n{heading}:\n") for heading in GROUPS]
    assert positions == sorted(positions) and all(name in output for name in COMMANDS)
    context = click.Context(cli)
    assert cli.list_commands(context) == list(COMMANDS)
    assert cli.get_command(context, "unknown") is None


def test_version(tdint):
    result = tdint("--version")
    assert (result.exit_code, result.stdout) == (0, f"tdint {library.__version__}\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["spectrm"], "'spectrm'; did you mean 'spectrum'?"),
        (["xyz"], "Error: No such command 'xyz'; ... init, check, run, modes"),
        (["--bogus"], "No such option"),
        (["run"], "Error: Missing argument 'MODEL.yaml'."),
        (["spectrum"], "Error: Missing argument 'RECORD...'."),
        (["run", "x.yaml", "--dt", "abc"], "'abc' is not a valid float"),
        (["modes", "x.yaml", "y.yaml"], "unexpected extra argument"),
        (
            ["run", "x.yaml", "a.mseed", "b.mseed", "--history"],
            "--history has no effect ... one record and one scale",
        ),
        (
            ["run", "x.yaml", "a.mseed", "--record", "b.mseed"],
            "--record b.mseed and a.mseed cannot be used together",
        ),
    ],
)
def test_usage_errors(tdint, arguments, message):
    tdint.refused(message, *arguments)
