"""Publications of the methods, read from `publications.bib`."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from tdint.methods.method import Method

# Field of a BibTeX entry: name and value
_FIELD = r"  (\w+) = \{+(.*?)\}+,\n"


class Publication(NamedTuple):
    """Bibliographic data of a publication, an entry of `publications.bib`.

    Attributes
    ----------
    key : str
        Name of the entry.
    author : str
        Authors in BibTeX format, separated by `and`; empty if unknown.
    howpublished : str
        Journal with volume, number and pages, or report.
    doi : str
        Digital object identifier; empty if it is not confirmed.
    """

    key: str
    year: str
    title: str
    howpublished: str
    author: str = ""
    doi: str = ""

    @property
    def text(self) -> str:
        """Citation in one line, without the DOI."""
        authors = self.author.replace(" and ", "; ")
        head = f"{self.title} ({self.year})"
        if authors:
            head = f"{authors} ({self.year}). {self.title}"
        return f"{head}. {self.howpublished}."


@cache
def references() -> dict[str, tuple[Publication, ...]]:
    """Return the publications of each built-in method, read from `publications.bib`.

    The field `keywords` of an entry lists the names of the methods that it describes. The result,
    by the name of the method, is cached.
    """
    publications: dict[str, tuple[Publication, ...]] = {}
    text = (files("tdint.methods") / "publications.bib").read_text(encoding="utf-8")
    _, *entries = text.split("\n\n")  # the first paragraph is a comment
    for entry in entries:
        fields = dict(re.findall(_FIELD, entry))
        methods = fields.pop("keywords").split(", ")
        publication = Publication(entry.partition("{")[2].partition(",")[0], **fields)
        for method in methods:
            publications[method] = (*publications.get(method, ()), publication)
    return publications


def references_of(method: Method) -> tuple[Publication, ...]:
    """Return the publications of a method; empty for a plug-in, which has only its `source`."""
    return references().get(method.name, ())
