"""Options of studies: the intensity measure, pairs of components, threads."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from tdint.errors import UsageError
from tdint_cli.options import grammar
from tdint_cli.options.analysis import damping_of
from tdint_cli.options.grammar import FileName, ListOf, PairsType, PairWish, Ratio
from tdint_cli.options.record import option as record_option
from tdint_cli.options.record import warnings_of_suite
from tdint_cli.terminal import note, warn

if TYPE_CHECKING:
    from tdint.campaign.motions import FactorTable
    from tdint.ground_motion.choice import RecordChoice
    from tdint.ground_motion.reading.suites import Suite

option = partial(grammar.option, heading=grammar.INTENSITY)

PAIRS = ("geometric-mean", "rotd50", "rotd100")


def pair_measure(wish: PairWish | None) -> str:
    """What stands for a pair: what is asked for, else the first of `PAIRS`."""
    return (wish and wish.measure) or PAIRS[0]


def target(text: str, heading: str = grammar.OWN) -> grammar.Declaration:
    """The option --target; what becomes of it differs between the commands."""
    named = (
        "a design spectrum by name, asce7:sds=1.0,sd1=0.6,tl=8 (mcer: 1.5 times it) or "
        "ec8:type=1,soil=B,ag=0.25g[,damping=5%], or a CSV file with the columns period_s and sa_g "
        "or sa_m_s2."
    )
    return grammar.option(
        "--target", heading=heading, type=FileName(), metavar="SPECTRUM", help=f"{text}: {named}"
    )


def pairs(text: str) -> grammar.Declaration:
    """The option --pairs; what it does differs between the commands."""
    return option(
        "--pairs",
        type=PairsType(PAIRS),
        metavar=f"[{'|'.join(PAIRS)}][,NAMES]",
        help=f"{text} Files of a pair are named alike but for the component, or as NAMES says: "
        "'{}_a.txt,{}_b.txt'.",
    )


def damping(needs: str) -> grammar.Declaration:
    """The option --damping, of the measures that it `needs`."""
    return damping_of("Sa", heading=grammar.INTENSITY, needs=needs, rare=True)


threshold = partial(
    grammar.option,
    "--threshold",
    type=ListOf(Ratio(0.0, min_open=True)),
    metavar="DRIFT,...",
    heading=grammar.ANALYSIS,
)


def factors(text: str) -> grammar.Declaration:
    """The option --factors; the use of the factors differs between the commands."""
    return record_option(
        "--factors",
        type=FileName(),
        rare=True,
        help=f"Read the records from the table that `tdint scale -o` wrote. {text}",
    )


def read_table_of_factors(
    records: Sequence[str], file: str | None, choice: RecordChoice, pairs: PairWish | None
) -> tuple[Suite, FactorTable | None]:
    """Return the ground motions of a command line, or of a table of factors if no record is named.

    Returns
    -------
    suite : Suite
        The motions, as of `read_suite`.
    table : FactorTable or None
        The table; None without one.

    Raises
    ------
    UsageError
        Neither records nor a table are named, or both are; as of `read_suite`.
    ModelError
        The table cannot be used.
    TdintError
        Nothing could be read.
    """
    if bool(records) is (file is not None):
        given = "RECORD and --factors are given" if records else "no RECORD is given"
        raise UsageError(
            f"{given}; name records or folders, or the table of `tdint scale -o` by --factors"
        )
    if file is None:
        return read_suite(records, choice, pairs), None
    from tdint.campaign.definition import FactorsFile
    from tdint.campaign.inputs import read_factors, read_listed

    _refuse_component_of_pairs(choice, pairs)
    table, suite = read_listed(
        read_factors(FactorsFile(file)), choice, pairs.names if pairs else None
    )
    return _reported(suite), table


def read_suite(records: Sequence[str], choice: RecordChoice, pairs: PairWish | None) -> Suite:
    """The ground motions of a command line; what there is to say of them is said, but for what
    could not be read.

    Raises
    ------
    UsageError
        Standard input is given more than once; a component is named of pairs.
    TdintError
        Nothing could be read.
    """
    from tdint.ground_motion.reading import suites

    _refuse_component_of_pairs(choice, pairs)
    return _reported(suites.read_suite(records, choice, pairs.names if pairs else None))


def _refuse_component_of_pairs(choice: RecordChoice, pairs: PairWish | None) -> None:
    if pairs and choice.component is not None:
        raise UsageError("--component names single components; leave it out with pairs")


def _reported(suite: Suite) -> Suite:
    """Return a suite whose notes and warnings are written to the terminal.

    Raises
    ------
    TdintError
        Nothing could be read.
    """
    from tdint_cli.terminal import Failures

    note(*suite.notes)
    if not suite.motions:
        raise Failures(suite.failures)
    warn(*warnings_of_suite(suite.records))
    return suite
