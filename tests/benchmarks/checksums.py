"""What the checksums of a store cost: processor time of a campaign with and without, and of opening its store.

python tests/benchmarks/checksums.py [--runs 2000] [--times 3]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from unittest import mock

from tdint.campaign.carry_out import carry_out, threads
from tdint.campaign.inputs import read_inputs
from tdint.campaign.plan import Plan, make_plan
from tdint.campaign.reader import load_campaign
from tdint.campaign.store import store as stores

_CONFIGS = Path(__file__).parents[2] / "configs"
_CAMPAIGN = """\
buildings: {{models: [{configs}/ten-story-bilinear.yaml]}}
records: {{files: [{records}/firm-soil.mseed], units: m/s^2, component: HN1}}
intensity: {{scales: [{scales}]}}
outputs: {{stories: true}}
"""


def planned(runs: int, folder: Path) -> Plan:
    """A campaign of so many runs of ten bilinear stories."""
    scales = ", ".join(f"{0.1 + i / runs:.9g}" for i in range(runs))
    file = folder / "campaign.yaml"
    file.write_text(_CAMPAIGN.format(configs=_CONFIGS, records=_CONFIGS.parent / "records", scales=scales))
    campaign = load_campaign(str(file))
    return make_plan(campaign, read_inputs(campaign))


def seconds(work: Callable[[], object]) -> float:
    """Processor time, s."""
    began = time.process_time()
    work()
    return time.process_time() - began


def done(plan: Plan) -> None:
    """The campaign in a new folder."""
    with tempfile.TemporaryDirectory() as name:
        store, _ = stores.open_store(Path(name), plan)
        with store:
            carry_out(plan, store, threads(1))


def opened(plan: Plan, folder: Path) -> None:
    """The store of the campaign that is done."""
    store, _ = stores.open_store(folder, plan)
    store.connection.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--times", type=int, default=3)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan = planned(given.runs, folder)
        store, _ = stores.open_store(folder, plan)
        with store:
            carry_out(plan, store, threads(1))
        without = mock.patch.object(stores, "chunk_digest", lambda *_: "")
        times: dict[str, list[float]] = {"with": [], "without": [], "opened": []}
        for _ in range(given.times):
            times["with"].append(seconds(lambda: done(plan)))
            with without:
                times["without"].append(seconds(lambda: done(plan)))
            times["opened"].append(seconds(lambda: opened(plan, folder)))
    best = {key: min(values) for key, values in times.items()}
    print(
        f"{given.runs} runs of ten stories: {best['with']:.3f} s, without checksums {best['without']:.3f} s: ", end=""
    )
    print(f"{best['with'] / best['without']:.4f} times; opening the store {best['opened']:.3f} s")


if __name__ == "__main__":
    main()
