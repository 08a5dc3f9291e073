"""The options that state how a record is read and processed have their effect in every command with
these options, and the keys of the same names in models and campaigns: the results are those of a
file with the same samples that requires no option."""

import re
from pathlib import Path

import click
import numpy as np
import pytest

from cli.conftest import write_record
from tdint.ground_motion.processing_steps import process
from tdint.ground_motion.reading.read import make_record, read_record
from tdint_cli.main import COMMANDS, cli

LINES = {
    "info": "info motion.txt",
    "spectrum": "spectrum motion.txt --period 0.5",
    "drift-spectrum": "drift-spectrum motion.txt --period 0.5 --stories 1",
    "run": "run shaken.yaml --record motion.txt",
    "match": "match motion.txt --target ec8:type=1,soil=B,ag=0.25g --range 0.4:0.5 --format csv "
    "-o out --overwrite",
    "scale": "scale motion.txt --to sa=0.5g --at 0.5",
    "ida": "ida shaken.yaml motion.txt --im pga --threshold 0.1% --max-im 3g",
    "sensitivity": "sensitivity shaken.yaml motion.txt --vary stiffness_factor=0.9:1.1",
    "chart": "chart shaken.yaml --record motion.txt --method newmark-average --dt 0.02 "
    "--duration 0.8 --repeat 1",
}
FILES = {"model file": "run model.yaml", "campaign file": "campaign study.yaml -o out --overwrite"}
"""Commands with a file that contains the options as keys of the record."""

LAYOUT = "--skip-lines 2 --column 2 --step 0.01 --units m/s^2"
PROCESSING = (
    "--trim 0.2:2.2 --baseline linear --pad 0.5:1 --highpass 0.4 --lowpass 20 --filter-order 2 "
    "--resample 0.005 --units m/s^2"
)


def _commands_with(*names):
    context = click.Context(cli)
    return {
        name
        for name in COMMANDS
        if {*names} <= {option.name for option in cli.get_command(context, name).params}
    }


WITH_OPTIONS = {"run", "info", "spectrum", "chart"}
"""Commands with these options. The others take the same keys from a description of records."""


def test_every_command_with_these_options_is_tried():
    assert _commands_with("rows", "trim") == WITH_OPTIONS
    assert _commands_with("units", "component", "inventory") == {*LINES}


def keys_of(options):
    """Return options of the command line as keys of a record in YAML."""
    words = re.findall(r"--([a-z-]+)(?: (?!--)(\S+))?", options)
    return [f"{name.replace('-', '_')}: {value or 'true'}" for name, value in words]


def write_files(folder, file, options):
    """Write the options as keys of the record of a model and of the records of a campaign."""
    keys = ", ".join(keys_of(options))
    shaken = (folder / "shaken.yaml").read_text()
    (folder / "model.yaml").write_text(
        shaken.replace("file: motion.mseed, component: HNE", f"file: {file}, {keys}")
    )
    (folder / "study.yaml").write_text(
        f"buildings: {{models: [shaken.yaml]}}\nrecords: {{files: [{file}], {keys}}}\n"
        "analysis: {method: newmark-average}\n"
    )


@pytest.fixture
def samples():
    t = 0.01 * np.arange(300)
    return np.random.default_rng(17).standard_normal(300) * np.exp(-t)


@pytest.fixture
def numbers(folder, tdint, short_matching):
    """Return a function that writes motion.txt, and returns the numbers that a command prints, or
    the ground motion that it writes. The numbers of `chart` exclude the times."""

    def numbers_of(command, text, options):
        line = LINES.get(command, "")
        if text is None:
            line = line.replace("motion.txt", "motion.mseed")
        else:
            (folder / "motion.txt").write_text(text)
        if command in FILES:
            write_files(folder, "motion.txt" if text else "motion.mseed", options)
            result = tdint(*FILES[command].split(), code=None)
        elif command in WITH_OPTIONS:
            result = tdint(*line.split(), *options.split(), code=None)
        else:
            (file,) = re.findall(r"motion\.\w+", line)
            lines = "\n".join([f"files: [{file}]", *keys_of(options)])
            (folder / "described.yaml").write_text(lines)
            result = tdint(*line.replace(file, "described.yaml").split(), code=None)
        assert result.exit_code in (0, 4), result.stderr
        table = result.stdout
        for file in sorted(Path("out").glob("*.csv")):
            table += file.read_text()
            file.unlink()
        header, *lines = [line.split(",") for line in table.splitlines() if "," in line]
        return [
            number
            for line in lines
            for name, cell in zip(header, line, strict=False)
            if not name.startswith("time_") and (number := _number(cell)) is not None
        ]

    return numbers_of


def _number(cell):
    try:
        return float(cell)
    except ValueError:
        return None


def _plain(acceleration, dt):
    return "".join(f"{i * dt!r} {float(a)!r}\n" for i, a in enumerate(acceleration))


@pytest.mark.parametrize("command", [*LINES, *FILES])
def test_layout_of_a_table(numbers, samples, command):
    """The second column below two lines, without times."""
    backwards = samples[::-1]
    table = "made by hand\n7 8\n" + "".join(
        f"{float(b)!r} {float(a)!r}\n" for a, b in zip(samples, backwards, strict=True)
    )
    expected = numbers(command, _plain(samples, 0.01), "--units m/s^2")
    assert len(expected) > 0
    # The component is named after its column, 2.
    found = [value for value in numbers(command, table, LAYOUT) if value != 2.0]
    np.testing.assert_allclose(found, [value for value in expected if value != 2.0], rtol=1e-9)


@pytest.mark.parametrize("command", [*LINES, *FILES])
def test_samples_in_rows(numbers, samples, command):
    """Five samples of one ground motion in each line."""
    lines = samples.reshape(-1, 5)
    table = "".join(" ".join(repr(float(a)) for a in line) + "\n" for line in lines)
    expected = numbers(command, _plain(samples, 0.01), "--units m/s^2")
    found = numbers(command, table, "--rows --step 0.01 --units m/s^2")
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("command", [*LINES, *FILES])
def test_processing(numbers, samples, command):
    record = process(
        make_record(samples, dt=0.01, units="m/s^2"),
        trim=(0.2, 2.2),
        baseline="linear",
        pad=(0.5, 1.0),
        highpass=0.4,
        lowpass=20.0,
        filter_order=2,
        resample=0.005,
    )
    expected = numbers(command, _plain(record.acceleration, record.dt), "--units m/s^2")
    found = numbers(command, _plain(samples, 0.01), PROCESSING)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-12)


STATION_XML = """\
<?xml version="1.0" encoding="UTF-8"?>
<FDSNStationXML xmlns="http://www.fdsn.org/xml/station/1" schemaVersion="1.2">
 <Source>test</Source><Created>2026-01-01T00:00:00</Created>
 <Network code="TD"><Station code="TEST">
  <Latitude>0</Latitude><Longitude>0</Longitude><Elevation>0</Elevation><Site><Name>t</Name></Site>
  <Channel code="HNE" locationCode=""><Latitude>0</Latitude><Longitude>0</Longitude>
   <Elevation>0</Elevation><Depth>0</Depth><Azimuth>90</Azimuth><Dip>0</Dip>
   <SampleRate>100</SampleRate>
   <Response>
    <InstrumentSensitivity><Value>500</Value><Frequency>1</Frequency>
     <InputUnits><Name>m/s**2</Name></InputUnits><OutputUnits><Name>counts</Name></OutputUnits>
    </InstrumentSensitivity>
    <Stage number="1">
     <PolesZeros><InputUnits><Name>m/s**2</Name></InputUnits>
      <OutputUnits><Name>counts</Name></OutputUnits>
      <PzTransferFunctionType>LAPLACE (RADIANS/SECOND)</PzTransferFunctionType>
      <NormalizationFactor>1</NormalizationFactor>
      <NormalizationFrequency>1</NormalizationFrequency></PolesZeros>
     <StageGain><Value>500</Value><Frequency>1</Frequency></StageGain>
    </Stage>
   </Response></Channel></Station></Network></FDSNStationXML>
"""
"""Response of an accelerometer: 500 counts per m/s^2 at all frequencies."""


@pytest.mark.parametrize("command", [*LINES, *FILES])
def test_inventory(folder, numbers, command):
    (folder / "station.xml").write_text(STATION_XML)
    write_record(folder / "motion.mseed", "HNE", integer=True)
    found = numbers(command, None, "--inventory station.xml")
    record = read_record("motion.mseed", inventory="station.xml")
    expected = numbers(command, _plain(record.acceleration, record.dt), "--units m/s^2")
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)
