"""How impulse4's error falls with the step in random buildings of all laws that are linear branch
by branch.

python tests/benchmarks/events.py [BUILDINGS [FIRST]]

A line for each building whose error at a step is more than twice that at the next larger one;
`times` is by how much the building itself enlarges a small change of the motion. Where that is a
lot (mostly pounding that repeats) no method can tell its course.
"""

import sys

import common  # noqa: F401

from events_study import PARTS, study


def main(count=200, first=0):
    """Print the buildings that stand out, and how many there are."""
    outliers = chaotic = 0
    print("worst: largest ratio of the errors at a step and the one before; errors at dt /", *PARTS)
    for seed in range(first, first + count):
        found = study(seed)
        chaotic += found.chaotic
        outliers += found.worst > 2.0 and not found.chaotic
        if found.worst > 2.0:
            laws = " ".join(story.law.name for story in found.building.stories)
            errors = " ".join(f"{error:.0e}" for error in found.errors)
            print(
                f"{seed:4d} worst {found.worst:7.1e} times {found.growth:7.1e} {errors} {laws}",
                flush=True,
            )
    print(
        f"{outliers} of {count} buildings stand out; {chaotic} more enlarge a small change ten "
        "thousand times"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
