"""The figures of all commands at three widths, checked by the rules of tests/figure_rules.py.

figure_commands.txt has a line for each kind of figure: a name, the functions that draw its figures,
and the command; `@` in place of the name prepares files. {S} is a directory of the test, {K} the
name. Set TDINT_PICTURES=DIRECTORY to keep the pictures.
"""

import contextlib
import io
import os
import re
import shlex
import sys
from collections import Counter
from pathlib import Path

import matplotlib as mpl
import pytest

import figure_rules
import readmes
from tdint.errors import UsageError
from tdint.output.figures import style
from tdint.output.printed import ON_SCREEN, PRINTED, PrintedAs
from tdint_cli.main import cli

COMMANDS = [
    line.split(None, 2)
    for line in Path(__file__).with_name("figure_commands.txt").read_text().splitlines()
    if line.strip() and not line.startswith("#")
]
WIDTHS = {"screen": ON_SCREEN, "90mm": PrintedAs(0.09), "180mm": PrintedAs(0.18)}
SOURCES = readmes.ROOT / "src" / "tdint"
MODULES = [*SOURCES.glob("output/figures/*.py"), *SOURCES.rglob("*_figures.py")]
FROM_PYTHON = {"suite_figures.gradient_picture", "suite_figures.runs_picture"}
"""Figures of results that no command has; tests/output/test_plotting.py draws them."""
_DATABASE = "ROOT/configs/retrofit"
INPUTS = {
    "recorded.yaml": """base: {file: out/history.csv, column: ground_acceleration_m_s2}
floors:
  roof: {file: out/history.csv, column: floor_10_absolute_acceleration_m_s2, sign: 1}
  5: {file: out/history.csv, column: floor_5_displacement_m, quantity: displacement}
band: [0.2, 20]
window: [2, 30]
""",
    "retrofit.yaml": f"""name: retrofit of an eight-story frame
buildings:
  models: [{_DATABASE}/existing.yaml, {_DATABASE}/stiffer.yaml, {_DATABASE}/dampers.yaml]
records: {{files: [ROOT/records/retrofit/], units: m/s^2, pairs: true}}
intensity: {{factors: factors.csv}}
""",
    "region.yaml": """name: a region
buildings:
  {inventory: buildings.csv, rules: capacity, units: {length: m},
   classes: ROOT/configs/capacity-classes.csv}
records: {files: [ROOT/records/], units: m/s^2}
intensity: {measure: pga, levels: [0.1 g, 0.2 g, 0.4 g]}
damage: {thresholds: capacity, dispersion: 0.3}
""",
    "buildings.csv": """id,class,NumberOfStories
a,timber,1
b,wall,2
c,masonry,2
d,concrete-frame,3
""",
}  # fmt: skip


def layouts():
    """Return the functions that draw a figure, as module.function."""
    pattern = r"^def (\w+_picture|draw_tripartite|draw_adrs)\("
    return {
        f"{file.stem}.{name}"
        for file in MODULES
        for name in re.findall(pattern, file.read_text(), re.MULTILINE)
    }


def test_each_kind_of_figure_has_a_command():
    declared = {name for _, names, _ in COMMANDS for name in names.split(",")} - {"-"}
    assert layouts() == declared | FROM_PYTHON


class Checked:
    """Figures of the commands: calls of the functions that draw them, and broken rules."""

    def __init__(self, folder):
        self.folder, self.name, self.count = folder, "", Counter()
        self.calls, self.found = set(), []

    def draw(self, picture):
        """Draw a figure at each width, and check it."""
        self.count[self.name] += 1
        for width, printed in WIDTHS.items():
            token = PRINTED.set(printed)
            try:
                figure = self.traced(picture)
                with mpl.rc_context(style._settings(printed)):
                    broken = figure_rules.findings(figure, printed=printed.width is not None)
                self.found += [f"{self.name} {self.count[self.name]} {width}: {x}" for x in broken]
                if pictures := os.environ.get("TDINT_PICTURES"):
                    file = Path(pictures) / f"{self.name}-{self.count[self.name]}.{width}.png"
                    with file.open("wb") as stream:
                        style._save(figure, stream, printed, 110, format="png")
            except UsageError as error:
                self.found.append(f"{self.name} {self.count[self.name]} {width}: {error}")
            finally:
                PRINTED.reset(token)

    def traced(self, picture):
        """Return the figure, and note the functions of figure modules that draw it."""

        def note(frame, event, _):
            if event == "call" and "figures" in frame.f_code.co_filename:
                stem = Path(frame.f_code.co_filename).stem
                self.calls.add((self.name, f"{stem}.{frame.f_code.co_name}"))

        sys.setprofile(note)
        try:
            return picture.figure()
        finally:
            sys.setprofile(None)

    def run(self, name, command):
        """Run a command in this process, with its figures drawn by `draw`."""
        self.name = name
        places = {"{S}": str(self.folder), "{K}": name, "ROOT": str(readmes.ROOT)}
        for place, text in places.items():
            command = command.replace(place, text)
        output, messages = (io.TextIOWrapper(io.BytesIO(), write_through=True) for _ in range(2))
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(messages):
            try:
                cli.main(shlex.split(command)[1:], prog_name="tdint")
            except SystemExit as stop:
                if stop.code:
                    text = messages.buffer.getvalue().decode()[-300:]
                    self.found.append(f"{name}: exit code {stop.code}: {text}")


@pytest.mark.slow
def test_figures_of_all_commands(tmp_path, monkeypatch):
    """Set TDINT_FIGURES to a regular expression of names to run fewer commands."""
    monkeypatch.chdir(readmes.ROOT)
    for name, text in INPUTS.items():
        (tmp_path / name).write_text(text.replace("ROOT", str(readmes.ROOT)))
    checked = Checked(tmp_path)

    def draw(picture, stream):
        checked.draw(picture)
        stream.write(b"")

    save = style.Picture.save

    def draw_in_page(picture, figure, stream):
        checked.draw(picture)
        save(picture, figure, stream)

    monkeypatch.setattr(style.Picture, "__call__", draw)
    monkeypatch.setattr(style.Picture, "save", draw_in_page)
    wanted = re.compile(os.environ.get("TDINT_FIGURES", ".*"))
    for name, names, command in COMMANDS:
        if name == "@" or wanted.fullmatch(name):
            checked.run(name, command)
            for function in names.split(",") if name != "@" else ():
                if (name, function) not in checked.calls:
                    checked.found.append(f"{name}: {function} draws no figure")
    assert not checked.found, "\n".join(checked.found)
