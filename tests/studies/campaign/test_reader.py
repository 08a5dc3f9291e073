"""Errors in campaign files, with line and column."""

import json
from pathlib import Path

import pytest

from json_schema import spoiled, tree, valid
from tdint.errors import ModelError
from tdint.ground_motion.horizontals import USUAL, PairNames
from tdint.model.config.record_files import RecordFiles
from tdint.studies.campaign.reader import CAMPAIGN, campaign_schema, load_campaign

STUDY = """\
buildings: {models: [model.yaml]}
records: {files: [a.csv]}
intensity: {measure: pga, %s}
analysis: {%s}
"""


@pytest.mark.parametrize(
    ("intensity", "analysis", "message"),
    [
        ("levels: [1e308 g]", "", ":3:36: intensity.levels[1]: must be from 1e-06 to 1e+06"),
        ("levels: [1e-320 g]", "", ":3:36: intensity.levels[1]: must be"),
        ("levels: [0.1 g]", "tolerance: 0", ":4:23: analysis.tolerance: must be"),
        (
            "levels: [0.1 g], pair: rotd50",
            "",
            "intensity.pair: has no effect without `pairs: true`",
        ),
    ],
)
def test_invalid_values_are_refused(
    tmp_path: Path, intensity: str, analysis: str, message: str
) -> None:
    file = tmp_path / "study.yaml"
    file.write_text(STUDY % (intensity, analysis))
    with pytest.raises(ModelError) as caught:
        load_campaign(file)
    assert message in str(caught.value) and len(str(caught.value).splitlines()) == 1


def test_file_name_patterns_of_pairs(tmp_path: Path) -> None:
    file = tmp_path / "study.yaml"
    for written, read in (
        ("true", USUAL),
        ("false", None),
        ("'{}_a.csv,{}_b.csv'", PairNames("{}_a.csv", "{}_b.csv")),
    ):
        file.write_text(
            f"buildings: {{models: [model.yaml]}}\nrecords: {{files: [a.csv], pairs: {written}}}\n"
        )
        records = load_campaign(file).records
        assert isinstance(records, RecordFiles) and records.pairs == read
    file.write_text(
        "buildings: {models: [model.yaml]}\nrecords: {files: [a.csv], pairs: '{}_a.csv'}\n"
    )
    with pytest.raises(
        ModelError, match=r":2:\d+: records.pairs: .*must be two file name patterns"
    ):
        load_campaign(file)


_ENDS = {
    "files": """\
buildings: {models: [m.yaml]}
records: {files: [a.csv], component: N}
intensity: {measure: sa, period: 1, damping: 5%, levels: [0.1 g]}
analysis: {methods: [impulse4], dt: [0.01], duration: 3, tolerance: 1%, collapse_drift: 10%}
""",
    "least": """\
buildings: {inventory: a.csv, rules: mdof-lu, units: {length: m}, stiffness_scatter: 0.5, seed: 0}
records: {grid: g.csv, units: g, neighbors: 1, samples: 1, seed: 0, distance: degrees}
""",
    "most": """\
buildings: {inventory: a.csv, rules: mdof-lu, units: {length: ft}, damping: mass-only, seed: 2147483647}
records: {grid: g.csv, units: g, neighbors: 1000, samples: 100000, seed: 2147483647}
""",  # noqa: E501
    "sequences": """\
buildings: {models: [m.yaml]}
records: {sequences: s.csv, rest: 0}
""",
}


@pytest.mark.parametrize("text", _ENDS.values(), ids=_ENDS)
def test_reader_refuses_values_that_schema_refuses(tmp_path: Path, text: str) -> None:
    """The shortest lists and the bounds of numbers are accepted. Shorter lists and numbers beyond
    the bounds are refused by both."""
    file, schema = tmp_path / "study.yaml", campaign_schema()
    file.write_text(text)
    load_campaign(file)
    assert valid(tree(text), schema)
    cases = spoiled(tree(text), CAMPAIGN)
    assert len(cases) > 10
    for case in cases:
        assert not valid(case, schema), case
        file.write_text(json.dumps(case))
        with pytest.raises(ModelError):
            load_campaign(file)


VALUES = {
    "rules": "mdof-lu", "classes": "a.csv", "as_published": "true", "units": "{length: m}",
    "damping": "full", "stiffness_scatter": "0.1", "damping_scatter": "0.1", "seed": "1",
    "files": "[a.csv]", "pairs": "true", "component": "HNE", "fields": "f.csv", "sites": "s.csv",
    "distance": "5 km", "sequences": "q.csv", "rest": "5", "neighbors": "4", "samples": "3",
    "events": "true", "period": "1", "levels": "[0.1 g]", "pair": "rotd50",
}  # fmt: skip


# Section, its valid keys, refused keys, message
REFUSED = """
buildings -> models: [a.yaml] -> rules classes as_published units damping stiffness_scatter damping_scatter seed -> can only be used with an `inventory`
buildings -> inventory: a.csv, units: {length: m} -> classes as_published -> can only be used with the rules capacity
buildings -> inventory: a.csv, units: {length: m}, rules: capacity, classes: c.csv -> damping stiffness_scatter damping_scatter seed -> cannot be used with the rules capacity
records -> grid: g.csv, units: g, neighbors: 4, samples: 3 -> files pairs component fields sites sequences rest -> can only be used with `files`, `sequences` or `fields`, not with a `grid`
records -> grid: g.csv, units: g, events: true -> neighbors samples seed -> cannot be used with `events`
records -> files: [a.csv] -> neighbors samples seed events -> can only be used with a `grid`
records -> files: [a.csv] -> sites -> can only be used with `fields`
records -> files: [a.csv] -> distance -> can only be used with `fields` or a `grid`
records -> files: [a.csv] -> rest -> can only be used with `sequences`
records -> fields: f.csv -> files sequences rest -> cannot be used with `fields`
records -> fields: f.csv -> distance -> has no effect without `sites`
records -> sequences: q.csv -> files pairs -> cannot be used with `sequences`
intensity -> scales: [1] -> period damping levels pair -> can only be used with a `measure`
intensity -> factors: f.csv -> period damping levels pair -> can only be used with a `measure`
"""  # noqa: E501


@pytest.mark.parametrize("line", REFUSED.strip().splitlines())
def test_keys_of_other_inputs_are_refused(tmp_path: Path, line: str) -> None:
    """Each of these keys is refused at its position; without them, the input is accepted."""
    section, sound_keys, refused, message = line.split(" -> ")
    sections = {
        "buildings": "models: [model.yaml]",
        "records": "files: [a.csv]",
        "intensity": "scales: [1]",
    }
    file = tmp_path / "study.yaml"

    def faults(text: str) -> str:
        file.write_text(
            "".join(
                f"{name}: {{{text if name == section else of}}}\n" for name, of in sections.items()
            )
        )
        try:
            load_campaign(file)
        except ModelError as error:
            return str(error)
        return ""

    assert faults(sound_keys) == ""
    for key in refused.split():
        value = "0.05" if key == "damping" and section == "intensity" else VALUES[key]
        assert f"{section}.{key}: {message}" in faults(f"{sound_keys}, {key}: {value}"), key


@pytest.mark.parametrize("source", ["files: [a.csv]", "fields: f.csv"])
def test_pairs_and_component_exclude_each_other(tmp_path: Path, source: str) -> None:
    file = tmp_path / "study.yaml"
    sound_ones = (
        "",
        ", pairs: true",
        ", component: HNE",
        ", pairs: false",
        ", pairs: false, component: HNE",
    )
    for more in (*sound_ones, ", pairs: true, component: HNE"):
        file.write_text(
            f"buildings: {{models: [a.yaml]}}\nrecords: {{{source}{more}}}\nintensity: {{scales: "
            "[1]}\n"
        )
        if more in sound_ones:
            load_campaign(file)
        else:
            with pytest.raises(
                ModelError, match=r"records\.component: cannot be used with `pairs`"
            ):
                load_campaign(file)
