"""The table of notions names modules, tests and columns that exist, and each notion once."""

import re
from collections import Counter

import tdint
from notions.test_routes import HERE, NOTIONS
from readmes import ROOT
from tdint.ground_motion import record
from tdint.response.runs import damage, demands, elements, loop_results, outcome

MODULES = tdint, damage, demands, elements, loop_results, outcome, record
PARAMETERS = ("jobs", "scales", "pair")
"""Parameters of several functions."""


def rows():
    """Yield the cells of each notion; a notion without a test has the test of the routes."""
    for line in NOTIONS.read_text().splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split(" | ")]
        if line.startswith("| ") and cells[0] != "notion":
            yield [*cells[:-1], cells[-1] or HERE]


def test_each_notion_has_an_owner_and_a_test_that_exist():
    assert {len(cells) for cells in rows()} == {6}
    assert set(Counter(cells[0] for cells in rows()).values()) == {1}
    for *_, owners, test in rows():
        for owner in re.findall(r"`([^`]+)`", owners):
            module = ROOT / "src/tdint" / owner
            assert module.with_suffix(".py").exists() or module.is_dir(), owner
        assert (ROOT / test).exists(), test
        assert re.search(r"^ *def test_", (ROOT / test).read_text(), re.MULTILINE)


def test_columns_of_the_table_are_columns_of_the_program():
    declared = (ROOT / "cli/COLUMNS.md").read_text()
    for _, columns, *_ in rows():
        for column in re.findall(r"`(\w+_(?:m|N|J|s|m_s|m_s2))`", columns):
            if not column.startswith(("energy_", "roof_displacement", "base_shear", "total_base")):
                assert f"`{column}`" in declared, column


def test_python_names_of_the_table_are_public():
    for _, _, names, *_ in rows():
        for name in re.findall(r"`(\w+(?:\.\w+)?)[`(]", names):
            owner, _, attribute = name.partition(".")
            if not attribute and owner[0].islower():
                assert hasattr(tdint, owner) or owner in PARAMETERS, name
            elif attribute:
                known = [getattr(module, owner) for module in MODULES if hasattr(module, owner)]
                assert known, name
                fields = {*dir(known[0]), *getattr(known[0], "__dataclass_fields__", ())}
                assert attribute in fields, name
