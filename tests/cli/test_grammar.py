"""Grammar that is common to all commands: lists, ratios, grids, --plot, directories, -q, headings,
standard input."""

from importlib import import_module
from pathlib import Path

import click
import pytest

from csv_rows import rows
from legible import BEGINNINGS
from selection import every
from tdint_cli.main import COMMANDS, cli
from tdint_cli.options import grammar
from tdint_cli.options.grammar import with_values
from tdint_cli.options.option_types import BESIDE


@pytest.mark.parametrize(
    ("line", "count", "values"),
    [
        ("spectrum other.mseed --damping 2%,5% --period 0.2,1", 4,
         {"damping": [0.02, 0.05], "period_s": [0.2, 1.0]}),
        ("spectrum other.mseed --damping 0.02 --damping 5% --period 0.2 --period 1", 4,
         {"damping": [0.02, 0.05]}),
        ("spectrum other.mseed --damping 0.02,0.05,2% --period 0.2,1,0.2", 4,
         {"period_s": [0.2, 1.0]}),
        ("spectrum other.mseed --periods 0.5", 1, {"period_s": [0.5]}),
        ("spectrum other.mseed --period 0.1:0.4:3,2", 4, {"period_s": [0.1, 0.2, 0.4, 2.0]}),
        # The amplitudes are used in the typed order, and the first amplitude is repeated.
        ("law forced.yaml --drift 1%,20mm --drift 1% --points 1", 1 + 3 * 4, {}),
        ("stability --method newmark:beta=0.25:gamma=0.5,hht --dt-over-t 0.1 --damping 0,5%", 4,
         {"damping": [0, 0.05]}),
        ("spectrum other.mseed --period 1 --strength 10%,0.2 --hardening 3%", 2,
         {"yield_strength_ratio": [0.1, 0.2], "hardening": [0.03]}),
    ],
)  # fmt: skip
def test_lists_accept_commas_and_repeated_options(folder, tdint, line, count, values):
    """Repeated values are used once for spectra. A grid can be a single number."""
    table = rows(tdint(*line.split(), code=0).stdout)
    assert len(table) == count
    for name, expected in values.items():
        assert list(dict.fromkeys(float(row[name]) for row in table)) == expected


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--damping", "5"], "did you mean 5%?"),
        (["--damping", "5%,abc"], "'abc' ... ratio ... 5%"),
        (["--damping", "0.05,"], "'' is neither a ratio"),
        (["--damping", "nan"], "neither a ratio"),
        (["--damping", "100%"], "1.0 is not in the range 0.0<=x<1.0"),
        (["--period", "1,-1"], "-1.0 is not in the range x>=0"),
        (["--period", "1,inf"], "inf is not a finite number"),
        (["--periods", "1:2"], "neither FIRST:LAST:COUNT, such as 0.01:10:200, nor a number"),
        (["--periods", "2:1:5"], "FIRST the smaller one"),
        (["--strength", "0"], "is not in the range x>0"),
        (["--hardening", "100%"], "is not in the range"),
        (["--rotd", "50,101"], "101 is not in the range 0<=x<=100"),
    ],
)
def test_an_invalid_value_is_refused_with_a_valid_example(folder, tdint, arguments, message):
    tdint.refused(message, "spectrum", "other.mseed", *arguments)


@pytest.mark.parametrize(
    ("line", "expected"),
    [("a --plot b", ["a", f"--plot={BESIDE}", "b"]), ("a --plot", ["a", f"--plot={BESIDE}"]),
     ("--plot b.png a", ["--plot=b.png", "a"]), ("--plot B.SVG", ["--plot=B.SVG"]),
     ("--plot x/y.pdf -o z", ["--plot=x/y.pdf", "-o", "z"]), ("--plot x.jpg", ["--plot=x.jpg"]),
     ("--plot=x a", ["--plot=x", "a"]), ("--plot -o a.png", [f"--plot={BESIDE}", "-o", "a.png"]),
     ("a -- --plot b.png", ["a", "--", "--plot", "b.png"]),
     ("--history a.csv.gz --plot", ["--history=a.csv.gz", f"--plot={BESIDE}"]),
     ("--history b.png", [f"--history={BESIDE}", "b.png"])],
)  # fmt: skip
def test_the_argument_after_plot_is_its_file_if_it_names_a_figure(line, expected):
    defaults = dict.fromkeys(("--plot", "--history"), BESIDE)
    assert with_values(line.split(), defaults) == expected


def test_a_figure_is_written_next_to_the_output_or_to_its_own_name(folder, tdint):
    """Missing directories of the outputs are created."""
    for line in (
        "info --plot other.mseed -o a/info.csv",
        "spectrum --period 1 other.mseed motion.mseed --plot b/all.svg",
        "spectrum --period 1 other.mseed motion.mseed --plot -o c/",
        "run forced.yaml --plot -o d/deep",
        "run forced.yaml --plot=e/f.pdf",
    ):
        tdint(*line.split(), code=0)
    assert sorted(path.name for path in (folder / "a").iterdir()) == [
        "info.csv",
        "info.json",
        "info.png",
    ]
    assert (folder / "d/deep/summary.json").is_file()
    pictures = {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for suffix in ("png", "svg", "pdf")
        for path in folder.rglob(f"*.{suffix}")
    }
    names = [
        "a/info.png", "b/all.svg", "c/motion.png", "c/other.png", "d/deep/response.png",
        "e/f.pdf",
    ]  # fmt: skip
    assert sorted(pictures) == names
    assert all(
        data.startswith(BEGINNINGS[name.rpartition(".")[2]]) for name, data in pictures.items()
    )


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["info", "other.mseed", "--plot"], 2, "--plot without a file name requires -o; add -o"),
        (["spectrum", "other.mseed", "--plot"], 2,
         "--plot without a file name requires -o; add -o"),
        (["run", "forced.yaml", "--plot"], 2, "--plot without a file name requires -o; add -o"),
        (["spectrum", "other.mseed", "--plot=x.png", "-o", "out/"], 2,
         "--plot=FILE is one figure of all records"),
        (["spectrum", "other.mseed", "--plot", "x.jpg"], 2, ".png, .pdf or .svg, got .jpg"),
        (["run", "forced.yaml", "--plot=x"], 2, "a figure must be written as .png, .pdf or .svg"),
        (["info", "other.mseed", "--plot", "-o", "x.png"], 6, "two outputs have this file name"),
    ],
)  # fmt: skip
def test_an_invalid_figure_is_refused_before_the_computation(
    folder, tdint, arguments, code, message
):
    tdint.refused(message, *arguments, code=code)


PARAMETERS = {name: import_module(module).command.params for name, (module, _) in COMMANDS.items()}
TABLES = [
    name
    for name, parameters in PARAMETERS.items()
    for option in parameters
    if option.name == "output" and "FILE" in option.metavar.split("|")
]


@pytest.mark.parametrize("name", TABLES)
def test_a_table_requires_a_file_name_with_a_suffix(working_directory, tdint, name):
    """A name without suffix would be a directory for `tdint run` and a file for `tdint
    spectrum`."""
    arguments = (
        [*INPUTS.get(name, ["x.csv"]), *REQUIRED.get(name, [])] if name != "validate" else []
    )
    folder = ", or sp/ for a directory" if "spectrum" in name else ""
    expected = (
        "Error: -o sp: the file of a table must have a suffix; use sp.csv or "
        f"sp.csv.gz{folder}; -o - is standard output"
    )
    assert (
        tdint(name, *arguments, "-o", "sp", code=2).stderr.partition(" (see")[0].strip() == expected
    )
    assert not list(working_directory.iterdir())


def test_model_and_record_are_positional_or_read_from_standard_input(folder, tdint):
    """A record after the model is equivalent to --record."""
    expected = tdint("run", "shaken.yaml", "other.mseed", code=0).stdout
    assert tdint("run", "shaken.yaml", "--record", "other.mseed").stdout == expected
    assert tdint("run", "shaken.yaml").stdout != expected
    assert (
        tdint("run", "shaken.yaml", "-", stdin=(folder / "other.mseed").read_bytes()).stdout
        == expected
    )
    assert (
        tdint("run", "-", "other.mseed", stdin=(folder / "shaken.yaml").read_bytes()).stdout
        == expected
    )
    tdint.refused("standard input is used for the model", "run", "-", "-", stdin=b"")


def test_quiet_suppresses_messages_but_not_data_and_errors(folder, tdint):
    loud = tdint("run", "forced.yaml")
    assert "Maximum" in loud.stderr
    for call in (("-q", "run", "forced.yaml"), ("run", "forced.yaml", "--quiet")):
        quiet = tdint(*call, code=0)
        (warning,) = quiet.stderr.splitlines()  # --quiet does not suppress warnings.
        assert quiet.stdout == loud.stdout and warning.startswith(
            "Warning: unusual mass of a floor"
        )
    assert tdint("-q", "run", "missing.yaml", code=3).stderr == tdint("run", "missing.yaml").stderr


@pytest.mark.parametrize("name", every(3, COMMANDS))
def test_options_are_listed_under_headings_in_order(name, tdint):
    """Options of several commands have the same heading in all commands."""
    text = tdint(name, "--help-all").stdout
    positions = [
        text.index(f"\n{heading}:\n") for heading in grammar.ORDER if f"\n{heading}:\n" in text
    ]
    assert positions == sorted(positions)
    assert "\nGeneral:\n" in text
    shared = {
        "component": "Record", "inventory": "Record", "output": "Output",
        "plot": "Output", "overwrite": "Output",
    }  # fmt: skip
    for option in PARAMETERS[name]:
        if isinstance(option, click.Option):
            assert isinstance(option, grammar.HeadedOption)
            assert option.heading == shared.get(option.name, option.heading)


# ---- Options that depend on another option

DEPENDENT_OPTIONS = [
    (name, option)
    for name, parameters in PARAMETERS.items()
    for option in parameters
    if getattr(option, "needs", "")
]
INPUTS = {
    "compile": ["--all"], "ida": ["x", "y"], "failures": [], "stability": [],
    "examples": [], "overshoot": [], "order": [],
}  # fmt: skip
REQUIRED = {
    "inventory": ["--units", "m"],
    "compare": ["--recorded", "x"],
    "scale": ["--to", "pga=1g"],
    "match": ["--target", "x", "-o", "m"],
}


def valid_value(parameter: click.Option) -> list[str]:
    """Return a valid value of an option, as arguments."""
    if parameter.is_flag:
        return []
    item_type = getattr(parameter.type, "item", parameter.type)
    if isinstance(item_type, click.Choice):
        return [item_type.choices[0]]
    written = parameter.metavar or parameter.type.name
    return ["0.3:3:9" if "FIRST:LAST" in written else "1:2" if "LOW:HIGH" in written else "1"]


@pytest.mark.parametrize(
    ("name", "parameter"), every(3, DEPENDENT_OPTIONS), ids=lambda part: getattr(part, "name", part)
)
def test_an_option_without_effect_is_refused(working_directory, tdint, name, parameter):
    """The option is refused before any file is read; the named files do not exist. Formerly,
    `--floor-damping 2%` of `tdint run` without --floor-spectra was ignored."""
    option = max(parameter.opts, key=len)
    inputs = [] if parameter.needs == "RECORD" else INPUTS.get(name, ["x.csv"])
    call = [name, *inputs, *REQUIRED.get(name, [])]
    call += (
        ["--im", "pga"] if name == "ida" and option in ("--period", "--damping", "--p695") else []
    )
    call += ["--load", "free"] if option == "--frequency-ratio" else []
    value = {
        "--period": "1", "--range": "0.3:3:9", "--rule": "mean", "--year": "1985",
        "--damping": "0.1", "--floor-damping": "0.1", "--hardening": "0.1", "--theta": "0.6g",
        "--style": "90mm", "--report-head": "Project: bridge",
        "--pairs": "{}_N.txt,{}_E.txt",
        "--p695": "smt=1g,ductility=4,sdc=Dmax,dr=good,td=good,mdl=fair",
    }.get(option)  # fmt: skip
    result = tdint(*call, option, *([value] if value else valid_value(parameter)), code=2)
    expected = (
        f"Error: {option} has no effect without {parameter.needs}; add {parameter.needs}, or omit "
        f"{option}"
    )
    assert result.stderr.partition(" (see")[0].strip() == expected
    assert not list(working_directory.iterdir())


def test_options_that_depend_on_others_declare_them():
    """Each option that has an effect only with another option declares it with `needs`."""
    found = {(name, max(parameter.opts, key=len)) for name, parameter in DEPENDENT_OPTIONS}
    assert {
        ("run", "--floor-damping"),
        ("run", "--floor-periods"),
        ("run", "--history-every"),
        ("law", "--units"),
        ("compare", "--damping"),
        ("compare", "--periods"),
        ("spectrum", "--hardening"),
        ("spectrum", "--axes"),
        ("spectrum", "--against-column"),
        ("scale", "--range"),
        ("scale", "--rule"),
        ("scale", "--damping"),
        ("ida", "--period"),
        ("ida", "--damping"),
        ("stability", "--all"),
        ("overshoot", "--all"),
        ("order", "--frequency-ratio"),
        ("order", "--stride"),
        ("chart", "--versus"),
        ("compile", "--method"),
    } <= found


# ---- Modes of a command and their options

MODES = {name: tuple(modes.values()) for name in COMMANDS if (modes := grammar.modes_of(name))}
MODE_ARGUMENTS = {
    ("spectrum", "without RECORD"): "--target ec8:type=1,soil=B,ag=0.25g",
    ("spectrum", "with elastic spectra"): "x",
    (
        "spectrum",
        "with --ductility, --strength or --reduction",
    ): "x --ductility 2 --strength 1 --reduction 4",
    ("spectrum", "with --fourier"): "x --fourier",
    ("spectrum", "with --rotd"): "x --rotd 50",
    ("spectrum", "with --against"): "x --against y",
    ("chart", "with one building"): "x",
    ("chart", "with --stories"): "x --stories 2",
    ("chart", "with many problems"): "x.yaml y.yaml",
    ("chart", "with --problems"): "--problems standard",
    ("run", "with a single run"): "x y",
    ("run", "with --sequence"): "x y z --sequence",
    ("run", "with several runs"): "x y --factors z",
    ("campaign", "with `tdint campaign CAMPAIGN.yaml`"): "x",
    ("campaign", "with `tdint campaign status`"): "status x",
    ("campaign", "with `tdint campaign export`"): "export x",
    ("campaign", "with `tdint campaign merge`"): "merge x",
    ("check", "with models"): "x",
    ("check", "with --schema"): "--schema model",
    ("check", "with --plugin alone"): "--plugin empty.py",
    ("compile", ""): "x",
    ("compile", "with --show"): "x --show",
    ("compile", "with --clean alone"): "--clean",
    ("fragility", "with a single measure"): "x --im sa",
    ("fragility", "with --theta"): "--theta 0.4g --beta 0.3 --hazard h.csv",
    ("fragility", "with several measures (--im), because they are compared"): "x --im sa,pga",
    ("init", "without --weights"): "",
    ("init", "with --weights"): "--weights 1,1",
    ("law", "without --path"): "x --drift 1%",
    ("law", "with --path, which defines all drifts"): "x --path y",
    ("law", "with --list"): "--list",
    ("modes", "without --target or --transfer"): "x",
    ("modes", "with --target"): "x --target y",
    ("modes", "with --transfer"): "x --transfer",
    ("sensitivity", "with a model"): "x",
    (
        "sensitivity",
        "with a campaign directory, which defines the records and the parameters",
    ): "folder",
}
"""Arguments that select a mode of a command."""

VALUES = {
    "--axes": "periods --plot=p.png", "--damping": "2%", "--floor-damping": "2%",
    "--maxima": "peer", "--interpolation": "linear", "--rotd": "50", "--strength": "1",
    "--trim": "0:1", "--baseline": "linear",
    "--versus": "time --plot=p.png", "--export-floors": "mseed", "--im": "pga",
    "--report": "r.html", "--shapes": "roof", "--fit": "ida", "--by": "type",
    "--edp-range": "1:2", "--drift": "1%", "--limit": "2%", "--weights": "1,1",
    "--vary": "damping=1%:2%", "--set": "damping=2%", "--theta": "0.6g",
    "--output-units": "kip", "--target": "native",
    "--cache": "", "--plot": "--plot=p.png", "--changed": "--changed -o out",
    "--output": "out", "--history-every": "2 --history=h.csv", "--openquake": "f.xml",
    "--history": "--history=h.csv", "--tolerance": "1%",
    "--filter-order": "2 --highpass 1", "--allow-outside": "--allow-outside --hazard h.csv",
}  # fmt: skip


def idle_options():
    for name, modes in MODES.items():
        taken = frozenset().union(*(mode.takes for mode in modes))
        choosing = {
            argument
            for mode in modes
            for argument in MODE_ARGUMENTS[name, mode.label].split()
            if argument.startswith("--")
        }
        for mode in modes:
            arguments = MODE_ARGUMENTS[name, mode.label].split()
            for parameter in PARAMETERS[name]:
                option = max(parameter.opts, key=len)
                is_idle = parameter.name in taken - mode.takes and isinstance(
                    parameter, click.Option
                )
                asks_for_another = option in choosing and not choosing.intersection(arguments)
                if is_idle and option not in arguments and not asks_for_another:
                    yield pytest.param(
                        name,
                        mode,
                        parameter,
                        option in choosing,
                        id=f"{name} {mode.label} {option}",
                    )


@pytest.mark.parametrize(("name", "mode", "parameter", "chooses"), every(4, list(idle_options())))
def test_an_option_that_a_mode_does_not_support_is_refused(
    working_directory, tdint, name, mode, parameter, chooses
):
    """The option is refused before any file is read. Formerly, the options of `tdint chart
    --problems standard --highpass 0.1` and `tdint campaign status DIR --baseline A` were
    ignored."""
    (working_directory / "folder").mkdir()
    (working_directory / "empty.py").write_text("METHODS = ()\n")
    option = max(parameter.opts, key=len)
    value = VALUES[option].split() if option in VALUES else valid_value(parameter)
    typed = value if value and value[0].startswith(option) else [option, *value]
    result = tdint(name, *MODE_ARGUMENTS[name, mode.label].split(), *typed)
    advice = mode.advice.get(parameter.name, f"omit {option}")
    expected = f"Error: {option} has no effect {mode.label}; {advice}"
    # If two options select a mode, or if the call contains two options, either may be refused.
    text = " has no effect with" if chooses or len(value) > 1 else expected
    assert (result.exit_code, result.stdout, result.stderr.count("\n")) == (2, "", 1)
    assert text in result.stderr
    assert {path.name for path in working_directory.iterdir()} - {"__pycache__"} == {
        "folder",
        "empty.py",
    }


@pytest.mark.parametrize("name", MODES)
def test_modes_contain_only_parameters_of_their_command(name):
    parameters = {parameter.name for parameter in PARAMETERS[name]}
    assert [
        mode.label
        for mode in MODES[name]
        if not parameters.issuperset(mode.takes | set(mode.advice))
    ] == []
    assert {mode_text for command, mode_text in MODE_ARGUMENTS if command == name} == {
        mode.label for mode in MODES[name]
    }


def test_an_option_is_not_used_as_the_value_of_another(folder, tdint):
    call = ("scale", "motion.mseed", "--to", "pga=0.3g")
    tdint.refused("--pairs requires a value, but -q is an option", *call, "--pairs", "-q")
    tdint(*call, "--units", "m/s^2", "-q", code=0)


def test_compare_reads_standard_input_only_once(tdint):
    tdint.refused("MODEL.yaml and --recorded", "compare", "-", "--recorded", "-", stdin=b"")


def test_removed_options_name_the_other_way(tdint):
    """A table names each removed option, which is no option of its command any more."""
    table = rows(Path(grammar.__file__).with_name("removed.csv").read_text())
    assert len(table) == 15
    for row in table:
        name, option = row["commands"], row["option"]
        command = cli.get_command(click.Context(cli), name)
        assert command and option not in {text for item in command.params for text in item.opts}
        result = tdint(name, "x", option, "1", code=2)
        assert result.stderr.endswith(
            f"{option} of {name} was removed in 0.2.0; {row['instead']}\n"
        )
