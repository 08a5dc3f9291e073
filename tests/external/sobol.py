"""Sobol indices, by SALib, of the largest drift of a building for each of its parameters."""

import numpy as np
from SALib.analyze import sobol as indices
from SALib.sample import sobol

import tdint

record = tdint.read_record("records/near-fault.mseed", component="HN1", units="m/s^2")
frame = tdint.load_model("configs/ten-story-bilinear.yaml")
bounds = {
    "stiffness_factor": [0.8, 1.2],
    "strength_factor": [0.7, 1.3],
    "stories.law.hardening": [0.0, 0.08],
    "damping": [0.01, 0.06],
}
problem = {"num_vars": len(bounds), "names": list(bounds), "bounds": list(bounds.values())}

draws = sobol.sample(problem, 64, calc_second_order=False, seed=1)
runs = tdint.run_many(
    frame, record, vary=dict(zip(bounds, draws.T, strict=True)), method="impulse4"
)
drifts = runs.stories.peak_drift_ratio.max(axis=1)
found = indices.analyze(problem, np.log(drifts), calc_second_order=False, seed=1)
for name, first, total in zip(bounds, found["S1"], found["ST"], strict=True):
    print(f"{name}: first-order {first:.2f}, total {total:.2f}")
