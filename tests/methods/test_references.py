"""Every method of ours has its publications in full, as its source names them."""

import re

import pytest

from tdint.methods.catalogue import catalogue
from tdint.methods.publications import references, references_of


@pytest.mark.parametrize("name", catalogue())
def test_sources_of_method_have_references(name):
    """Each year in the source, and each name before a year, is in a reference."""
    method = catalogue()[name]
    found = references_of(method)
    assert found
    years = {int(year) for year in re.findall(r"\b(19\d\d|20\d\d)\b", method.source)}
    assert years <= {int(reference.year) for reference in found}
    for author in re.findall(r"([A-Z][a-z]+) \(\d{4}\)", method.source):
        assert any(author in reference.author for reference in found)


def test_references_belong_to_methods_and_have_unique_keys():
    assert references().keys() == catalogue().keys()
    found = {reference for entries in references().values() for reference in entries}
    assert len({reference.key for reference in found}) == len(found)
    for reference in found:
        assert not reference.doi or re.fullmatch(r"10\.\d{4}/\S+", reference.doi)
