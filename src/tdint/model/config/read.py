"""Model files: YAML to a checked `Model` in SI units. This is the only place that knows the file's keys and units.

The modules around it share the work: `yaml_source` keeps line and column, `fields` reads numbers and words,
`*_config` read one part of the file each, `definition` holds the result.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TextIO

from tdint.errors import ModelError
from tdint.model.config.damping import read_damping
from tdint.model.config.excitation import read_excitation
from tdint.model.config.fields import ANY, POSITIVE, Section, Value
from tdint.model.config.stories import read_stories
from tdint.model.config.units import ModelUnits, read_units
from tdint.model.config.yaml_source import Faults, decode, parse
from tdint.model.definition import (
    Analysis,
    Damping,
    Excitation,
    Force,
    Initial,
    Law,
    ModalDamping,
    Model,
    RayleighCoefficients,
    RayleighRatio,
    RecordSource,
    Story,
)

__all__ = [
    "Analysis",
    "Damping",
    "Excitation",
    "Force",
    "Initial",
    "Law",
    "ModalDamping",
    "Model",
    "RayleighCoefficients",
    "RayleighRatio",
    "RecordSource",
    "Story",
    "load_model",
]

MAX_BYTES = 16 * 1024 * 1024
"""Size of the largest model file that is read; it keeps a wrong path, such as a device, from filling the memory."""

_KEYS = (
    "name",
    "units",
    "stories",
    "building",
    "damping",
    "p_delta",
    "excitation",
    "initial",
    "analysis",
    "collapse_drift",
)
_DEFAULT_COLLAPSE_DRIFT = 0.10


@dataclass(frozen=True)
class SourceText:
    """A model file as read: how messages call it, its default name, the folder its paths start from, its content."""

    label: str
    name: str
    folder: Path
    data: bytes


def load_model(source: str | Path | TextIO) -> Model:
    """Read a model file.

    Parameters
    ----------
    source : str, Path or text stream
        The YAML file; `-` is standard input. Relative paths in the file start from its folder, those of a stream
        without a file from the working directory.

    Returns
    -------
    Model
        All values in SI units.

    Raises
    ------
    ModelError
        If the file cannot be read, is not YAML or has faults; all faults are reported in one error, in file order.
        Its keys count list entries from 1 as they stand in the file: `stories[2]` is the second entry of `stories`,
        whatever `repeat` the first one has.
    """
    origin = read_source(source)
    faults = Faults(origin.label)
    root = Value(parse(decode(origin.data, faults), faults), "", faults)
    section = root.section(_KEYS)
    model = _read_model(section, origin) if section else None
    faults.raise_if_any()
    assert model is not None
    return model


def read_source(source: str | Path | TextIO) -> SourceText:
    if source is sys.stdin or (isinstance(source, str | Path) and str(source) == "-"):
        if sys.stdin is None:
            raise ModelError("-: standard input is closed; give a model file")
        return SourceText("-", "model", Path(), _read_stream(getattr(sys.stdin, "buffer", sys.stdin), "-"))
    if isinstance(source, str | Path):
        path, label = Path(source), str(source) or "."
        return SourceText(label, path.stem, path.parent, _read_file(path, label))
    if not hasattr(source, "read"):
        raise ModelError(f"a model is a file's name or a text stream, not {type(source).__name__}")
    name = getattr(source, "name", None)
    if isinstance(name, str) and not name.startswith("<"):
        return SourceText(name, Path(name).stem, Path(name).parent, _read_stream(source, name))
    return SourceText("<stream>", "model", Path(), _read_stream(source, "<stream>"))


def _read_file(path: Path, label: str) -> bytes:
    try:
        with path.open("rb") as stream:
            return _read_stream(stream, label)
    except FileNotFoundError:
        raise ModelError(f"{label}: no such file; give a model file (YAML) or - for standard input") from None
    except IsADirectoryError:
        raise ModelError(f"{label}: is a folder; give a model file (YAML) in it") from None
    except OSError as error:
        raise ModelError(f"{label}: cannot be read: {error.strerror or error}") from None
    except ValueError:
        raise ModelError(f"{label}: cannot be read: no file has a null character in its name") from None


def _read_stream(stream: TextIO | BinaryIO, label: str) -> bytes:
    try:
        content = stream.read(MAX_BYTES + 1)
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{label}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > MAX_BYTES:
        raise ModelError(f"{label}: larger than {MAX_BYTES // 1024**2} MiB; this is no model file")
    # Surrogates stand for bytes that the stream could not decode; passed on, `decode` finds them.
    return content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content


def _read_model(section: Section, origin: SourceText) -> Model:
    """The model; faults are noted, and leave nan or None behind."""
    unit = read_units(section.get("units"))
    p_delta_value = section.get("p_delta")
    p_delta = p_delta_value.boolean() if p_delta_value else False
    stories, count, damping = _read_stories(section, unit, p_delta)
    excitation = section.get("excitation")
    model = Model(
        name=section.text("name") or origin.name,
        source=origin.label,
        text=origin.data,
        stories=stories,
        damping=damping,
        p_delta=p_delta,
        excitation=read_excitation(excitation, unit, count, origin.folder),
        initial=_read_initial(section.get("initial"), unit.length, count),
        analysis=_read_analysis(section.get("analysis")),
        collapse_drift=section.number("collapse_drift", POSITIVE, default=_DEFAULT_COLLAPSE_DRIFT),
    )
    record = model.excitation.record
    if origin.label == "-" and record and record.file == "-" and excitation:
        excitation.fault("standard input already holds the model; give the record as a file")
    return model


def _read_stories(section: Section, unit: ModelUnits, p_delta: bool) -> tuple[tuple[Story, ...], int | None, Damping]:
    """Stories, their number and the damping: as they are written out, or as rules derive them of a `building`."""
    building, damping = section.get("building"), section.get("damping")
    if building is None:
        advice = "give a list with one entry per story, or a building in its place"
        entries = section.get("stories") if section.mentions("building") else section.need("stories", advice)
        stories, count = read_stories(entries, unit, p_delta)
        return stories, count, read_damping(damping, count)
    from tdint.model.config.building import read_building  # needs numpy, which other models are read without

    derived = read_building(building, unit)
    if section.has("stories"):
        building.fault("stands in place of `stories`; give one of the two")
    if derived is None:
        return (), None, None
    count = len(derived.stories)
    return derived.stories, count, read_damping(damping, count) if damping else derived.damping


def _read_initial(value: Value | None, length: float, count: int | None) -> Initial:
    section = value.section(("displacement", "velocity")) if value else None

    def entries(name: str) -> tuple[float, ...]:
        entry = section.get(name) if section else None
        if entry is None:
            return (0.0,) * (count or 0)
        items = entry.items("a list with one number per story")
        if items is not None and count is not None and len(items) != count:
            entry.fault(f"must have one number per story ({count}), got {len(items)}")
        return tuple(item.number(ANY, length) for item in items or ())

    return Initial(entries("displacement"), entries("velocity"))


def _read_analysis(value: Value | None) -> Analysis:
    section = value.section(("method", "dt", "duration")) if value else None
    if section is None:
        return Analysis(None, None, None)

    def positive(name: str) -> float | None:
        number = section.number(name, POSITIVE, default=math.nan)
        return None if math.isnan(number) else number

    return Analysis(section.text("method"), positive("dt"), positive("duration"))
