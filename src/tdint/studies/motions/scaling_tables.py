"""Tables of scaled suites: factors and spectra."""

from __future__ import annotations

import numpy as np

from tdint.ground_motion.reading.suites import components
from tdint.ground_motion.record import component_names
from tdint.output.tables import table
from tdint.studies.columns import declared
from tdint.studies.motions.scaling import Scaling
from tdint.system import __version__

FACTORS = (*table.RECORD_COLUMNS, *declared("scale.factors"))

SCALED = (
    *declared("scale.scaled"),
    *table.NAMED_RECORD_COLUMNS,
    table.PERIOD,
    table.Column.named("psa", "pseudo-acceleration", "m/s^2"),
)
"""Columns of the spectra of a scaled suite."""


def factor_table(scaling: Scaling) -> table.Table:
    """Return the table of the scale factors of a suite, with a row per record (each component of
    a pair has a row)."""
    # Both components of a pair have the same factor.
    rows = [
        (record, float(factor))
        for motion, factor in zip(scaling.motions, scaling.factors, strict=True)
        for record in components(motion)
    ]
    names = component_names([record for record, _ in rows])
    provenance = (scaling.target_text, scaling.rule, __version__)
    return table.Table.of(
        FACTORS,
        [
            (record.source, name, factor, *provenance)
            for (record, factor), name in zip(rows, names, strict=True)
        ],
    )


def scaled_table(scaling: Scaling) -> table.Table:
    """Return the spectra of a scaled suite, their mean and the target, at the periods where mean
    and target were compared.

    Raises
    ------
    ValueError
        The suite was not scaled to a target.
    """
    target, periods = scaling.target, scaling.periods
    if target is None or periods is None:
        raise ValueError(
            "the suite has no target spectrum, because it was scaled to a value; scale it to a "
            "target"
        )
    spectra = scaling.spectra(periods)
    names = iter(component_names([r for motion in scaling.motions for r in components(motion)]))
    curves = [
        ("scaled", motion.source, "+".join(next(names) for _ in components(motion)), psa)
        for motion, psa in zip(scaling.motions, spectra, strict=True)
    ]
    # Mean and target follow after the ground motions; they have no record and component.
    curves += [("mean", "", "", np.mean(spectra, axis=0)), ("target", "", "", target.at(periods))]
    rows = []
    for curve, record, component, psa in curves:
        for period, value in zip(periods.tolist(), psa.tolist(), strict=True):
            rows.append((curve, record, component, period, value))
    return table.Table.of(SCALED, rows)
