"""Where a store may lie, and how chunks are cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tdint.campaign.buildings import GivenBuildings
from tdint.campaign.draws import EveryMotion, suite_motions
from tdint.campaign.engine.task import RunSettings, Subject
from tdint.campaign.levels import GivenFactors
from tdint.campaign.plan import Plan
from tdint.campaign.store.place import refuse_network
from tdint.errors import OutputError
from tdint.ground_motion.record import Record
from tdint.model.config.model_file import load_model

MOUNTS = """\
22 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw
30 22 0:40 / {home} rw,relatime shared:2 - {kind} server:/export rw,vers=4.2
31 30 0:41 / {home}/local rw - xfs /dev/sdb1 rw
"""


@pytest.mark.parametrize("kind", ["nfs4", "lustre", "cifs", "fuse.sshfs"])
def test_a_network_file_system_is_refused(tmp_path: Path, kind: str) -> None:
    """Also for a folder that does not exist yet; a local disk mounted below it is none, nor is a folder beside it."""
    mounts = tmp_path / "mountinfo"
    home = tmp_path / "home"
    mounts.write_text(MOUNTS.format(home=home, kind=kind))
    with pytest.raises(OutputError, match=rf"network file system \({kind}\)"):
        refuse_network(home / "new" / "out", mounts)
    refuse_network(home / "local" / "out", mounts)
    refuse_network(tmp_path / "home2", mounts)
    refuse_network(home, tmp_path / "nowhere")


@given(
    sizes=st.lists(st.integers(2, 4000), min_size=1, max_size=6),
    factors=st.lists(st.integers(1, 40), min_size=6, max_size=6),
    buildings=st.integers(1, 4),
)
def test_chunks_hold_every_run_once_in_order(sizes: list[int], factors: list[int], buildings: int) -> None:
    model = load_model("configs/two-story-polynomial.yaml")
    motions = suite_motions([Record(np.ones(size), 0.01, "", "", f"c{i}", "r") for i, size in enumerate(sizes)])
    levels = GivenFactors({i: tuple(float(f + 1) for f in range(factors[i])) for i in range(len(sizes))})
    subjects = [Subject(model, "newmark-average")] * buildings
    plan = Plan("", GivenBuildings.of(subjects), motions, EveryMotion(len(motions)), levels, RunSettings())
    found = [
        (one.number, run) for number in range(plan.chunks) for one in plan.chunk(number).buildings for run in one.runs
    ]
    wanted = [(b, (m, f, 0)) for b in range(buildings) for m in range(len(sizes)) for f in levels.by_motion[m]]
    assert found == wanted and len(found) == plan.runs
    assert [plan.size(number) for number in range(plan.chunks)] == [
        sum(len(part.runs) for part in plan.chunk(number).buildings) for number in range(plan.chunks)
    ]
