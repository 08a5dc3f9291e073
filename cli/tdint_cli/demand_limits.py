"""Limits of demands on the command line: --limit and --require."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.errors import UsageError

if TYPE_CHECKING:
    from tdint.model.definition import Model


def check_limit_options(limit: float | str | None, require: bool, models: Sequence[Model]) -> None:
    """Check --limit and --require against the limits of the models, before any run.

    Parameters
    ----------
    limit : float, str or None
        Drift limit, or name of a performance level; None without --limit.
    models : sequence of Model
        Models of the buildings; empty for buildings of an inventory, which have no levels.

    Raises
    ------
    UsageError
        --require has no limit, or a model does not have the performance level.
    """
    if require and limit is None and not any(model.limits for model in models):
        raise without_limits()
    if isinstance(limit, str):
        from tdint.model.limits import check_level

        for model in models:
            check_level(model.limits, limit, model.name)
        if not models:
            raise UsageError(
                f"--limit {limit}: buildings of an inventory have no performance levels; "
                "specify a drift limit, such as 2%"
            )


def without_limits() -> UsageError:
    """Return the error for --require without a limit."""
    return UsageError(
        "--require has no effect without --limit or `limits` in the model; add --limit 2%, or omit "
        "--require"
    )


def outcome_text(is_met: bool) -> str:
    """Return the first sentence of the result of a limit check, with a space at its end."""
    return f"Limit {'met' if is_met else 'EXCEEDED'}. "
