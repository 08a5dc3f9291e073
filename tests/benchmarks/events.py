"""Find random buildings in which the error of `impulse4` does not decrease with the time step.

    python tests/benchmarks/events.py [BUILDINGS [FIRST]]

BUILDINGS is the number of buildings (default 200) and FIRST the first seed (default 0). The
hysteretic laws of the buildings are linear on each branch. The program prints a line for each
building in which a time step has more than twice the error of the next longer time step. `growth`
is the factor by which the building amplifies a small change of the ground motion. If this factor is
large (usually because of repeated pounding), no method can predict the response.
"""

import sys

import common  # noqa: F401  adds the directory of events_study to the search path

from events_study import PARTS, study


def main(count=200, first=0):
    """Print the conspicuous buildings and their number."""
    outliers = chaotic = 0
    print(
        "worst: maximum ratio of the error of a step to the error of the next longer step; growth: "
        "amplification of a small change; then the errors for dt divided by",
        *PARTS,
    )
    for seed in range(first, first + count):
        result = study(seed)
        chaotic += result.chaotic
        outliers += result.worst > 2.0 and not result.chaotic
        if result.worst > 2.0:
            laws = " ".join(story.law.name for story in result.building.stories)
            errors = " ".join(f"{error:.0e}" for error in result.errors)
            print(
                f"{seed:4d} worst {result.worst:7.1e} growth {result.growth:7.1e} {errors} {laws}",
                flush=True,
            )
    print(
        f"{outliers} of {count} buildings have an error that increases; {chaotic} other buildings "
        "amplify a small change more than ten thousand times"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
