"""What equal accuracy costs on the ten-story bilinear building: python
tests/benchmarks/equal_error.py

Prints a table in Markdown: the time of the march for an error of the drifts (L2 of the history),
read off the lines of `tdint chart --target-error drift` between their points (<: the largest step
already errs less; ~: beyond the smallest step, with the slope of the last two); beside each time
the ratio to impulse4's. OpenSeesPy is among the lines where it is installed. Least of several
times, all marches of tdint taking turns, OpenSeesPy's behind them in the same sitting.
"""

import math

from common import ROOT

from tdint import load_model
from tdint.analysis.chart.peers import openseespy_points
from tdint.analysis.chart.problem import pose
from tdint.analysis.chart.work_precision import measure
from tdint.methods.catalogue import parse

MODEL = ROOT / "configs" / "ten-story-bilinear.yaml"
METHODS = ("impulse4", "gauss4", "bathe", "central-difference", "newmark-average")
PARTS = (1, 2, 4, 8, 16, 32)
PEER_PARTS = (1, 2, 4, 8)
LIMITS = (1e-3, 1e-4, 1e-5, 1e-6)
REPEATS = 9


def cost(points, limit):
    """Time for an error on the line through the points, from large to small errors, with a mark
    before it.

    `<`: already the first point errs less; `~`: beyond the last point, with the slope of the last
    two.
    """
    places = [
        (math.log(point.errors.drift), math.log(point.fastest)) for point in points if point.errors
    ]
    wanted = math.log(limit)
    if places[0][0] <= wanted:
        return points[0].fastest, "<"
    below = next((j for j, (error, _) in enumerate(places) if error <= wanted), len(places))
    j = min(below, len(places) - 1)
    (e0, t0), (e1, t1) = places[j - 1], places[j]
    return math.exp(t0 + (t1 - t0) * (wanted - e0) / (e1 - e0)), "~" * (below == len(places))


def main():
    """Print the table."""
    problem = pose(load_model(MODEL))
    steps = [problem.interval / parts for parts in PARTS]
    chart = measure(problem, [parse(name) for name in METHODS], steps, repeats=REPEATS)
    peer_steps = [problem.interval / parts for parts in PEER_PARTS]
    peers, notes = openseespy_points(problem, peer_steps, chart.reference)
    print("\n".join([f"gap of the reference: {chart.reference.gap.drift:.1e}", *notes]), end="\n\n")
    lines = {}
    for point in (*chart.points, *peers):
        lines.setdefault(point.line, []).append(point)
    lines.pop(
        "openseespy/generalized-alpha", None
    )  # its error does not fall with order 2: nothing to extrapolate
    print("| error of the drifts | " + " | ".join(lines) + " |")
    print("|---" * (len(lines) + 1) + "|")
    for limit in LIMITS:
        least, _ = cost(lines["impulse4"], limit)
        cells = []
        for points in lines.values():
            seconds, mark = cost(points, limit)
            cells.append(f"{mark}{1e3 * seconds:.3g} ms ({seconds / least:.3g})")
        print(f"| {limit:.0e} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
