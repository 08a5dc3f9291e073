"""The formats and how each of them is compared with what it says of itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tdint.ground_motion.header_checks import exchange, mseed, recorders
from tdint.ground_motion.header_checks.statement import Statement, check_step, compare


def _nothing(_: bytes) -> None:
    return None


@dataclass(frozen=True)
class Check:
    """How a format that another program reads is compared with what it says of itself.

    Attributes
    ----------
    statements : callable
        From what `look` found and the traces that were read the statements to compare.
    look : callable
        From the bytes of a file what they state; raises Damaged for a file that must not come before the reader.
    """

    statements: Callable[[Any, list[Any]], list[Statement]]
    look: Callable[[bytes], Any] = _nothing


CHECKS = {
    "MSEED": Check(mseed.mseed_statements, mseed.look_at_mseed),
    "SAC": Check(exchange.sac_statements, exchange.look_at_sac),
    "GSE1": Check(exchange.gse_statements, exchange.look_at_gse),
    "GSE2": Check(exchange.gse_statements, exchange.look_at_gse),
    "SLIST": Check(exchange.timeseries_statements, exchange.look_at_timeseries),
    "TSPAIR": Check(exchange.timeseries_statements, exchange.look_at_timeseries),
    "SH_ASC": Check(exchange.handler_statements, exchange.look_at_handler),
    "KNET": Check(exchange.knet_statements),
    "KINEMETRICS_EVT": Check(recorders.evt_statements, recorders.look_at_evt),
    "GCF": Check(recorders.gcf_statements, recorders.look_at_gcf),
    "REFTEK130": Check(recorders.reftek_statements, recorders.look_at_reftek),
}
"""ObsPy's formats; tdint's own readers compare while they read (`tdint.ground_motion.formats.series`)."""


def look_at(format_name: str, data: bytes) -> Any:
    """What the bytes of a file state, for `compare_with_statements`; None if the format has nothing.

    Raises
    ------
    Damaged
        The file must not come before the reader of its format: it contradicts itself.
    """
    check = CHECKS.get(format_name)
    return check.look(data) if check else None


def compare_with_statements(format_name: str, looked_at: Any, traces: list[Any]) -> tuple[str, ...]:
    """Compare what was read with what the file states; returns what was compared, nothing if it states nothing.

    Parameters
    ----------
    format_name : str
        ObsPy's name of the format.
    looked_at
        From `look_at`.
    traces : list of obspy.Trace
        What was read.

    Raises
    ------
    Damaged
        Two numbers differ, or a sampling interval is none that a recorder has.
    """
    for trace in traces:
        if len(trace.data) and trace.data.dtype.kind in "iuf":
            check_step(float(trace.stats.delta))
    check = CHECKS.get(format_name)
    return compare(check.statements(looked_at, traces)) if check else ()
