"""What a model file says of a record that is a text table: keys of `excitation.record` named like the options."""

from __future__ import annotations

import math

from tdint.ground_motion.formats.tables.layout import AS_STATED, MOST_LINES, TextLayout
from tdint.model.config.fields import POSITIVE, Section

LAYOUT_KEYS = ("step", "column", "skip_lines")


def read_layout(section: Section) -> TextLayout:
    """What the entries of a section say; nothing if one of them is faulty."""
    step, column, skipped = (section.get(name) for name in LAYOUT_KEYS)
    interval = step.number(POSITIVE) if step else None
    name = column.text() if column else None
    lines = skipped.whole(0, MOST_LINES) if skipped else None
    if (step and math.isnan(interval or math.nan)) or (column and not name) or (skipped and lines is None):
        return AS_STATED
    return TextLayout(interval, (name,) if name else (), lines)
