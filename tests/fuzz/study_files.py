"""Small valid files that studies read: recordings in a building, campaigns, inventories, a grid,
tables."""

import json
import math

_STEP, _COUNT = 0.01, 60


def _wave(period: float, peak: float, step: float = _STEP) -> list[float]:
    """Return a sine, m/s^2 or m."""
    return [round(peak * math.sin(2.0 * math.pi * step * i / period), 7) for i in range(_COUNT)]


def _history() -> str:
    """Return a table of a base and two floors, as `tdint run --history` writes it."""
    columns = {
        "time_s": [round(_STEP * i, 6) for i in range(_COUNT)],
        "ground_acceleration_m_s2": _wave(0.4, 2.0),
        "floor_1_displacement_m": _wave(0.35, 0.01),
        "floor_2_absolute_acceleration_m_s2": _wave(0.3, 4.0),
        "floor_2_velocity_m_s": _wave(0.3, 0.2),
        "roof": _wave(0.5, 0.3),
    }
    rows = [",".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
    return "\n".join([",".join(columns), *rows, ""])


_RECORDINGS = {
    "recorded.yaml": """\
name: event
base: {file: history.csv, column: ground_acceleration_m_s2}
floors:
  1: {file: history.csv, column: floor_1_displacement_m, quantity: displacement}
  roof: {file: history.csv, column: floor_2_absolute_acceleration_m_s2, quantity: acceleration, sign: -1}
band: [0.4, 15]
window: [0.05, 0.5]
shift: 0.01
""",  # noqa: E501
    "sensors.yaml": """\
base: [{file: n.mseed, component: HNE, units: m/s^2}, {file: n.mseed, component: HNN, units: m/s^2}]
floors: {2: {file: history.csv, column: roof, units: g}}
shift: auto
""",
}
_CAMPAIGNS = {
    "scales.yaml": """\
name: scales
buildings: {models: [linear.yaml, bilinear.yaml]}
records: {files: [a.txt, n.mseed], units: m/s^2, trim: "0:0.4", baseline: constant}
intensity: {scales: [0.5, -2]}
analysis: {method: newmark-average, dt: 0.01, duration: 0.3, collapse_drift: 5%, p_delta: false}
outputs: {stories: true}
""",
    "levels.yaml": """\
buildings: {models: [bilinear.yaml]}
records: {files: [n.mseed], units: m/s^2, pairs: true}
intensity: {measure: sa, period: T1, damping: 5%, pair: rotd50, levels: [0.1 g, 2 m/s^2]}
analysis: {tolerance: 2%, until_rest: false}
""",
    "town.yaml": """\
buildings: {inventory: town.csv, units: {length: ft}, rules: mdof-lu, stiffness_scatter: 0.2, seed: 3}
records: {grid: grid.csv, units: g, neighbors: 2, samples: 2, seed: 7}
analysis: {method: newmark-average}
""",  # noqa: E501
    "factors.yaml": """\
buildings: {models: [linear.yaml]}
records: {files: [a.txt, n.mseed], units: m/s^2}
intensity: {factors: factors.csv}
analysis: {duration: 0.3}
""",
    "pairs.yaml": """\
buildings: {models: [limited.yaml]}
records: {files: [n.mseed], units: m/s^2, pairs: true, pair_demand: mean}
intensity: {scales: [1, 2]}
analysis: {duration: 0.3}
""",
    "assets.yaml": """\
buildings: {inventory: assets.xml, mapping: mapping.csv, units: {length: m}}
records: {files: [a.txt], units: m/s^2}
analysis: {method: newmark-average, duration: 0.3}
""",
}
_MAP = {"map.yaml": f"{_CAMPAIGNS['town.yaml']}outputs: {{stories: true}}\n"}
_TABLES = {
    "assets.xml": """\
<?xml version="1.0" encoding="UTF-8"?>
<nrml xmlns="http://openquake.org/xmlns/nrml/0.5">
<exposureModel id="e" category="buildings">
<conversions><costTypes><costType name="structural" type="per_asset" unit="USD"/></costTypes>
<area type="per_asset" unit="SQM"/></conversions>
<tagNames>district</tagNames>
<assets>
<asset id="a1" taxonomy="MUR/H:1" number="5" area="100"><location lon="-122.27" lat="37.80"/>
<costs><cost type="structural" value="1000"/></costs><tags district="north"/></asset>
<asset id="a2" taxonomy="CR/H:3" number="2.5" area="300"><location lon="-122.26" lat="37.81"/>
<costs><cost type="structural" value="900"/></costs><tags district="south"/></asset>
</assets>
</exposureModel>
</nrml>
""",
    "mapping.csv": "taxonomy,StructureType,NumberOfStories,YearBuilt,PlanArea\nMUR/H:1,URM,1,1950,90\nCR/H:3,C1,3,1980,300\n",  # noqa: E501
    "scatter.csv": "period_s,scatter\n0.1,0.2\n3,0.4\n",
    "events.csv": "record,event\n" + "".join(f"suite/{i}.txt,E{i % 3}\n" for i in range(1, 6)),
    "history.csv": _history(),
    "factors.csv": "record,component,factor\na.txt,,1.5\nn.mseed,HNE,0.5\nn.mseed,HNN,0.25\nn.mseed,HNE,2\n",  # noqa: E501
    "town.csv": (
        "id,NumberOfStories,YearBuilt,StructureType,PlanArea,height,seismicZone,DampingRatio,DesignLevel,Latitude,Longitude\n"
        "hall,3,1931,URM,4500,36,Z4,0.07,,37.80,-122.27\nschool,2,1968,C1,12000,,Z3,,,37.81,-122.26\n"
        "house,1,1975,W1,1500,,,,Moderate-Code,37.77,-122.45\n"
    ),
    "grid.csv": "GP_file,Longitude,Latitude\nhere.csv,-122.27,37.80\nthere.csv,-122.40,37.79\n",
    "here.csv": "TH_file,factor\npair,1.0\nsingle,0.5\n",
    "there.csv": "TH_file\nsingle\n",
    "pair.json": json.dumps(
        {"name": "pair", "dT": 0.01, "data_x": _wave(0.3, 0.2), "data_y": _wave(0.2, 0.1)}
    ),
    "single.json": json.dumps({"name": "single", "dT": 0.02, "data_x": _wave(0.5, 0.3)}),
    "target.csv": "period_s,sa_g\n0,0.4\n0.1,1\n0.6,1\n2,0.3\n",
    "stripes.csv": "im,collapses,records\n0.2,0,40\n0.6,4,40\n0.8,13,40\n1,16,40\n",
    "capacities.csv": (
        "capacity,censored,threshold,im_name,unit\n0.5,no,0.02,sa(1),g\n0.7,no,0.02,sa(1),g\n1.1,,0.02,sa(1),g\n"
        "1.3,yes,0.02,sa(1),g\n0.9,no,0.1,sa(1),g\n1.4,no,0.1,sa(1),g\n2,yes,0.1,sa(1),g\n"
    ),
    "cloud.csv": "im,edp,censored\n"
    + "".join(f"{0.1 * i:.1f},{0.002 * i + 0.001 * (i % 3):.3f},{i > 8}\n" for i in range(1, 10)),
    "path.csv": "step,drift_m\n1,0\n2,0.01\n3,-0.02\n4,0.03\n",
}
FILES = _RECORDINGS | _CAMPAIGNS | _MAP | _TABLES
"""Names and contents."""

COMPARE = (
    ("linear.yaml", "--recorded", "recorded.yaml", "-o", "out/compared"),
    ("bilinear.yaml", "--recorded", "recorded.yaml", "--periods", "0.1:1:5", "-o", "out/periods"),
    ("linear.yaml", "--recorded", "sensors.yaml", "--require", "peak_ratio=0.0001"),
    ("linear.yaml", "--recorded", "recorded.yaml", "--report", "out/page.html"),
)
"""Arguments of `tdint compare`; a fit takes seconds."""

CAMPAIGN = tuple((name, "-o", "out/c", "--jobs", "1") for name in _CAMPAIGNS)
"""Arguments of `tdint campaign`."""

MATCH = (
    ("suite/1.txt", "--target", "target.csv", "--range", "0.3:0.5", "-o", "out/matched"),
    ("both.mseed", "--units", "m/s^2", "--pairs", "rotd100", "--target", "target.csv", "--range",
     "0.3:0.5", "-o", "out/pairs"),
)  # fmt: skip
"""Arguments of `tdint match`."""

SELECT = ("suite", "--target", "target.csv", "--range", "0.1:1", "--select", "3", "--factor-range",
          "0.01:100", "-o", "out/selected.csv")  # fmt: skip
"""Arguments of `tdint scale` that select motions."""
