"""What campaign files are refused for, with line and column."""

from __future__ import annotations

from pathlib import Path

import pytest

from tdint.campaign.reader import load_campaign
from tdint.errors import ModelError

STUDY = """\
buildings: {models: [model.yaml]}
records: {files: [a.csv]}
intensity: {measure: pga, %s}
analysis: {%s}
"""


@pytest.mark.parametrize(
    ("intensity", "analysis", "said"),
    [
        ("levels: [1e308 g]", "", ":3:36: intensity.levels[1]: must be from 1e-06 to 1e+06"),
        ("levels: [1e-320 g]", "", ":3:36: intensity.levels[1]: must be"),
        ("levels: [0.1 g]", "tolerance: 0", ":4:23: analysis.tolerance: must be"),
        ("levels: [0.1 g], pair: rotd50", "", "intensity.pair: has nothing to act on without `pairs: true`"),
    ],
)
def test_numbers_and_words_without_a_meaning(tmp_path: Path, intensity: str, analysis: str, said: str) -> None:
    file = tmp_path / "study.yaml"
    file.write_text(STUDY % (intensity, analysis))
    with pytest.raises(ModelError) as caught:
        load_campaign(file)
    assert said in str(caught.value) and len(str(caught.value).splitlines()) == 1
