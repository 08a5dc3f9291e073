"""`--set KEY=VALUE` of `run`, `modes`, `pushover` and `check`."""

import json

import pytest

from csv_rows import rows

FRAME = """\
name: frame
units: {{length: mm, force: kN, mass: t}}
stories:
  - {{mass: 100, height: 3200, stiffness: {stiffness}, law: {{type: bilinear, yield_force: {strength}, hardening: 5%}}}}
  - {{mass: 80, height: 3000, stiffness: 40}}
attachments: [{{name: tmd, floor: 2, mass: 4, stiffness: 1.5, dashpot: {dashpot}}}]
damping: {damping}
excitation: {{record: {{file: motion.mseed, component: HNE}}}}
"""  # noqa: E501
NUMBERS = {"stiffness": "45", "strength": "90", "dashpot": "0.009", "damping": "2%"}
CHANGES = ["damping=2%", "stories[1].stiffness=45", "story 1.law.yield_force=90"]
OTHER_UNITS = ["damping=0.02", "stories[1].stiffness=45 MN/m", "story 1.law.yield_force=9e4 N"]
COMMANDS = [
    "run frame.yaml",
    "run frame.yaml --scale 1,2",
    "modes frame.yaml",
    "modes frame.yaml --transfer",
    "modes frame.yaml --shapes",
    "pushover frame.yaml --drift 2% --points 20",
    "check frame.yaml",
]


@pytest.fixture
def frame(folder):
    numbers = NUMBERS | {"stiffness": "50", "strength": "60", "damping": "5%"}
    (folder / "frame.yaml").write_text(FRAME.format(**numbers))
    return folder


def options(changes):
    return [word for change in changes for word in ("--set", change)]


@pytest.mark.parametrize("command", COMMANDS)
def test_equals_the_model_with_the_values_in_its_file(frame, tdint, command):
    """Numbers in the units of the model, texts with units, and the values in the file are equal;
    one line for each number that is not in SI units, also with -q."""
    call, table = command.split(), "--scale" in command
    plain = tdint(*call, "-q", *options(CHANGES), code=0)
    texts = tdint(*call, "-q", *options([",".join(OTHER_UNITS)]), code=0)
    assert plain.stderr.count("numbers are in") == 2
    assert "--set stories[1].stiffness: numbers are in kN/mm, units of frame.yaml" in plain.stderr
    assert "numbers are in" not in texts.stderr
    unchanged = tdint(*call, "-q", code=0).stdout
    (frame / "frame.yaml").write_text(FRAME.format(**NUMBERS))
    written = tdint(*call, "-q", code=0).stdout
    found = rows(plain.stdout)
    # A table with a row per run has columns for the values, as with `vary`.
    columns = {"damping", "stories[1].stiffness_N_m"} if table else set()
    assert rows(texts.stdout) == found and columns <= found[0].keys()
    shared = [{key: row[key] for key in rows(written)[0]} for row in found]
    assert shared == rows(written) != rows(unchanged)


def test_the_last_value_of_a_key_applies(frame, tdint):
    last = tdint("modes", "frame.yaml", *options(["damping=9%", "damping=2%"]), code=0).stdout
    assert last == tdint("modes", "frame.yaml", "--set", "damping=2%", code=0).stdout


def test_results_state_the_values(frame, tdint):
    tdint("run", "frame.yaml", *options(CHANGES), "-o", "out", "--report", "out.html", code=0)
    summary = json.loads((frame / "out/summary.json").read_text())
    given = dict(change.split("=") for change in CHANGES)
    assert summary["settings"]["changes"] == given

    def page(name):
        return (frame / name).read_text().replace("\N{NO-BREAK SPACE}", " ")

    assert summary["building"]["damping"]["ratios"] == [0.02] * 2
    sentence = (
        "Values instead of those of the model file: damping 0.02, stories[1].stiffness 45000000 "
        "N/m, story 1.law.yield_force 90000 N."
    )
    assert sentence in page("out.html")
    for command in ("modes", "pushover"):
        outputs = "-o", f"{command}.csv", "--report", f"{command}.html"
        tdint(command, "frame.yaml", *options(CHANGES), *outputs, code=0)
        assert sentence in page(f"{command}.html")
        description = json.loads((frame / f"{command}.json").read_text())
        assert description["settings"]["changes"] == given
        assert "--set 'stories[1].stiffness=45'" in description["command"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("damping", "--set 'damping' must be KEY=VALUE"),
        ("=2%", "must be KEY=VALUE"),
        ("damping=", "must be KEY=VALUE"),
        ("dampin=2%", "unknown parameter 'dampin'; did you mean 'damping'?"),
        ("damping=2m", "damping: '2m' is neither a ratio"),
        ("damping=nan", "damping: 'nan' is neither"),
        ("stories[1].mass=3 kN", "stories[1].mass must be a number in SI units, or a text"),
        ("stories[3].mass=3", "stories[3].mass: story not found; frame has 2 stories"),
        ("mass_factor=-3", "mass_factor must be a positive number, got -3"),
        ("links[damper].dashpot=3", "links[damper] not found in frame"),
    ],
)
@pytest.mark.parametrize("command", ["run", "modes", "pushover", "check"])
def test_refusals(frame, tdint, command, change, message):
    tdint.refused(message, command, "frame.yaml", "--set", change, code=2)


def test_campaigns_and_schemas_are_refused(frame, tdint):
    (frame / "study.yaml").write_text(
        "buildings: {models: [frame.yaml]}\nrecords: {files: [motion.mseed]}\n"
    )
    tdint.refused("use its `vary`", "check", "study.yaml", "--set", "damping=2%", code=2)
    tdint.refused("omit --set", "check", "--schema", "--set", "damping=2%", code=2)
