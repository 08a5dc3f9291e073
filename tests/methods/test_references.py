"""Every method of ours has its publications in full, as its source names them."""

import re

import pytest

from tdint.methods.catalogue import catalogue, references, references_of


@pytest.mark.parametrize("name", catalogue())
def test_sources_of_method_have_references(name):
    """Each year in the source, and each name before a year, is in a reference."""
    method = catalogue()[name]
    found = references_of(method)
    assert found
    years = {int(year) for year in re.findall(r"\b(19\d\d|20\d\d)\b", method.source)}
    assert years <= {int(one.year) for one in found}
    for author in re.findall(r"([A-Z][a-z]+) \(\d{4}\)", method.source):
        assert any(author in one.author for one in found)


def test_references_belong_to_methods_and_have_unique_keys():
    assert references().keys() == catalogue().keys()
    found = {one for of_method in references().values() for one in of_method}
    assert len({one.bibtex.partition(",")[0] for one in found}) == len(found)
    for one in found:
        assert one.bibtex.count("{") == one.bibtex.count("}")
        assert not one.doi or re.fullmatch(r"10\.\d{4}/\S+", one.doi)
