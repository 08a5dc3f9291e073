"""Table of the states of the hysteresis models of a building."""

from __future__ import annotations

import numpy as np

from tdint.arrays import Array
from tdint.kernels import layout as rows
from tdint.kernels.laws import LAWS


def law_state_table(law_parameters: Array) -> Array:
    """Return a new table of law states filled with zeros, except for the values that mark a failed
    law.

    After EXTRA_ROWS rows, the table has further rows for each block, the maximum of
    `DriftLaw.extra_rows` of the laws.
    """
    codes = law_parameters[rows.CODE]
    # The column of zeros counts as the linear law; stories with elements have no law.
    used_codes = sorted(set(codes[codes >= 0].tolist()))
    extra_rows = max((LAWS[code].extra_rows for code in used_codes), default=0)
    law_state = np.zeros(
        (rows.EXTRA_ROWS + rows.LAW_STATE_BLOCKS * extra_rows, law_parameters.shape[1])
    )
    for code in used_codes:
        law_state[rows.FAILED_INTERNAL][codes == code] = LAWS[code].failed
    return law_state
