"""Tables of the examples of the paper of 2022."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from tdint.output.tables.table import METHOD_SPEC, TEXT, Column, Table
from tdint.units import suffix

if TYPE_CHECKING:
    from tdint.assessment.examples.paper_examples import ExampleRun


def _example_errors(reference: str, description: str, prefix: str = "") -> tuple[Column, ...]:
    """Return the columns of the errors of an example of the paper: displacement, velocity and
    acceleration.

    `reference` is the reference of the errors, a key of
    `tdint.assessment.examples.paper_examples.REFERENCES`. `prefix` is the start of the column
    names.
    """

    def column(quantity: str, unit: str) -> Column:
        """Return the column of the error of a quantity with this unit."""
        meaning = f"maximum error of the {quantity} over all floors, relative to {description}"
        name = f"{prefix}{quantity}{suffix(unit)}_error"
        return Column(name, unit, lambda run: run.error(quantity, reference), meaning)

    def norm_column(norm: str) -> Column:
        """Return the column of another norm of the displacement error."""
        meaning = f"{norm} error of the displacement over all floors, relative to {description}"
        name = f"{prefix}displacement_{norm}_m_error"
        return Column(name, "m", lambda run: run.error("displacement", reference, norm), meaning)

    maxima = map(column, ("displacement", "velocity", "acceleration"), ("m", "m/s", "m/s^2"))
    return (*maxima, norm_column("rms"), norm_column("mean"))


EXAMPLE = (
    Column.named("example", "example of the paper"),
    METHOD_SPEC,
    Column("variant", "text", lambda run: run.variant or None, "variant of the analysis"),
    Column.named("dt", "time step", "s"),
    *_example_errors(
        "paper", "the reference of the paper: newmark-linear with time steps of 0.001 or 0.002 s"
    ),
    *_example_errors("finer", "rk5 with 8 times smaller time steps", "finer_"),
)

OUTCOME = Column.named("outcome", "status of the run", TEXT)


def rank(rank_of: Callable[[Any], int | None]) -> Column:
    """Return the column of the rank of a method.

    `rank_of` is a function that receives a result and returns its rank from 1; None results in an
    empty cell.
    """
    return Column(
        "rank",
        "1",
        rank_of,
        "rank of the method by the maximum displacement error (relative to --reference), from 1; "
        "methods with equal errors (within 5 %) have the same rank",
    )


def example_table(runs: Sequence[ExampleRun], reference: str = "paper") -> Table:
    """Return the table of the errors in the examples of the paper, with a row per example, time
    step, method and variant.

    Methods are ranked by the displacement error relative to `reference`, a key of
    `tdint.assessment.examples.paper_examples.REFERENCES`.
    """
    # Imported here, because most commands do not need the examples.
    from tdint.assessment.examples.paper_examples import ordered_methods

    # Ranks by example, time step and method. Methods with equal errors share the smallest rank.
    ranks: dict[tuple[int, float, str], int] = {}
    for example, dt in dict.fromkeys((run.example, run.dt) for run in runs):
        compared = [run for run in runs if (run.example, run.dt) == (example, dt)]
        first_rank = 1
        for group in ordered_methods(compared, reference, "maximum"):
            ranks |= {(example, dt, method): first_rank for method in group}
            first_rank += len(group)

    def rank_of(run: ExampleRun) -> int | None:
        """Return the rank of a run; None for a variant and for a failed run."""
        return None if run.variant else ranks.get((run.example, run.dt, run.method))

    return Table.of_results((*EXAMPLE, rank(rank_of), OUTCOME), runs)
