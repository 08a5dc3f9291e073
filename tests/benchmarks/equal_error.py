"""Compare the times that methods need for the same error of the ten-story bilinear building.

    python tests/benchmarks/equal_error.py

Prints a Markdown table: the time of the time loop for several errors of the drifts (L2 norm of the
history), and in parentheses this time divided by the time of `impulse4`. The times are
interpolated between the points of `tdint chart --target-error drift`. The mark `<` means that the
error with the longest time step is already smaller; `~` means that the time is extrapolated beyond
the shortest time step. OpenSeesPy is measured if it is installed. Each time is the minimum of
`REPEATS` runs; the methods of tdint run alternately, and OpenSeesPy runs after them.
"""

import math

from common import ROOT

from tdint import load_model
from tdint.assessment.chart.peers import openseespy_points
from tdint.assessment.chart.problem import pose
from tdint.assessment.chart.work_precision import measure
from tdint.methods.catalogue import parse

MODEL = ROOT / "configs" / "ten-story-bilinear.yaml"
METHODS = ("impulse4", "gauss4", "bathe", "central-difference", "newmark-average")
STEPS_PER_SAMPLE = (1, 2, 4, 8, 16, 32)
PEER_STEPS_PER_SAMPLE = (1, 2, 4, 8)  # fewer runs of OpenSeesPy, which is slower
LIMITS = (1e-3, 1e-4, 1e-5, 1e-6)
REPEATS = 9


def time_for_error(points, limit):
    """Return the time for an error, s, and a mark.

    The time is interpolated linearly between the logarithms of errors and times.

    Parameters
    ----------
    points : sequence of Point
        Runs of a method, from the longest to the shortest time step. Points without errors are
        ignored.
    limit : float
        Relative error of the drifts.

    Returns
    -------
    time : float
        Time, s.
    mark : str
        `<` if the error of the first point is already smaller (`time` is the time of this point);
        `~` if the time is extrapolated from the last two points; empty otherwise.
    """
    logarithms = [
        (math.log(point.errors.drift), math.log(point.fastest)) for point in points if point.errors
    ]
    log_limit = math.log(limit)
    if logarithms[0][0] <= log_limit:
        return points[0].fastest, "<"
    # Index of the first point that meets the limit; the number of points if no point does.
    first = next(
        (i for i, (error, _) in enumerate(logarithms) if error <= log_limit), len(logarithms)
    )
    is_extrapolated = first == len(logarithms)
    second = min(first, len(logarithms) - 1)
    (e0, t0), (e1, t1) = logarithms[second - 1], logarithms[second]
    seconds = math.exp(t0 + (t1 - t0) * (log_limit - e0) / (e1 - e0))
    return seconds, "~" if is_extrapolated else ""


def main():
    """Print the table."""
    problem = pose(load_model(MODEL))
    steps = [problem.interval / count for count in STEPS_PER_SAMPLE]
    chart = measure(problem, [parse(name) for name in METHODS], steps, repeats=REPEATS)
    peer_steps = [problem.interval / count for count in PEER_STEPS_PER_SAMPLE]
    peers, notes = openseespy_points(problem, peer_steps, chart.reference)
    difference = f"difference of the reference solutions: {chart.reference.gap.drift:.1e}"
    print("\n".join([difference, *notes]), end="\n\n")
    points_by_line = {}
    for point in (*chart.points, *peers):
        points_by_line.setdefault(point.line, []).append(point)
    # Its error does not decrease with order 2, so it cannot be extrapolated
    # (opensees_generalized_alpha.py).
    points_by_line.pop("openseespy/generalized-alpha", None)
    print("| error of the drifts | " + " | ".join(points_by_line) + " |")
    print("|---" * (len(points_by_line) + 1) + "|")
    for limit in LIMITS:
        base, _ = time_for_error(points_by_line["impulse4"], limit)
        cells = []
        for points in points_by_line.values():
            seconds, mark = time_for_error(points, limit)
            cells.append(f"{mark}{1e3 * seconds:.3g} ms ({seconds / base:.3g})")
        print(f"| {limit:.0e} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
