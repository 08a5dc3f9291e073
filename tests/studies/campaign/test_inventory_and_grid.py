"""Inventories as buildings of a campaign, and ground motions that are sampled from a grid."""

import io
import json
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import tdint
from tdint.errors import ModelError, RecordError, TdintError
from tdint.ground_motion.record import Record
from tdint.studies.campaign.assigned_motions import GridFile, GridMotions
from tdint.studies.campaign.chunks import RunRow, run_chunk
from tdint.studies.campaign.inputs import read_inputs
from tdint.studies.campaign.plan import Plan, make_plan
from tdint.studies.campaign.reader import load_campaign
from tdint.studies.regions.inventory import NEEDED, derive_all, model_text, read_inventory
from tdint.units import STANDARD_GRAVITY

STUDY = """\
buildings: {inventory: buildings.csv, units: {length: ft}}
records: {grid: EventGrid.csv, units: g, neighbors: 2, samples: 4, seed: 7}
intensity: {scales: [1, 2]}
analysis: {method: newmark-average}
outputs: {stories: true}
"""
BUILDINGS = """\
id,NumberOfStories,YearBuilt,StructureType,PlanArea,Latitude,Longitude
a,2,1968,C1,12000,37.80,-122.27
b,1,1975,W1,1500,37.81,-122.26
c,3,1931,URM,4500,37.805,-122.265
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """Write a campaign.yaml with three buildings and a grid of three points, each with two motions
    of two components."""
    random = np.random.default_rng(3)
    (tmp_path / "campaign.yaml").write_text(STUDY)
    (tmp_path / "buildings.csv").write_text(BUILDINGS)
    points = ["GP_file,Longitude,Latitude"]
    for point, (longitude, latitude) in enumerate(
        [(-122.26, 37.81), (-122.27, 37.80), (-360.0, -90.0)]
    ):
        points.append(f"site{point}.csv,{longitude},{latitude}")
        (tmp_path / f"site{point}.csv").write_text(
            f"TH_file,factor\nm{point}0,1.0\nm{point}1,0.5\n"
        )
        for motion in range(2):
            data = {"name": f"m{point}{motion}", "dT": 0.01}
            for component in ("data_x", "data_y"):
                data[component] = (0.1 * random.standard_normal(200)).tolist()
            (tmp_path / f"m{point}{motion}.json").write_text(json.dumps(data))
    (tmp_path / "EventGrid.csv").write_text("\n".join(points) + "\n")
    return tmp_path


def plan(folder: Path) -> Plan:
    campaign = load_campaign(folder / "campaign.yaml")
    return make_plan(campaign, read_inputs(campaign))


def rows_of(plan: Plan) -> list[RunRow]:
    return [row for number in range(plan.chunks) for row in run_chunk(plan.chunk(number)).rows.runs]


def models(folder: Path) -> Iterator[tdint.Model]:
    """Return the model files that `tdint inventory --models` writes for the rows."""
    rows, _ = read_inventory(str(folder / "buildings.csv"), 0.3048)
    for derived in derive_all(rows, "mdof-lu"):
        yield tdint.load_model(io.StringIO(model_text(derived.row.id, derived.building, "mdof-lu")))


def check_strongest_run(
    folder: Path, plan: Plan, done: list[RunRow], building: int, model: tdint.Model
) -> None:
    """Check that the strongest run of a building equals a run of the model under the samples of the
    file times g."""
    row = max((row for row in done if row.building == building), key=lambda row: row.scale)
    motion = plan.motions[row.motion]
    samples = json.loads((folder / f"{motion.name}.json").read_text())[f"data_{motion.component}"]
    record = Record(row.scale * STANDARD_GRAVITY * np.array(samples), 0.01, "", "", "", "")
    response = tdint.run(model, record, method="newmark-average")
    np.testing.assert_allclose(
        row.peak_drift_ratio, response.stories.peak_drift_ratio.max(), rtol=1e-9
    )
    np.testing.assert_allclose(row.pga, record.pga, rtol=1e-12)


def test_runs_equal_runs_of_exported_models(study: Path) -> None:
    """A run of a row equals the run of the model that `tdint inventory --models` writes, under the
    motion times g."""
    campaign = plan(study)
    assert campaign.runs == 3 * 4 * 2 * 2  # buildings, samples, components, scales
    done = rows_of(campaign)
    assert len(done) == campaign.runs == len({row[:4] for row in done})
    for number, model in enumerate(models(study)):
        assert campaign.buildings[number].subject().model.collapse_drift == model.collapse_drift
        check_strongest_run(study, campaign, done, number, model)


def test_samples_depend_only_on_seed_and_id(study: Path) -> None:
    """Other buildings and their order do not affect the samples of a building, but another seed
    does."""
    before = {row: plan(study).assignment.draws(number) for number, row in enumerate("abc")}
    header, *lines = BUILDINGS.splitlines()
    (study / "buildings.csv").write_text("\n".join([header, lines[2], lines[0]]) + "\n")
    after = plan(study).assignment
    assert [after.draws(0), after.draws(1)] == [before["c"], before["a"]]
    (study / "campaign.yaml").write_text(STUDY.replace("seed: 7", "seed: 8"))
    assert plan(study).assignment.draws(0) != before["c"]


def test_components_of_sample_share_number(study: Path) -> None:
    campaign = plan(study)
    for building in range(3):
        samples: dict[int, list[str]] = {}
        for draw in campaign.assignment.draws(building):
            samples.setdefault(draw.sample, []).append(campaign.motions[draw.motion].component)
        assert sorted(samples) == [1, 2, 3, 4]
        assert all(sorted(components) == ["x", "y"] for components in samples.values())


def test_weights_are_inverse_squares_of_distances(tmp_path: Path) -> None:
    """Two grid points are a few kilometers north of the building, one is west of it, and one is out
    of range. The sampled numbers follow the weights: chi-squared test of 20 000 samples, 3 degrees
    of freedom less one."""
    degree = (
        1.0 / np.radians(1.0) / 6371.0088
    )  # of latitude in a kilometer; mean radius of the earth, km (IUGG)
    points = ((10.0, 2.0 * degree), (10.0, 4.0 * degree), (10.0 - 1.0 * degree, 0.0), (20.0, 0.0))
    settings = GridFile("grid.csv", "g", neighbors=3, samples=20_000, seed=1)
    (tmp_path / "b.csv").write_text(
        f"{','.join(NEEDED)},Latitude,Longitude\nx,2,1980,C1,100,0,10\n"
    )
    rows, _ = read_inventory(str(tmp_path / "b.csv"), 1.0)
    draws = GridMotions(settings, points, tuple((((i,), 1.0),) for i in range(4)), rows)
    near, weights = draws.weights(0)
    found = dict(zip(near.tolist(), weights.tolist(), strict=True))
    squares = {0: 1.0 / 4.0, 1: 1.0 / 16.0, 2: 1.0}
    assert found == pytest.approx(
        {point: value / sum(squares.values()) for point, value in squares.items()}, rel=1e-6
    )
    counts = Counter(draw.motion for draw in draws.draws(0))
    assert set(counts) == {0, 1, 2} and sum(counts.values()) == 20_000
    chi_squared = sum(
        (counts[point] - 20_000 * weight) ** 2 / (20_000 * weight)
        for point, weight in found.items()
    )
    assert chi_squared < 13.8  # exceeded for one seed in a thousand; the seed is fixed


def test_unreadable_motions_are_omitted_and_reported(study: Path) -> None:
    (study / "m00.json").write_text("{}")
    (study / "m01.json").unlink()
    campaign = plan(study)
    assert [type(failure) for failure in campaign.failures] == [RecordError, RecordError]
    assert all(not motion.name.startswith("m0") for motion in campaign.motions)
    assert campaign.runs == 3 * 4 * 2 * 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000, "m00.json: not JSON"),
        ('{"dT": 0.01, "data_x": [1%s, 2]}' % ("0" * 400), "m00.json: .* inf for sample 0"),
        ('{"dT": 1%s, "data_x": [1, 2]}' % ("0" * 400),
         "m00.json: dT must be a sampling interval, .* got inf"),
        ('{"dT": "0.01", "data_x": [1, 2]}',
         "m00.json: dT must be a sampling interval, .* got '0.01'"),
        ('{"dT": 20, "data_x": [1, 2]}',
         "m00.json: dT must be a sampling interval, .* 1e-06 to 10 s, got 20"),
        ('{"dT": 0.01, "data_x": [1, "2"]}', "m00.json: data_x must be a list of numbers"),
        ('{"dT": 0.01, "data_x": [1, null]}', "m00.json: data_x must be a list of numbers"),
        ('{"dT": 0.01, "data_x": [[1, 2], [3, 4]]}', "m00.json: data_x must be a list of numbers"),
        ('{"dT": 0.01, "data_x": [1, 1e9]}',
         "m00.json: data_x: the peak acceleration must be at most .*, got 9.807e.09 m/s"),
        ('{"dT": 0.01, "data_x": [1, 2], "data_y": [1, 2, 3]}',
         "m00.json: data_x and data_y must have the same number"),
    ],
)  # fmt: skip
def test_invalid_grid_motions_are_reported(study: Path, text: str, message: str) -> None:
    (study / "m00.json").write_text(text)
    (failure,) = plan(study).failures
    assert re.search(message, str(failure))


def test_buildings_without_coordinates_are_omitted(study: Path) -> None:
    """Only buildings without coordinates are omitted; if no building has coordinates, the campaign
    is refused."""
    text, before = (study / "buildings.csv").read_text(), plan(study)
    (study / "buildings.csv").write_text(text.replace(",37.805,-122.265", ",,"))
    remaining_plan = plan(study)
    assert len(remaining_plan.buildings) == len(before.buildings) - 1
    ((input_type, reason),) = remaining_plan.unused
    assert (
        input_type == "building"
        and "buildings.csv:4:6: Latitude: is missing; motions at sites require" in reason
    )
    (study / "buildings.csv").write_text(re.sub(r",3\d[.\d]*,-122[.\d]*", ",,", text))
    with pytest.raises(ModelError, match=r"buildings.csv:2:6: Latitude: is missing"):
        plan(study)


def test_scale_includes_factor_of_grid(study: Path) -> None:
    """m00 and m01 are motions of one file with the factors 1 and 0.5. The name is the name of the
    file, and `scale` includes the factor. For levels of a measure, the scale is the level over the
    measure of the motion in the file, for any factor."""
    campaign = plan(study)
    assert [motion.name for motion in campaign.motions] == [
        f"m{i}{j}" for i in range(3) for j in range(2) for _ in "xy"
    ]
    runs = {
        (run.motion, run.scale)
        for n in range(campaign.chunks)
        for building in campaign.chunk(n).buildings
        for run in building.runs
    }
    levels = (1.0, 2.0)
    factors = {
        motion: 1.0 if campaign.motions[motion].name.endswith("0") else 0.5 for motion, _ in runs
    }
    assert runs == {
        (motion, factor * level) for motion, factor in factors.items() for level in levels
    }
    intensity = next(line for line in STUDY.splitlines() if line.startswith("intensity"))
    (study / "campaign.yaml").write_text(
        STUDY.replace(intensity, "intensity: {measure: pga, levels: [0.1 g]}")
    )
    measure_campaign = plan(study)
    for run in (
        run
        for n in range(measure_campaign.chunks)
        for building in measure_campaign.chunk(n).buildings
        for run in building.runs
    ):
        whole_motion = measure_campaign.motions[run.motion].ground_motion
        mean = np.sqrt(whole_motion.first.pga * whole_motion.second.pga)
        np.testing.assert_allclose(run.scale, 0.1 * STANDARD_GRAVITY / mean, rtol=1e-12)


def test_description_changes_with_grid(study: Path) -> None:
    """Other points, or other motions at the points, change the samples, and the fingerprint
    changes."""
    before = plan(study).assignment.description()
    assert plan(study).assignment.description() == before
    (study / "site2.csv").write_text("TH_file,factor\nm20,1.0\nm21,0.25\n")
    assert plan(study).assignment.description() != before


def test_sweep_varies_buildings_of_inventory(study: Path) -> None:
    """Each variation is a run of the varied model under the motions that are sampled for its
    building without a sweep."""
    plain = plan(study)
    (study / "campaign.yaml").write_text(
        STUDY + "vary: {stiffness_factor: [0.8, 1.3], mass_factor: [1.2]}\n"
    )
    campaign = plan(study)
    assert campaign.runs == 2 * plain.runs
    names = [campaign.buildings[number].name for number in range(6)]
    assert names[:2] == [
        "a: stiffness_factor=0.8, mass_factor=1.2",
        "a: stiffness_factor=1.3, mass_factor=1.2",
    ]
    assert len({campaign.buildings[number].digest for number in range(6)}) == 6
    done = rows_of(campaign)
    for number, model in enumerate(models(study)):
        for index, factor in enumerate((0.8, 1.3)):
            building = 2 * number + index
            assert campaign.assignment.draws(building) == plain.assignment.draws(number)
            assert campaign.buildings[building].varied == {
                "stiffness_factor": factor,
                "mass_factor": 1.2,
            }
            changed = model.replace(stiffness_factor=factor, mass_factor=1.2)
            check_strongest_run(study, campaign, done, building, changed)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("analysis", "vary: {story 3.mass_factor: [0.9]}\nanalysis"),
            "story 3.mass_factor: story not found; a has 2 stories",
        ),
        (
            ("method: newmark-average", "methods: [hht, trio]"),
            "lists of methods and time steps require `models`",
        ),
    ],
)
def test_invalid_sweep_is_refused_before_first_run(
    study: Path, change: tuple[str, str], message: str
) -> None:
    (study / "campaign.yaml").write_text(STUDY.replace(*change))
    with pytest.raises(TdintError) as caught:
        plan(study)
    assert message in str(caught.value)
