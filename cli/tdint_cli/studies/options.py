"""Options of studies: the intensity measure, pairs of components, threads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.errors import UsageError
from tdint_cli.options import grammar
from tdint_cli.options.option_types import PairWish, pairs_of
from tdint_cli.options.record import warnings_of_suite
from tdint_cli.terminal import Failures, note, warn

if TYPE_CHECKING:
    from tdint.ground_motion.choice import RecordChoice
    from tdint.ground_motion.reading.suites import Suite
    from tdint.studies.campaign.assigned_motions import FactorTable

PAIRS = ("geometric-mean", "rotd50", "rotd100", "larger", "srss")


def pair_measure(wish: PairWish | None) -> str:
    """Return the intensity measure of a pair of components: the requested measure, otherwise the
    geometric mean of both components."""
    return (wish and wish.measure) or PAIRS[0]


pairs = grammar.option("--pairs", type=pairs_of(PAIRS), metavar=f"{'|'.join(PAIRS)}[,NAMES]")


def read_table_of_factors(
    records: Sequence[str], file: str | None, choice: RecordChoice, pairs: PairWish | None
) -> tuple[Suite, FactorTable | None]:
    """Read the ground motions of a command line, or of a table of factors (--factors, from `tdint
    scale -o`) if no record is named. The second result is `None` with records. Notes and warnings
    are written to the terminal.

    Errors of single unreadable files are not written here. They are in `failures` of the suite, and
    the caller reports them.

    Parameters
    ----------
    pairs : PairWish | None
        Requested treatment of pairs of horizontal components; None reads single components.

    Raises
    ------
    UsageError
        No records and no table are specified, or both; standard input is given more than once; or
        a component is specified together with pairs.
    ModelError
        The table cannot be used.
    Failures
        No record could be read.
    """
    # Exactly one of the two sources of ground motions is required.
    if bool(records) is (file is not None):
        problem = "RECORD is required"
        if records:
            problem = "RECORD and --factors cannot be used together"
        raise UsageError(
            f"{problem}; specify either records or directories, or the table of `tdint scale -o` "
            "with --factors"
        )
    if pairs and choice.component is not None:
        raise UsageError(
            "--component cannot be used with pairs of components, because both are used; omit "
            "--component"
        )
    names, table = pairs.names if pairs else None, None
    if file is None:
        from tdint.ground_motion.reading import suites

        suite = suites.read_suite(records, choice, names)
    else:
        from tdint.studies.campaign.inputs import read_factors, read_listed

        table, suite = read_listed(read_factors(file), choice, names)
    note(*suite.notes)
    if not suite.motions:
        raise Failures(suite.failures)
    warn(*warnings_of_suite(suite.records))
    return suite, table


def read_suite(records: Sequence[str], choice: RecordChoice, pairs: PairWish | None) -> Suite:
    """Return the ground motions of a command line, as `read_table_of_factors`."""
    return read_table_of_factors(records, None, choice, pairs)[0]
