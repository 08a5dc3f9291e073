"""`--output-units`: tables, summaries and messages in other units and converted back; compressed
and thinned histories."""

import csv
import gzip
import io
import json
import math
import re
from pathlib import Path
from typing import Any

import pytest

from cli.conftest import Command
from tdint.units import parse_output_units, suffix

US = parse_output_units("kip,in,g")
CONFIGS = Path(__file__).parents[2] / "configs"


SUFFIXES = {suffix(unit): unit for unit in ("m", "s", "N", "J", "m/s", "m/s^2", "N/m", "kg")}


def unit_of(name: str) -> str:
    """Return the unit at the end of the name of a column."""
    ends = [end for end in SUFFIXES if name.removesuffix("_error").endswith(end)]
    return SUFFIXES[max(ends, key=len)] if ends else "1"


def table(text: str) -> tuple[list[str], list[list[str]]]:
    header, *rows = csv.reader(io.StringIO(text))
    return header, rows


def check_round_trip(si: str, us: str) -> None:
    """Check that a table in US units, converted to SI, equals the table in SI units within the
    digits of both, and that the column names contain the units."""
    (names, rows), (renamed, converted_rows) = table(si), table(us)
    found = [US.column(name, unit_of(name)) for name in names]
    assert renamed == [name for name, _ in found] and renamed != names
    for row, other in zip(rows, converted_rows, strict=True):
        for cell, converted, (_, factor) in zip(row, other, found, strict=True):
            if factor == 1.0 or not cell:
                assert converted == cell
            else:
                assert math.isclose(
                    float(converted) * factor, float(cell), rel_tol=2e-11, abs_tol=1e-300
                )


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "shaken.yaml", "--check"),
        ("law", "shaken.yaml", "--drift", "1%,2%", "--points", 3),
        ("pushover", "shaken.yaml", "--points", 5),
        ("spectrum", "motion.mseed", "--component", "HNE", "--period", "0.2,1", "--damping",
         "2%,5%"),
        ("spectrum", "motion.mseed", "--component", "HNE", "--period", "0.5", "--ductility", 2),
        ("spectrum", "motion.mseed", "--period", "0.5", "--rotd", "50,100"),
        ("drift-spectrum", "motion.mseed", "--component", "HNE", "--period", "0.5"),
        ("info", "motion.mseed"),
        ("check", "shaken.yaml"),
        ("inventory", CONFIGS / "buildings.csv", "--units", "ft"),
    ],
    ids=lambda arguments: "-".join(str(word) for word in arguments if str(word).isalpha()),
)  # fmt: skip
def test_a_table_in_other_units_converts_back(
    folder: Path, tdint: Command, arguments: tuple[Any, ...]
) -> None:
    si, us = tdint(*arguments), tdint(*arguments, "--output-units", "kip,in,g")
    assert (si.exit_code, us.exit_code) == (0, 0), us.stderr
    check_round_trip(si.stdout, us.stdout)


def test_the_files_of_a_run_in_other_units_convert_back(folder: Path, tdint: Command) -> None:
    run = ("run", "shaken.yaml", "--history", "--floor-spectra", "roof", "--floor-period", 0.5)
    tdint(*run, "-o", "si", code=0)
    done = tdint(*run, "-o", "us", "--output-units", "kip,in,g", code=0)
    for name in ("stories.csv", "history.csv", "floor-spectra.csv"):
        check_round_trip(*((folder / units / name).read_text() for units in ("si", "us")))
    si, us = (json.loads((folder / units / "summary.json").read_text()) for units in ("si", "us"))
    assert us["peaks"]["base_shear_kip"] == pytest.approx(
        si["peaks"]["base_shear_N"] / 4448.2216152605, rel=1e-11
    )
    assert us["record"]["pga_g"] == pytest.approx(si["record"]["pga_m_s2"] / 9.80665, rel=1e-11)
    assert (
        us["meanings"]["base_shear_kip"]["unit"] == "kip"
        and us["settings"]["output_units"] == "kip,in,kg,g"
    )
    assert set(us["meanings"]) == {
        US.column(name, meaning.get("unit", "1"))[0] for name, meaning in si["meanings"].items()
    }
    assert " kip." in done.stderr and " in, base shear" in done.stderr and " g)" in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "shaken.yaml"),
        ("law", "shaken.yaml", "--drift", "1%", "--points", 9),
        ("pushover", "shaken.yaml", "--points", 9),
        ("spectrum", "motion.mseed", "--component", "HNE", "--periods", "0.1:2:9"),
        ("spectrum", "motion.mseed", "--component", "HNE", "--period", "0.5,1", "--ductility", 2),
        ("spectrum", "motion.mseed", "--period", "0.5,1", "--rotd", "50,100"),
        ("drift-spectrum", "motion.mseed", "--component", "HNE", "--period", "0.5,1"),
        ("info", "motion.mseed", "--component", "HNE"),
        ("scale", "motion.mseed", "--component", "HNE", "--to", "sa=0.2g", "--at", 0.5),
    ],
    ids=lambda arguments: "-".join(str(word) for word in arguments if str(word).isalpha()),
)
def test_figures_have_no_si_units(folder: Path, tdint: Command, arguments: tuple[Any, ...]) -> None:
    """No label, name or legend of a figure contains SI units."""
    in_si = re.compile(r"[( ](m|m/s|m/s²|[kM]?N|[kM]?J)(\)|$)")
    tdint(*arguments, "--plot=us.svg", "--output-units", "kip,in,g", code=0)
    us = re.findall("<text>(.*?)</text>", Path("us.svg").read_text(), re.DOTALL)
    assert [text for text in us if in_si.search(text)] == []
    assert any(re.search(r"[( ](in|in/s|g|kip|kip·in)(\)|$)", text) for text in us)


def test_units_of_a_model_are_replaced_by_the_command_line(folder: Path, tdint: Command) -> None:
    with (folder / "forced.yaml").open("a") as stream:
        stream.write("output_units: [kN, mm]\n")
    table = tdint("run", "forced.yaml").stdout
    assert "peak_shear_kN" in table and "peak_absolute_acceleration_mm_s2" in table
    assert "shear_kN" in tdint("law", "forced.yaml", "--drift", "1%").stdout
    assert "base_shear_kN" in tdint("pushover", "forced.yaml", "--points", 3).stdout
    assert "peak_shear_kip" in tdint("run", "forced.yaml", "--output-units", "kip,in,g").stdout


def test_campaigns_and_runs_of_several_records(folder: Path, tdint: Command) -> None:
    run = ("run", "shaken.yaml", "--scale", "0.5,1", "--dt", 0.01)
    check_round_trip(
        *(tdint(*run, *units, code=0).stdout for units in ((), ("--output-units", "kip,in,g")))
    )
    (folder / "study.yaml").write_text(
        "buildings: {models: [shaken.yaml]}\nrecords: {files: [other.mseed]}\noutputs: {stories: "
        "true}\n"
    )
    tdint("campaign", "study.yaml", "-o", "study", code=0)
    tables = {name: (folder / "study" / name).read_text() for name in ("runs.csv", "stories.csv")}
    tdint("campaign", "export", "study", "--output-units", "kip,in,g", code=0)
    for name, text in tables.items():
        check_round_trip(text, (folder / "study" / name).read_text())
    assert "peak_base_shear_kip" in (folder / "study" / "runs.csv").read_text()


def test_a_history_is_compressed_and_thinned(folder: Path, tdint: Command) -> None:
    run = ("run", "forced.yaml")
    tdint(*run, "--history", "-o", "out", code=0)
    lines = (folder / "out" / "history.csv").read_text().splitlines(keepends=True)
    assert len(lines) == 102
    tdint(*run, "--history", "new/h.csv.gz", "--history-every", 7, code=0)
    compressed = (folder / "new" / "h.csv.gz").read_bytes()
    assert gzip.decompress(compressed).decode() == "".join([lines[0], *lines[1::7]])
    tdint(*run, "--history=new/h.csv.gz", "--history-every", 7, "--overwrite", code=0)
    # The compressed bytes do not depend on the time of writing.
    assert (folder / "new" / "h.csv.gz").read_bytes() == compressed
    tdint(*run, "--history=plain.csv", code=0)
    assert (folder / "plain.csv").read_text() == "".join(lines)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--history",), "--history without a file ... add -o DIR, or use --history=FILE.csv"),
        (("--history=h.txt",), "--history h.txt: ... .csv or .csv.gz"),
        (("--history=",), "--history must not be empty; specify a name"),
        (("--history=h.csv", "--history-every", 0), "--history-every"),
        (("--output-units", "kips,in"), "unknown unit 'kips'; did you mean 'kip'?"),
    ],
)
def test_invalid_arguments_are_refused(
    folder: Path, tdint: Command, arguments: tuple[Any, ...], message: str
) -> None:
    tdint.refused(message, "run", "forced.yaml", *arguments)


@pytest.mark.parametrize("option", [(), ("--output-units", "kip,in,g")])
def test_a_target_beyond_the_curve_is_stated_in_the_units_of_the_results(folder, tdint, option):
    model = (folder / "shaken.yaml").read_text()
    (folder / "shaken.yaml").write_text(model if option else model + "output_units: kip,in,g\n")
    call = ("pushover", "shaken.yaml", "--drift", "1mm", "--target", "ec8:type=1,soil=C,ag=1g")
    assert "the end of the pushover curve at 0.03937 in;" in tdint(*call, *option, code=5).stderr
