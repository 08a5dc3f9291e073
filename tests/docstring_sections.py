"""Entries of the sections of NumPy docstrings."""

import inspect
import re

SECTION = re.compile(r"^([A-Z][A-Za-z ]+)\n-{3,}\n", re.MULTILINE)
ENTRY = re.compile(r"^(\S[^\n]*)((?:\n(?: .*|(?=\n)))*)", re.MULTILINE)


def entries(docstring, section="Parameters"):
    """Return names, type and description of each entry of a section."""
    parts = SECTION.split(inspect.cleandoc(docstring))
    found = []
    for title, content in zip(parts[1::2], parts[2::2], strict=True):
        if title != section:
            continue
        for head, text in ENTRY.findall(content):
            names, _, kind = head.partition(" : ")
            found.append((names.replace("*", "").split(", "), kind, " ".join(text.split())))
    return found
