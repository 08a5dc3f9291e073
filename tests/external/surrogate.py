"""A surrogate of the largest drift from 10 000 runs: a polynomial of logarithms, with errors for
runs that were not used in the fit."""

import numpy as np

import tdint

RUNS, DEGREE = 10_000, 3
record = tdint.read_record("records/near-fault.mseed", component="HN1", units="m/s^2")
record = tdint.process(record, trim=(0.0, 15.0))
frame = tdint.load_model("configs/three-story-concrete.yaml")
chance = np.random.default_rng(1)
draws = {
    "stiffness_factor": chance.lognormal(0.0, 0.2, RUNS),
    "strength_factor": chance.lognormal(0.0, 0.2, RUNS),
    "mass_factor": chance.lognormal(0.0, 0.1, RUNS),
    "record.scale": chance.uniform(0.2, 1.0, RUNS),
}
runs = tdint.run_many(frame, record, vary=draws, method="impulse4")
drifts = np.log(runs.stories.peak_drift_ratio.max(axis=1))
logs = np.log(np.column_stack(list(draws.values())))
stands = runs.status == "done"

powers = [p for p in np.ndindex(*[DEGREE + 1] * logs.shape[1]) if sum(p) <= DEGREE]
terms = np.column_stack([np.prod(logs ** np.array(p), axis=1) for p in powers])
first = stands & (np.arange(RUNS) < RUNS // 2)
rest = stands & ~first
weights = np.linalg.lstsq(terms[first], drifts[first], rcond=None)[0]
error = np.std(terms[rest] @ weights - drifts[rest])
print(
    f"{stands.sum()} of {RUNS} stand; {len(powers)} terms; error {error:.3f} of spread "
    f"{np.std(drifts[rest]):.3f}"
)
