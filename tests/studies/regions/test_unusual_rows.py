"""Warnings about the rows of an inventory name file, line and column."""

from __future__ import annotations

from pathlib import Path

import pytest

from selection import every
from tdint.model.capacity import read_classes
from tdint.model.mdof_lu import STRUCTURES, USUAL_STORIES
from tdint.studies.regions.inventory import read_inventory, unusual_rows

HEADER = "id,NumberOfStories,YearBuilt,StructureType,PlanArea,height\n"


def warnings_of(folder: Path, lines: list[str], length: float = 1.0) -> list[str]:
    """Return the warnings about an inventory without its directory; all rows are valid."""
    file = folder / "b.csv"
    file.write_text(HEADER + "".join(f"{number},{line}\n" for number, line in enumerate(lines)))
    rows, faults = read_inventory(str(file), length)
    assert not faults and len(rows) == len(lines)
    return [line.removeprefix(f"{folder}/") for line in unusual_rows(rows, "mdof-lu")]


@pytest.mark.parametrize(
    ("structure", "stories", "usual"),
    [
        ("W1", 3, "1 to 2 stories"), ("MH", 2, "one story"), ("URM", 8, "1 to 7 stories"),
        ("RM1", 9, "1 to 7 stories"), ("S3", 8, "1 to 2 stories"), ("PC1", 12, "1 to 3 stories"),
        ("W2", 20, "1 to 6 stories"),
    ],
)  # fmt: skip
def test_number_of_stories_is_compared_with_the_type(
    tmp_path: Path, structure: str, stories: int, usual: str
) -> None:
    sound = [f"{USUAL_STORIES[structure][1]},1990,{structure},100,"]
    assert warnings_of(tmp_path, [*sound, f"{stories},1990,{structure},100,"]) == [
        f"b.csv:3:2: NumberOfStories: {stories} stories are unusual for {structure}, which has "
        f"{usual}; check the number of stories and the type"
    ]


@pytest.mark.parametrize("year", every(2, [1960, 1930, 2005]))
@pytest.mark.parametrize("height", every(2, ["", "4", "3", "2.7"]))
def test_usual_buildings_of_all_types_have_no_warning(
    tmp_path: Path, year: int, height: str
) -> None:
    lines = [
        f"{stories},{year},{structure},300,{height and stories * float(height)}"
        for structure in STRUCTURES
        for low, high in [USUAL_STORIES.get(structure, (1, 40))]
        for stories in range(low, high + 1)
    ]
    assert warnings_of(tmp_path, lines) == []


def test_height_is_that_of_the_building(tmp_path: Path) -> None:
    lines = ["3,1990,C1,500,10.5", "3,1990,C1,500,105", "20,1990,S1,500,3.5"]
    high, low = warnings_of(tmp_path, lines)
    assert high.startswith("b.csv:3:6: height: unusual story height: 35 m; usual values are ")
    assert low.startswith("b.csv:4:6: height: unusual story height: 0.175 m; ")
    # 10.5 ft are 1.07 m in each story.
    (line, *_) = warnings_of(tmp_path, lines[:1], 0.3048)
    assert line.startswith("b.csv:2:6: height: unusual story height: 1.07 m; ")


def test_period_and_drifts_are_compared_with_the_height(tmp_path: Path) -> None:
    """S1 with 8 and more stories has .17 s per story. Fourteen stories of 21.1 m with 2.38 s are
    above the limit .42 + .092 * 21.1 = 2.36 s; twelve stories of 18.1 m with 2.04 s are not."""
    lines = ["10,1990,S1,500,15.5", "12,1990,S1,500,18.1"]
    (line,) = warnings_of(tmp_path, [*lines, "14,1990,S1,500,21.1"]) or ["none"]
    assert line.startswith(
        "b.csv:4:2: NumberOfStories: unusual fundamental period of 14 stories and 21.1 m: 2.38 s; "
    )


def test_ultimate_drift_of_a_class_is_compared_with_the_story_height(tmp_path: Path) -> None:
    """One story with the curve of its class, in millimeters instead of meters: 8 and 80 m."""
    (tmp_path / "classes.csv").write_text(
        "class,sd_m,sa_g\nsound,0.008,0.2\nsound,0.08,0.3\nwrong,8,200\nwrong,80,300\n"
    )
    (tmp_path / "b.csv").write_text("id,class,NumberOfStories\na,sound,1\nb,wrong,1\n")
    classes = read_classes(str(tmp_path / "classes.csv"))
    rows, _ = read_inventory(str(tmp_path / "b.csv"), 1.0, classes=classes)
    lines = [line.partition("b.csv:")[2] for line in unusual_rows(rows, "capacity")]
    # The height of a story is 2.8 m.
    assert [line.partition(";")[0] for line in lines] == [
        "3:3: NumberOfStories: unusual ratio of the yield drift to the story height: 2.86",
        "3:3: NumberOfStories: unusual ratio of the ultimate drift to the story height: 28.6",
    ]


def test_many_unusual_rows_are_counted(tmp_path: Path) -> None:
    lines = warnings_of(tmp_path, ["5,1990,W1,100,"] * 5000)
    assert len(lines) == 11
    assert lines[9].startswith("b.csv:11:2: ")
    assert lines[10].endswith("b.csv: 4990 more unusual values, 5000 in total")
