"""What a model file says of a record that is a text table: keys of `excitation.record` named like the options."""

from __future__ import annotations

import math

from tdint.ground_motion.text_layout import AS_STATED, MOST_LINES, TextLayout
from tdint.model.keys.fields import Section
from tdint.model.keys.kinds import POSITIVE, Key, Whole, Words

LAYOUT = (
    Key("step", POSITIVE, "sampling interval of a text table that does not tell it, s"),
    Key("column", Words(), "column of a text table: its name, or its number from 1"),
    Key("skip_lines", Whole(0, MOST_LINES), "lines before the numbers"),
)


def read_layout(section: Section) -> TextLayout:
    """What the entries of a section say; nothing if one of them is faulty."""
    step, column, skipped = (section.get(key.name) for key in LAYOUT)
    interval = step.number() if step else None
    name = column.text() if column else None
    lines = skipped.whole() if skipped else None
    if (step and math.isnan(interval or math.nan)) or (column and not name) or (skipped and lines is None):
        return AS_STATED
    return TextLayout(interval, (name,) if name else (), lines)
