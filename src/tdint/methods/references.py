"""Where the methods were published, in full, as `publications.bib` has it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from tdint.methods.method import Method

_FIELD = re.compile(r"  (\w+) = \{+(.*?)\}+,\n")
_KEYWORDS = re.compile(r"  keywords = .*\n")


@dataclass(frozen=True)
class Publication:
    """A publication.

    Attributes
    ----------
    bibtex : str
        Its entry of BibTeX.
    author : str
        As BibTeX takes them, `and` between them; empty where they are not known.
    howpublished : str
        Journal with volume, number and pages, or the report.
    doi : str
        Empty where it is not known for sure.
    """

    bibtex: str
    year: str
    title: str
    howpublished: str
    author: str = ""
    doi: str = ""

    @property
    def text(self) -> str:
        """In one line."""
        authors = self.author.replace(" and ", "; ")
        head = f"{authors} ({self.year}). {self.title}" if authors else f"{self.title} ({self.year})"
        return f"{head}. {self.howpublished}." + (f" doi:{self.doi}" if self.doi else "")


@cache
def references() -> dict[str, tuple[Publication, ...]]:
    """The publications of each method of ours, which an entry of the file names among its keywords."""
    publications: dict[str, tuple[Publication, ...]] = {}
    _, *entries = (files("tdint.methods") / "publications.bib").read_text(encoding="utf-8").split("\n\n")
    for entry in entries:
        fields = dict(_FIELD.findall(entry))
        methods = fields.pop("keywords").split(", ")
        publication = Publication(_KEYWORDS.sub("", entry).rstrip() + "\n", **fields)
        publications |= {method: (*publications.get(method, ()), publication) for method in methods}
    return publications


def references_of(method: Method) -> tuple[Publication, ...]:
    """The publications of a method; none for one of a plug-in, which has its `source` alone."""
    return references().get(method.name, ())
