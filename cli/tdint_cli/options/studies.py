"""Options of studies: the intensity measure, pairs of components, threads."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from tdint.errors import UsageError
from tdint_cli.options import grammar
from tdint_cli.options.analysis import damping_of
from tdint_cli.options.grammar import FileName, ListOf, PairsType, PairWish, Ratio
from tdint_cli.options.record import warnings_of_suite
from tdint_cli.terminal import note, warn

if TYPE_CHECKING:
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
    from tdint_cli.terminal import Failures

    if pairs and choice.component is not None:
        raise UsageError("--component names single components; leave it out with pairs")
    suite = suites.read_suite(records, choice, pairs.names if pairs else None)
    note(*suite.notes)
    if not suite.motions:
        raise Failures(suite.failures)
    warn(*warnings_of_suite(suite.records))
    return suite
