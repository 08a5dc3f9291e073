"""Campaign files: YAML to a checked `CampaignFile`, with the same reader as models."""

from __future__ import annotations

from pathlib import Path

from tdint.campaign.file.buildings import BUILDINGS, read_buildings
from tdint.campaign.file.definition import AnalysisWishes, CampaignFile, ModelFiles, RecordFiles
from tdint.campaign.file.intensity import INTENSITY, read_intensity
from tdint.campaign.file.records import RECORDS, read_records_section
from tdint.campaign.levels import Scales
from tdint.campaign.studies.suite import RecordChoice
from tdint.methods.catalogue import parse as parse_method
from tdint.model.keys.document import read_document
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import POSITIVE, POSITIVE_RATIO, RATIO, Flag, Key, Keys, Schema, Words

_ANALYSIS = Keys(
    (
        Key("method", Words(), "time-integration method with its parameters, for all buildings"),
        Key("dt", POSITIVE, "time step, s; that of each model, else of each record, where it is left out"),
        Key("duration", POSITIVE, "time to integrate, s"),
        Key("tolerance", RATIO, "choose the step of each building by the error of its peak drifts"),
        Key("collapse_drift", POSITIVE_RATIO, "drift ratio beyond which a run counts as collapsed"),
        Key("p_delta", Flag(), "whether gravity acts on the displaced buildings"),
        Key("until_rest", Flag(), "go on with the ground at rest until the motion has died"),
    )
)
_OUTPUTS = Keys((Key("stories", Flag(), "keep the peaks of every story"),))
CAMPAIGN = Keys(
    (
        Key("name", Words(), "the campaign's name; that of the file where it is left out"),
        Key("buildings", BUILDINGS, "model files, or an inventory", needed=True),
        Key("records", RECORDS, "files and folders, or a grid", needed=True),
        Key("intensity", INTENSITY, "how strong the motions are made; as they are where it is left out"),
        Key("analysis", _ANALYSIS, "what is the same for all runs"),
        Key("outputs", _OUTPUTS, "what is kept beside a row for each run"),
    )
)
"""The keys of a campaign file, and what may stand under them."""


def campaign_schema() -> Schema:
    """The JSON schema (draft 7) of campaign files, for editors."""
    about = "Runs of buildings under ground motions for tdint"
    draft = "http://json-schema.org/draft-07/schema#"
    return {"$schema": draft, "title": "tdint campaign", "description": about, **CAMPAIGN.schema()}


def load_campaign(source: str | Path) -> CampaignFile:
    """Read a campaign file; the files that it names are not read yet.

    Parameters
    ----------
    source : str or Path
        The YAML file; `-` is standard input. Relative paths in it start from its folder.

    Raises
    ------
    ModelError
        It cannot be read, is not YAML, or has faults: all of them, with line and column.
    """
    origin, root = read_document(source, "campaign file", "`buildings` and `records`")
    section = root.section(CAMPAIGN)
    campaign = _read(section, origin.label, origin.name, origin.folder) if section else None
    root.faults.raise_if_any()
    assert campaign is not None
    return campaign


def _read(section: Section, label: str, name: str, folder: Path) -> CampaignFile:
    buildings = section.need("buildings", "give `models` or an `inventory`")
    records = section.need("records", "give `files` or a `grid`")
    outputs = section.get("outputs")
    kept = outputs.section(_OUTPUTS) if outputs else None
    stories = kept.get("stories") if kept else None
    return CampaignFile(
        name=section.text("name") or name,
        source=label,
        buildings=(read_buildings(buildings, folder) if buildings else None) or ModelFiles(()),
        records=(read_records_section(records, folder) if records else None) or RecordFiles((), RecordChoice()),
        intensity=read_intensity(section.get("intensity"), folder) or Scales((1.0,)),
        analysis=_read_analysis(section.get("analysis")),
        stories=stories.boolean() if stories else False,
    )


def _read_analysis(value: Value | None) -> AnalysisWishes:
    section = value.section(_ANALYSIS) if value else None
    if section is None:
        return AnalysisWishes()
    method = section.get("method")
    named = method.parsed(parse_method) if method else None
    p_delta, until_rest = section.get("p_delta"), section.get("until_rest")
    return AnalysisWishes(
        method=named.label if named else None,
        dt=section.number_or_none("dt"),
        duration=section.number_or_none("duration"),
        tolerance=section.number_or_none("tolerance"),
        collapse_drift=section.number_or_none("collapse_drift"),
        p_delta=p_delta.boolean() if p_delta else None,
        until_rest=until_rest.boolean() if until_rest else False,
    )
