"""A campaign from its plan to its store: which chunks are left, who does them, and who is told."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate

from tdint.analysis.run.workspace import kernels
from tdint.campaign.engine.chunk import Done, do, spectral_accelerations
from tdint.campaign.engine.cluster import Cluster, on_cluster
from tdint.campaign.plan import Plan
from tdint.campaign.store.store import Store
from tdint.errors import UsageError
from tdint.kernels.building.obtaining import obtain
from tdint.kernels.building.variant import EVERYTHING
from tdint.kernels.march.many import many
from tdint.processors import on_threads

Engine = Callable[[Plan, Sequence[int]], Iterator[Done]]
"""Who does chunks: threads here, or workers elsewhere."""


@dataclass(frozen=True)
class Shard:
    """Every `of`-th chunk, from the `number`-th one, counted from 1."""

    number: int
    of: int

    def holds(self, chunk: int) -> bool:
        """Whether a chunk belongs to it."""
        return chunk % self.of == self.number - 1


@dataclass(frozen=True)
class Advance:
    """How far a campaign has come in one call.

    Attributes
    ----------
    done, runs : int
        Runs that are done, and all that this call was asked for.
    before : int
        Those of them that were done before.
    seconds : float
        Since the call began, s.
    """

    done: int
    runs: int
    before: int
    seconds: float

    @property
    def rate(self) -> float:
        """Runs in a second."""
        return (self.done - self.before) / self.seconds if self.seconds > 0.0 else 0.0


def carry_out(
    plan: Plan,
    store: Store,
    engine: Engine,
    *,
    shard: Shard | None = None,
    limit: int | None = None,
    tell: Callable[[Advance], None] = lambda advance: None,
) -> Advance:
    """Do what is left of a campaign, or of a shard of it, and keep every chunk as soon as it is done.

    Parameters
    ----------
    limit : int, optional
        Stop after the chunk in which this many more runs are done.
    tell : callable
        Told of every chunk.

    Raises
    ------
    AnalysisError
        A method does not integrate a building.
    OutputError
        The store cannot be written.
    """
    began = time.perf_counter()
    wanted = [number for number in range(plan.chunks) if shard is None or shard.holds(number)]
    ready = store.done()
    left = [number for number in wanted if number not in ready]
    before = sum(plan.size(number) for number in wanted) - sum(plan.size(number) for number in left)
    if limit is not None:
        totals = list(accumulate(plan.size(number) for number in left))
        left = left[: sum(total < limit for total in totals) + 1]
    advance = Advance(before, before + sum(plan.size(number) for number in left), before, 0.0)
    if left:
        compile_for(plan)
        began = time.perf_counter()
    for done in engine(plan, left):
        store.add(done)
        advance = Advance(advance.done + len(done.rows.runs), advance.runs, before, time.perf_counter() - began)
        tell(advance)
    return advance


def threads(jobs: int) -> Engine:
    """So many threads of this process."""
    if jobs < 1:
        raise UsageError(f"the number of jobs must be at least 1, got {jobs}")
    return lambda plan, numbers: on_threads(lambda number: do(plan.chunk(number)), numbers, jobs)


def cluster(of: Cluster) -> Engine:
    """The workers of a Dask cluster."""
    return lambda plan, numbers: on_cluster(of, plan.chunk, numbers)


def compile_for(plan: Plan) -> None:
    """Load the time loops of the buildings, compiled if they are not yet: before threads ask for them all at once."""
    wanted = {(many, EVERYTHING): None}
    for number in range(min(len(plan.buildings), _LOOKED_AT)):
        subject = plan.buildings.source(number).subject()
        wanted |= dict.fromkeys(kernels(subject.integrator, subject.prepared.variant))
    obtain(list(wanted))
    spectral_accelerations(plan.motions[0].record, [1.0])


_LOOKED_AT = 1000
"""Buildings whose time loops are compiled ahead: those of an inventory need the same ones."""
