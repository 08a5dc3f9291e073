"""Compare target displacements with response history analyses.

    python tests/benchmarks/target_displacement.py MODEL.yaml...

The response to eleven artificial ground motions, which are matched to the target spectrum, gives
the median and the fractiles of the peak roof displacement. They are printed with the target
displacement of `tdint pushover --target`. The results are listed in configs/RUNS.md.
"""

import sys

import numpy as np

import tdint
from tdint.response.spectra.target import read_target

TARGET = "ec8:type=1,soil=C,ag=0.35g"
PERIODS = np.geomspace(0.05, 4.0, 60)
MOTIONS = 11
ITERATIONS = 12  # of the spectral matching
DT, DURATION = 0.01, 30.0  # s


def matched_motion(seed):
    """Return an artificial ground motion that matches the target spectrum.

    Filtered noise is matched iteratively: the Fourier amplitudes are multiplied by the ratio of the
    target spectrum to the response spectrum.
    """
    time = np.arange(0.0, DURATION, DT)
    # The amplitude increases for 3 s and decays from 15 s on.
    envelope = np.minimum(1.0, time / 3.0) * np.exp(-np.maximum(0.0, time - 15.0) / 5.0)
    samples = np.random.default_rng(seed).standard_normal(time.size) * envelope
    frequencies = np.fft.rfftfreq(time.size, DT)
    # Periods of the Fourier components; components above 10 s are treated as 10 s.
    log_periods = np.log(1.0 / np.maximum(frequencies, 0.1))
    for _ in range(ITERATIONS):
        spectrum = tdint.spectrum(
            tdint.make_record(samples, dt=DT, units="m/s^2"), PERIODS, damping=0.05
        )
        log_ratio = np.log(read_target(TARGET).at(PERIODS) / spectrum.psa)
        samples = np.fft.irfft(
            np.fft.rfft(samples) * np.exp(np.interp(log_periods, np.log(PERIODS), log_ratio)),
            time.size,
        )
        # The inverse transform also moves energy to the start and the end of the motion, where
        # the envelope is close to zero.
        samples *= np.minimum(1.0, 50.0 * envelope)
    return tdint.make_record(samples, dt=DT, units="m/s^2")


def main(models):
    """Print a row with the target displacements and the fractiles of the runs for each model file
    in `models`."""
    motions = [matched_motion(seed) for seed in range(MOTIONS)]
    print("model,n2_m,coefficients_m,median_m,p16_m,p84_m")
    for name in models:
        model = tdint.load_model(name)
        n2, coefficients = tdint.target_displacements(tdint.pushover(model, "4%"), TARGET)
        runs = [
            tdint.run(model, motion, method="impulse4").stories.peak_displacement[-1]
            for motion in motions
        ]
        values = (
            n2.roof_displacement,
            coefficients.roof_displacement,
            *np.percentile(runs, [50.0, 16.0, 84.0]),
        )
        print(name, *(f"{value:.3f}" for value in values), sep=",")


if __name__ == "__main__":
    main(sys.argv[1:])
