"""Peaks of stories made by hand."""

from dataclasses import fields
from typing import TypeVar

import numpy as np

Values = TypeVar("Values")


def story_values(kind: type[Values], **values: np.ndarray) -> Values:
    """Return an object of a class of quantities of stories, with nan for quantities without values,
    so that tests need not know all quantities."""
    size = len(next(iter(values.values())))
    missing = {item.name: np.full(size, np.nan) for item in fields(kind)}
    return kind(**{**missing, **values})
