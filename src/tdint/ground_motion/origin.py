"""Origin of ground motions that tdint wrote: seed, factor, target and changes.

`tdint match` and `tdint info --export` write the origins to the JSON file next to the motions.
`tdint match` also writes them to a header line of AT2 and CSV files, which a file keeps without its
JSON file. Both contain a checksum of the described motion, so that an edited motion has no origin.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tdint.errors import RecordError
from tdint.files import MOST_BYTES, is_file, read_at_most, record_digest
from tdint.number_parsing import number_text, pluralize

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

MATCHED = "matched"
"""Name of the files with table and JSON of matched motions, without suffix."""

WRITTEN = "written_motions"
"""Key of the JSON file with an entry for each component: file, SHA-256, id and origin."""

_CHECKSUM = "samples_sha256"
"""Key of the checksum of the samples in a header line."""

_LONGEST_STATEMENT = 900
"""Characters; readers of header lines omit the end of longer lines."""


_ALWAYS_STATED = ("seed", "seed_component", "factor", "processing")
_STATED_IF_MATCHED = ("target", "change", "largest_misfit", "mean_misfit", "warnings")
"""Keys of an origin in a JSON file: of every motion, and of matched motions."""


class MotionOrigin(NamedTuple):
    """Origin of a component of a ground motion that tdint wrote.

    Attributes
    ----------
    seed, seed_component : str
        File and component of the record that the motion was made from.
    processing : tuple of str
        Steps of processing, one sentence per step.
    target : str
        Target spectrum of a matched motion; empty for a motion that was only processed.
    factor : float
        Scale factor of the seed.
    change : float
        Root mean square of the change by matching relative to the scaled seed; nan without
        matching.
    largest_misfit, mean_misfit : float
        Maximum and mean absolute misfit of the spectrum to the target at all damping ratios; nan
        without matching.
    warnings : tuple of str
        Warnings about the matched motion: a large misfit or change, a doubtful baseline.
    """

    seed: str
    seed_component: str = ""
    processing: tuple[str, ...] = ()
    target: str = ""
    factor: float = 1.0
    change: float = math.nan
    largest_misfit: float = math.nan
    mean_misfit: float = math.nan
    warnings: tuple[str, ...] = ()

    @property
    def summary(self) -> dict[str, Any]:
        """Content of the origin in a JSON file; numbers that do not apply are omitted."""
        values = self._asdict()
        names = _ALWAYS_STATED + (_STATED_IF_MATCHED if self.target else ())
        return {
            name: list(values[name]) if isinstance(values[name], tuple) else values[name]
            for name in names
        }

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> MotionOrigin:
        """Return the origin from the content of a JSON file (`summary`).

        Raises
        ------
        LookupError, TypeError, ValueError
            The content was not written by tdint.
        """
        values: dict[str, Any] = {}
        matched = [name for name in _STATED_IF_MATCHED if name in content]
        for name in (*_ALWAYS_STATED, *matched):
            default = cls._field_defaults.get(name, "")
            value = map(str, content[name]) if isinstance(default, tuple) else content[name]
            values[name] = type(default)(value)
        return cls(**values)

    @property
    def text(self) -> str:
        """Description of a matched motion for a note; empty for a motion that was only
        processed."""
        if not self.target:
            return ""
        seed = f"{self.seed} {self.seed_component}".rstrip()
        warnings = f"; warnings of the match: {'; '.join(self.warnings)}" if self.warnings else ""
        return (
            f"matched to {self.target}: seed {seed} times {self.factor:.3g}, change "
            f"{change_text(self.change)} of the scaled seed (root mean square), largest misfit "
            f"{100.0 * self.largest_misfit:.2g} %{warnings}"
        )


def change_text(change: float) -> str:
    """Return the change of a motion by matching in percent: two digits, or the integer percent from
    99.5 % on (`104 %`)."""
    percent = 100.0 * change
    return f"{percent:.0f} %" if percent >= 99.5 else f"{percent:.2g} %"


def written_motion(file: str, content: bytes, id: str, origin: MotionOrigin) -> dict[str, Any]:
    """Return the entry of a component for the list `WRITTEN` of a JSON file.

    Parameters
    ----------
    content : bytes
        Content of the file, for its SHA-256.
    id : str
        Network, station, location and channel of the component; needed if the file has several
        components.
    """
    from hashlib import sha256

    digest = sha256(content).hexdigest()
    return {"file": file, "sha256": digest, "id": id, "origin": origin.summary}


def origin_of(file: str, digest: str, id: str) -> tuple[MotionOrigin, str, str] | None:
    """Return the origin of a component of a file, and the JSON file that states it.

    The JSON file is `matched.json` in the directory of the file, or has the name of the file with
    the suffix `.json`.

    Parameters
    ----------
    id : str
        Network, station, location and channel of the component, joined by dots.

    Returns
    -------
    tuple of (MotionOrigin, str, str), or None
        Origin; name and SHA-256 of the JSON file. None if no JSON file states the origin of the
        specified content.
    """
    path = Path(file)
    for sidecar in (path.parent / f"{MATCHED}.json", path.with_suffix(".json")):
        if sidecar == path or not is_file(sidecar):
            continue
        # A file that is not a JSON file of tdint belongs to the user and is not an error.
        with suppress(OSError, ValueError, LookupError, TypeError, RecursionError):
            # Imported here, because few motions have such a file.
            import json

            data = read_at_most(sidecar, MOST_BYTES, RecordError)
            entries = [entry for entry in json.loads(data)[WRITTEN] if entry["sha256"] == digest]
            if len(entries) > 1:
                entries = [entry for entry in entries if entry["id"] == id]
            if entries:
                from hashlib import sha256

                origin = MotionOrigin.of(entries[0]["origin"])
                # The spelling of the user is kept, for example a leading "./".
                name = os.path.join(os.path.dirname(file), sidecar.name)  # noqa: PTH118, PTH120
                record_digest(name, data)
                return origin, name, sha256(data).hexdigest()
    return None


def header_statement(origin: MotionOrigin, samples: ArrayLike) -> str:
    """Return the statement of an origin for one line of a file header: a JSON object.

    If the line would be too long, the steps of processing and then the texts of the warnings are
    omitted; if it is still too long, the statement is empty.

    Parameters
    ----------
    samples : array_like, shape (samples,)
        Samples with the digits and the units of the file.
    """
    import json

    count = len(origin.warnings)
    counted = (f"{pluralize(count, 'warning')} stated by tdint match",) if count else ()
    without_steps = origin._replace(processing=())
    for stated in (origin, without_steps, without_steps._replace(warnings=counted)):
        # The JSON file next to the motion has the same digits.
        content = {
            name: float(f"{value:.12g}") if isinstance(value, float) else value
            for name, value in stated.summary.items()
        }
        text = json.dumps(content | {_CHECKSUM: _checksum(samples)})
        if len(text) <= _LONGEST_STATEMENT:
            return text
    return ""


def stated_origin(statement: str, samples: ArrayLike) -> MotionOrigin | None:
    """Return the origin from a header line.

    Parameters
    ----------
    samples : array_like, shape (samples,)
        Samples of the file, in its units.

    Returns
    -------
    MotionOrigin | None
        None if the line states no origin, or if the samples have been changed.
    """
    if not statement:
        return None
    # A text that tdint did not write is not an error.
    with suppress(ValueError, LookupError, TypeError, RecursionError):
        import json

        content = json.loads(statement)
        if content[_CHECKSUM] == _checksum(samples):
            return MotionOrigin.of(content)
    return None


def _checksum(samples: ArrayLike) -> str:
    """Return the first 16 digits of the SHA-256 of samples, as little-endian numbers of 64 bits."""
    from hashlib import sha256

    # Imported here, because the help of commands does not need it.
    import numpy as np

    return sha256(np.asarray(samples, dtype="<f8").tobytes()).hexdigest()[:16]


def matched_clause(
    origins_of_records: Iterable[MotionOrigin | None], count: int, name: Callable[[str], str] = str
) -> str:
    """Return a clause on the matched motions of a suite of `count` components; empty without
    matched motions.

    For example `matched to ec8:... (seed factors 0.42 to 4.7)`. `name` is a function that returns
    the printed name of a target; by default, the target is stated as on the command line.
    """
    origins = [origin for origin in origins_of_records if origin and origin.target]
    if not origins:
        return ""
    targets = list(dict.fromkeys(origin.target for origin in origins))
    target = name(targets[0]) if len(targets) == 1 else pluralize(len(targets), "target")
    factors = sorted(origin.factor for origin in origins)
    low, high = (number_text(factor, 3) for factor in (factors[0], factors[-1]))
    factor_text = f"seed factor {low}" if low == high else f"seed factors {low} to {high}"
    if len(origins) < count:
        share = f"{len(origins)} of {pluralize(count, 'component')}"
        return f"partly matched to {target} ({share}, {factor_text})"
    return f"matched to {target} ({factor_text})"
