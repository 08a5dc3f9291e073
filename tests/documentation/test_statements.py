"""Sentences that promise a behavior, each with a probe that measures what it states.

A page of `PAGES` without a sentence here fails, as does a sentence that is on its page no longer.
"""

import hashlib
import json
import math
import os
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import readmes
import tdint
from csv_rows import rows
from readmes import ROOT, block
from separate_streams import runner
from tdint.errors import ModelError, UsageError
from tdint.kernels.building.sources import code_of_text
from tdint.model.building import variant
from tdint_cli.main import cli

PAGES = {
    "README.md",
    *(f"configs/{name}.md" for name in ("README", "MODEL", "LAWS", "STRUCTURES", "RUNS")),
    "cli/README.md",
    "records/README.md",
    *(f"src/tdint/{name}README.md" for name in ("", "studies/", "methods/", "kernels/")),
    "src/tdint/response/spectra/README.md",
}
STATED = []
"""Page, sentence and probe of each statement."""
RECORD = str(ROOT / "records/near-fault.mseed")
YIELDING = {"type": "bilinear", "yield_force": 4e5, "hardening": 0.05}
STORY = {"repeat": 3, "mass": 1e5, "height": 3.0, "stiffness": 1e8}
FRAME = {"stories": [STORY], "damping": "2%"}
YIELDING_FRAME = {"stories": [{**STORY, "law": YIELDING}], "damping": "2%"}
STIFFENING = {
    "stories": [{"mass": 1e3, "law": {"type": "polynomial", "coefficients": [1e5, 0.0, 1e6]}}],
    "initial": {"displacement": [1.5]},
}
FILE = f"""\
units: {{length: m, force: kN, mass: t}}
stories: [{{repeat: 2, mass: 100, height: 3, stiffness: 1e5}}]
damping: 2%
excitation: {{record: {{file: {RECORD}, units: m/s^2, component: HN1, trim: '0:6'}}}}
"""


def states(page, *sentences):
    """Return a decorator of the probe of sentences of a page: a function without arguments that
    runs in an empty directory with the model `frame.yaml`."""

    def add(probe):
        STATED.extend((page, sentence, probe) for sentence in sentences)
        return probe

    return add


def command(line, code=0):
    """Return the result of a command; it must end with an exit code."""
    result = runner().invoke(cli, line.split(), prog_name="tdint")
    assert result.exit_code == code, f"{line}: {result.exit_code}, {result.output}"
    return result


def read(name):
    """Return the text of a file."""
    return Path(name).read_text(encoding="utf-8")


@cache
def motion(seconds=6.0):
    """Return the first seconds of a shipped motion."""
    record = tdint.read_record(RECORD, component="HN1", units="m/s^2")
    return tdint.process(record, trim=(0.0, seconds))


@cache
def shipped():
    """Return all shipped components by file and component."""
    names = ("firm-soil", "near-fault", "soft-soil", "kaikoura/WTMC", "kaikoura/HSES")
    found = {}
    for name in names:
        channels = ("HN1", "HN2", "HNZ") if "/" in name else ("HN1", "HN2")
        for channel in channels:
            file = ROOT / f"records/{name}.mseed"
            found[name, channel] = tdint.read_record(file, component=channel, units="m/s^2")
    return found


def peaks(dt, model=YIELDING_FRAME, **options):
    """Return the peak drifts of a run without an error estimate, m."""
    return tdint.run(model, motion(), dt=dt, check=False, **options).stories.peak_drift


# ---- First page


@states("README.md", "a run [estimates the errors](configs/RUNS.md#error-estimates) of its peaks")
def errors_are_estimated():
    for model in (FRAME, YIELDING_FRAME):
        errors = tdint.run(model, motion()).check.errors
        assert np.all(errors.peak_drift > 0) and np.all(errors.peak_total_shear > 0)


@states("README.md", "`impulse4` locates yielding within a time step and keeps fourth-order")
def order_with_yielding_stories():
    true, coarse, fine = (peaks(0.01 / parts, method="impulse4") for parts in (32, 1, 4))
    assert np.max(np.abs(coarse - true)) > 4**3.3 * np.max(np.abs(fine - true))


@states("README.md", "`moment4` conserves energy")
def energy_of_moment4():
    change = {}
    for method in ("moment4", "impulse4"):
        energy = tdint.run(STIFFENING, dt=0.05, duration=10.0, method=method, check=False).energy
        change[method] = abs((energy.kinetic + energy.strain) / energy.initial - 1.0)
    assert change["moment4"] < 1e-9 < change["impulse4"]


@states("README.md", "`exact` is for linear buildings")
@states("src/tdint/methods/README.md", "`exact` supports linear buildings only")
@states("src/tdint/methods/README.md", "A linear building under a record: `exact`, which has only")
def exact_is_linear():
    exact = peaks(0.01, FRAME, method="exact")
    assert np.allclose(peaks(0.005, FRAME, method="exact"), exact, rtol=1e-9)
    with pytest.raises(tdint.TdintError, match="linear"):
        peaks(0.01, method="exact")


@states("README.md", "(`--no-check` omits the estimates)")
def no_check_omits_estimates():
    with_errors, without = (
        rows(command(f"run frame.yaml {option}").stdout)[0] for option in ("", "--no-check")
    )
    assert "peak_drift_ratio_error" in with_errors and "peak_drift_ratio_error" not in without


# ---- Command line


@states("cli/README.md", "A ratio is `0.05` or `5%`. A grid is `FIRST:LAST:COUNT`, logarithmically")
def ratios_and_grids():
    lines = [
        rows(command(f"spectrum {RECORD} --component HN1 --damping {text} --period .1:10:3").stdout)
        for text in ("0.05", "5%")
    ]
    assert lines[0] == lines[1]
    assert [float(row["period_s"]) for row in lines[0]] == pytest.approx([0.1, 1.0, 10.0])


@states("cli/README.md", "`-o -` is standard output")
def minus_is_standard_output():
    assert command("modes frame.yaml -o -").stdout == command("modes frame.yaml").stdout


@states("cli/README.md", "a command never replaces its inputs")
def inputs_stay():
    command("modes frame.yaml -o frame.yaml --overwrite", code=6)
    assert read("frame.yaml") == FILE


@states("cli/README.md", "Without it, results are in SI")
def results_are_in_si():
    si, us = (
        rows(command(f"run frame.yaml --no-check {option}").stdout)[0]
        for option in ("", "--output-units kip,in,g")
    )
    assert float(si["peak_drift_m"]) == pytest.approx(0.0254 * float(us["peak_drift_in"]))
    assert float(si["peak_shear_N"]) == pytest.approx(4448.2216 * float(us["peak_shear_kip"]))


@states("cli/README.md", "a number without a unit is in the units of the model")
def set_is_in_units_of_the_model():
    first = [
        rows(command(f"modes frame.yaml --set stories[1].stiffness={value}").stdout)[0]
        for value in ("4e5", "4e8 N/m".replace(" ", ""))
    ]
    assert first[0] == first[1] != rows(command("modes frame.yaml").stdout)[0]


@states("cli/README.md", "CSV with 12 significant digits")
def twelve_digits():
    numbers = re.findall(r"\d*\.\d+", command("modes frame.yaml").stdout)
    assert max(len(number.replace(".", "").lstrip("0")) for number in numbers) == 12


@states("cli/README.md", "contains options, inputs with their SHA-256, results and versions")
def summary_has_digests():
    command("run frame.yaml --no-check -o out")
    text = read("out/summary.json")
    assert hashlib.sha256(Path(RECORD).read_bytes()).hexdigest() in text
    assert hashlib.sha256(FILE.encode()).hexdigest() in text
    assert tdint.__version__ in json.dumps(json.loads(text))


@states(
    "cli/README.md",
    "| 2 | invalid option, argument, method, or output name |",
    "| 3 | invalid input file other than a record: model, campaign, table, target |",
    "| 4 | invalid record;",
    "| 5 | analysis: not converged, diverged, unstable time step,",
    "| 6 | output: a file exists or cannot be written |",
)
def exit_codes():
    command("run frame.yaml --method nix", code=2)
    for line in (
        "run no.yaml",
        "campaign no.yaml -o out",
        "fragility no.csv",
        "modes frame.yaml --target no",
    ):
        command(line, code=3)
    command("run frame.yaml no.at2", code=4)
    command("run frame.yaml --method central-difference --dt 0.5", code=5)
    command("run frame.yaml --tolerance 1e-12", code=5)
    command("modes frame.yaml -o modes.csv")
    command("modes frame.yaml -o modes.csv", code=6)


@states("cli/README.md", "A failed run writes only `summary.json`, without peaks")
def failed_run():
    Path("stiff.yaml").write_text(json.dumps(STIFFENING), encoding="utf-8")
    command("run stiff.yaml --method chang --dt 0.05 --duration 10 -o out", code=5)
    assert [file.name for file in Path("out").iterdir()] == ["summary.json"]
    assert "peaks" not in json.loads(read("out/summary.json"))


@states(
    "cli/README.md", "`stories.csv` lists the peaks of each event and, as `all`, of the sequence"
)
def events_of_a_sequence():
    command(f"run frame.yaml {RECORD} {RECORD} --component HN1 --sequence --rest 1 -o shocks")
    events = [row["shock"] for row in rows(read("shocks/stories.csv"))]
    assert list(dict.fromkeys(events)) == ["1", "2", "all"]


# ---- Models


@states("configs/README.md", "and optionally its ground motion, forces and analysis")
def only_a_building_is_required():
    assert (
        tdint.load_model({"stories": [{"mass": 1.0, "stiffness": 1.0}]}).excitation.record is None
    )


@states("configs/MODEL.md", "Without `damping`, there is no damping")
def no_damping():
    assert not np.any(tdint.modes({"stories": [STORY]}).damping)


@states("configs/MODEL.md", "`5%` is Rayleigh damping with 5 % in modes 1 and 3 (or the last one)")
def rayleigh_modes():
    for count in (2, 3, 5):
        ratios = tdint.modes({"stories": [{**STORY, "repeat": count}], "damping": "5%"}).damping
        assert ratios[[0, min(3, count) - 1]] == pytest.approx(0.05)


@states("configs/MODEL.md", "is 5 % in mode 1 and 3 % in all other modes")
def modal_damping():
    ratios = tdint.modes({"stories": [STORY], "damping": {"modal": ["5%", "3%"]}}).damping
    assert ratios == pytest.approx([0.05, 0.03, 0.03])


@states("configs/MODEL.md", "A ratio is 0.02, 2% or 1/50")
def spellings_of_a_ratio():
    models = [{"stories": [STORY], "damping": text} for text in (0.02, "2%", "1/50")]
    assert len({tdint.modes(model).damping.tobytes() for model in models}) == 1


@states("configs/MODEL.md", "the stiffness of a story is reduced by the weight above divided by")
def p_delta():
    story = {"mass": 1e5, "height": 3.0, "stiffness": 1e8}
    plain, reduced = (
        tdint.matrices({"stories": [story], "p_delta": value}).stiffness[0, 0]
        for value in (False, True)
    )
    assert plain - reduced == pytest.approx(1e5 * 9.80665 / 3.0)


@states("configs/MODEL.md", "The force is linear between rows, and zero before the first and after")
def forces_between_rows():
    force = {"floor": 1, "points": [[1.0, 0.0], [2.0, 1e5], [3.0, 1e5]]}
    model = {
        "stories": [{**STORY, "repeat": 1}],
        "excitation": {"forces": [force]},
        "damping": "20%",
    }
    history = tdint.run(model, dt=0.01, duration=6.0, history=True, check=False).history
    quasistatic = 1e8 * history.drift[:, 0]
    assert not np.any(quasistatic[history.time <= 1.0])
    assert quasistatic[250] == pytest.approx(1e5, rel=0.02)
    assert abs(quasistatic[-1]) < 1.0


@states("configs/LAWS.md", "a first coefficient of 0 is a story without initial stiffness")
def polynomial_without_stiffness():
    law = {"type": "polynomial", "coefficients": [0.0, 0.0, 1e6]}
    model = {"stories": [{"mass": 1e3, "dashpot": 1e4, "law": law}], "initial": {"velocity": [1.0]}}
    assert tdint.run(model, dt=0.01, duration=1.0, method="impulse4").status == "done"
    with pytest.raises(ModelError):
        tdint.run({**model, "damping": "5%"}, dt=0.01, duration=1.0, method="impulse4")


@states("configs/LAWS.md", "a first point without force, `[[0.004, 0], [0.014, 60]]`, is a slack")
def slack():
    law = {"type": "multilinear", "rule": "elastic", "backbone": [[0.004, 0], [0.014, 60.0]]}
    path = tdint.law_path(
        {"stories": [{"mass": 1.0, "law": law}]}, 1, [0.0, 0.004, 0.009, 0.014]
    ).path
    assert path.shear[-4:] == pytest.approx([0.0, 0.0, 30.0, 60.0])


@states("configs/STRUCTURES.md", "drift ratios and base shear refer to the stories")
@states(
    "configs/STRUCTURES.md", "Rayleigh and modal damping are formed from the stories only, so that"
)
def attachments_and_stories():
    tank = {"name": "tank", "floor": 1, "mass": 1e4, "stiffness": 1e6}
    response = tdint.run({**FRAME, "attachments": [tank]}, motion(), check=False)
    assert response.stories.peak_drift_ratio.shape == (3,)
    alone, beside = (
        tdint.run({**FRAME, **extra}, motion(), check=False).stories.peak_drift
        for extra in ({}, {"attachments": [{**tank, "mass": 1e-3, "stiffness": 1e-1}]})
    )
    assert beside == pytest.approx(alone, rel=1e-6)


@states("configs/STRUCTURES.md", "P-delta.** The weight of an attachment acts in the stories below")
def weight_of_an_attachment():
    tank = {"name": "tank", "floor": 1, "mass": 1e4, "stiffness": 1e6}
    plain, loaded = (
        tdint.matrices(
            {"stories": [{**STORY, "repeat": 1}], "p_delta": value, "attachments": [tank]}
        )
        for value in (False, True)
    )
    change = plain.stiffness - loaded.stiffness
    assert change[0, 0] == pytest.approx(1.1e5 * 9.80665 / 3.0) and change[1, 1] == 0.0


@states("configs/RUNS.md", "The default time step (`--dt`) is the sampling interval of the record")
@states("configs/RUNS.md", "otherwise, the error message states the nearest valid steps")
def default_step():
    assert tdint.run(FRAME, motion(), check=False).dt == motion().dt
    for dt in (0.02, 0.0025):
        peaks(dt, FRAME)
    with pytest.raises(UsageError, match=r"0\.005"):
        peaks(0.006, FRAME)


@states("configs/RUNS.md", "With forces and without a record, the default is a fiftieth")
@states("configs/RUNS.md", "an initial motion alone requires `--dt`")
def default_step_without_record():
    force = {"forces": [{"floor": 1, "points": [[0.0, 0.0], [1.0, 1e4]]}]}
    response = tdint.run({**FRAME, "excitation": force}, duration=1.0, check=False)
    assert response.dt == pytest.approx(tdint.modes(FRAME).period[0] / 50.0, rel=0.05)
    with pytest.raises(UsageError, match="dt"):
        tdint.run({**FRAME, "initial": {"velocity": [1.0, 0.0, 0.0]}}, duration=1.0)


@states("configs/RUNS.md", "continues with the ground at rest while a peak could still grow")
def runs_continue():
    pulse = tdint.make_record(np.sin(np.linspace(0, np.pi, 26)), dt=0.02, units="g")
    model = {"stories": [{"mass": 1e3, "period": 2.0}]}
    response = tdint.run(model, pulse, history=True, check=False)
    time, drift = response.history.time, np.abs(response.history.drift[:, 0])
    assert time[drift.argmax()] > pulse.duration
    assert response.stories.peak_drift[0] == pytest.approx(drift.max(), rel=1e-3)


@states("configs/RUNS.md", "contain 4/3 of the difference of both runs (three times the difference")
def estimates_from_both_runs():
    for method, factor in (("newmark-average", 4.0 / 3.0), ("impulse4", 3.0)):
        check = tdint.run(YIELDING_FRAME, motion(), method=method).check
        difference = np.abs(check.corrected.peak_drift - peaks(0.01, method=method))
        assert np.max(check.errors.peak_drift / (factor * difference)) > 0.999
        assert np.min(check.errors.peak_drift / (factor * difference)) > 0.999


@states("configs/RUNS.md", "Runs of several records estimate errors only with `--check`")
def errors_of_several_runs():
    for option, has_errors in (("", False), ("--check", True)):
        line = f"run frame.yaml {RECORD} --units m/s^2 --component HN1 --scale 1,2 {option}"
        names = rows(command(line).stdout)[0]
        assert ("peak_drift_ratio_error" in names) == has_errors


@states(
    "configs/RUNS.md", "for which the estimated error of every peak drift is within this fraction"
)
def tolerance():
    check = (response := tdint.run(YIELDING_FRAME, motion(), tolerance="0.1%")).check
    assert np.all(check.errors.peak_drift <= 1e-3 * response.stories.peak_drift)


# ---- Records


@states("records/README.md", "The content determines the format")
def content_determines_the_format():
    Path("motion.at2").write_bytes(Path(RECORD).read_bytes())
    same = tdint.read_record("motion.at2", component="HN1", units="m/s^2")
    assert np.array_equal(same.acceleration, shipped()["near-fault", "HN1"].acceleration)


@states("records/README.md", "A record without units is an error, except floating-point MiniSEED")
def units_are_required():
    np.savetxt("motion.txt", np.sin(np.arange(50.0)))
    command("info motion.txt --step 0.02", code=4)
    command("info motion.txt --step 0.02 --units g")


@states(
    "records/README.md",
    "interpolated linearly, which is reported; text tables need `--resample` for this",
)
def unequal_times():
    times = np.cumsum([0.0, *(20 * [0.01] + 10 * [0.02] + 5 * [0.03])])
    values = np.sin(10.0 * times).round(4)
    lines = [f"{t:.2f},{a}" for t, a in zip(times, values, strict=True)]
    Path("uneven.csv").write_text("\n".join(["Time (s),Acc (g)", *lines, ""]), encoding="utf-8")
    assert "--resample" in command("info uneven.csv", code=4).stderr
    assert "interpolated linearly" in command("info uneven.csv --resample 0.01").stdout
    command("info uneven.csv --resample 0.01 --export even.csv")
    record = tdint.read_record("even.csv")
    at = np.interp(record.dt * np.arange(record.acceleration.size), times, values)
    assert record.acceleration / 9.80665 == pytest.approx(at, abs=1e-9)


@states("records/README.md", "Each component has 8192 samples at an interval of 0.02 s")
@states(
    "records/README.md", "The samples are in m/s^2 at an interval of 0.01 s; g is 9.81 m/s^2 here"
)
def shipped_records():
    page = (ROOT / "records/README.md").read_text(encoding="utf-8")
    name = ""
    compared = 0
    for line in page.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if match := re.match(r"`([\w/-]+)\.mseed`$", cells[0]):
            name = match[1]
        channel = next((cell for cell in cells if re.fullmatch(r"HN\w", cell)), None)
        if not line.startswith("|") or not channel:
            continue
        record = shipped()[name, channel]
        is_real = "/" in name
        pga = float(next(cell for cell in cells if cell.endswith(" g")).split()[0])
        assert f"{record.pga / (9.80665 if is_real else 9.81):.3f}" == f"{pga:.3f}", (name, channel)
        assert (record.dt, record.acceleration.size == 8192) == (
            (0.02, True) if is_real else (0.01, False)
        )
        if not is_real:
            assert cells[-1] == f"{tdint.intensity(record, 'pgv'):.2f} m/s"
        compared += 1
    assert compared == len(shipped()) == 12


@states("records/README.md", "directories (without their subdirectories)")
def no_subdirectories():
    found = rows(command(f"info {ROOT / 'records'}").stdout)
    assert {row["record"].rpartition("records/")[2] for row in found} == {
        "firm-soil.mseed", "near-fault.mseed", "soft-soil.mseed",
    }  # fmt: skip


@states("records/README.md", "A record is used unchanged unless processing is requested")
@states("records/README.md", "4.8 periods of the corner frequency for order 4, 48 s for 0.1 Hz")
def processing():
    record = shipped()["near-fault", "HN1"]
    assert tdint.read_record(RECORD, component="HN1", units="m/s^2").processing == ()
    filtered = tdint.process(record, highpass=0.1)
    assert filtered.duration - record.duration == pytest.approx(2 * 48.0, abs=0.3)


@states(
    "records/README.md",
    "by up to 5 % in the shipped horizontal motions, by 36 % in the vertical one of WTMC",
)
def arias_intensity():
    below = {}
    for key, record in shipped().items():
        sums = math.pi * record.dt / (2 * 9.80665) * np.sum(record.acceleration**2)
        below[key] = 100 * (1 - tdint.intensity(record, "arias") / sums)
    assert min(below.values()) > 0 and round(below["kaikoura/WTMC", "HNZ"]) == 36
    assert round(max(part for (_, name), part in below.items() if name != "HNZ")) == 5


# ---- Spectra


@states(
    "src/tdint/response/spectra/README.md", "The value at period 0 is the peak ground acceleration"
)
def period_zero():
    assert tdint.spectrum(motion(), [0.0]).psa == pytest.approx(motion().pga)


@states(
    "src/tdint/response/spectra/README.md",
    "gives a PSA of 9.25 m/s^2 at 2 s without damping, but 6.54",
)
def half_sine():
    sine = tdint.make_record(np.sin(np.linspace(0, np.pi, 501)), dt=0.001, units="g")
    (whole,) = tdint.spectrum(sine, [2.0], damping=0.0).psa
    t = np.linspace(0.0, 0.5, 501)  # u'' + w^2 u = -g sin(2 pi t), at rest, until the last sample
    w, p = math.pi, 2 * math.pi
    during = 9.80665 * np.abs(np.sin(p * t) - p / w * np.sin(w * t)) / (p**2 - w**2)
    assert (f"{whole:.2f}", f"{w**2 * during.max():.2f}") == ("9.25", "6.54")


@states(
    "src/tdint/response/spectra/README.md", "| -19 %; -3 % |", "| 26 %; 3 % |", "| -3 %; -3 % |"
)
def other_spectra():
    largest = {}
    artificial = [record for (name, _), record in shipped().items() if "/" not in name]
    periods = np.geomspace(0.01, 10.0, 200)
    exact = np.array([tdint.spectrum(record, periods).psa for record in artificial])
    for options in ({"maxima": "peer"}, {"maxima": "samples"}, {"interpolation": "band-limited"}):
        others = np.array([tdint.spectrum(record, periods, **options).psa for record in artificial])
        parts = [100 * (others / exact - 1)[:, periods >= low].ravel() for low in (0.01, 0.1)]
        largest[next(iter(options.values()))] = [round(x[np.abs(x).argmax()]) for x in parts]
    assert largest == {"peer": [-3, -3], "samples": [-19, -3], "band-limited": [26, 3]}


@states(
    "src/tdint/response/spectra/README.md", "the result is the largest strength that reaches the"
)
def strength_of_a_ductility():
    periods = [0.5, 1.0]
    (found,) = tdint.constant_ductility(motion(), periods, [3.0])
    for number, strength in enumerate(found.yield_strength_ratio):
        (again,) = tdint.constant_strength(motion(), periods[number:][:1], [strength])
        assert again.ductility == pytest.approx(3.0, rel=1e-3)


@states(
    "src/tdint/response/spectra/README.md", "percentiles of PSA over 180 directions (Boore 2010)"
)
def directions():
    pair = [shipped()["near-fault", name] for name in ("HN1", "HN2")]
    found = tdint.rotated_spectrum(pair, [0.5], percentiles=[0, 50, 100]).psa[:, 0]
    psa = []
    for angle in np.radians(np.arange(180)):
        turned = np.cos(angle) * pair[0].acceleration + np.sin(angle) * pair[1].acceleration
        psa.append(tdint.spectrum(tdint.make_record(turned, dt=0.01, units="m/s^2"), [0.5]).psa[0])
    assert found == pytest.approx(np.percentile(psa, [0, 50, 100]), rel=1e-6)


# ---- Studies


@states("src/tdint/studies/README.md", "brackets the collapse level within 5 %")
@states("src/tdint/studies/README.md", "at 239 drift ratios up to the collapse drift")
def collapse_levels():
    line = f"ida {ROOT / 'configs/collapse-prone-frame.yaml'} {RECORD} --units m/s^2 -q -o ida"
    command(f"{line} --component HN1")
    (row,) = (row for row in rows(read("ida/capacities.csv")) if row["threshold"] == "0.1")
    assert float(row["upper"]) <= 1.05 * float(row["lower"])
    assert len(rows(read("ida/fractiles.csv"))) == 239


@states("src/tdint/studies/README.md", "All keys are in [keys.csv](keys.csv)")
def keys_of_campaigns():
    schema = json.loads(command("check --schema campaign").stdout)
    with (ROOT / "src/tdint/studies/keys.csv").open(encoding="utf-8") as file:
        described = {row["name"] for row in rows(file.read())}
    assert set(schema["properties"]) <= described


@states(
    "src/tdint/studies/README.md", "The two components of a recording count as one motion, with the"
)
def pairs_count_once():
    pair = [(shipped()["near-fault", "HN1"], shipped()["near-fault", "HN2"])]
    runs = [tdint.run(FRAME, record, check=False) for record in pair[0]]
    both = tdint.run_many(FRAME, list(pair[0]), check=False).stories.peak_drift
    assert both.max(axis=0) == pytest.approx(
        np.max([run.stories.peak_drift for run in runs], axis=0)
    )
    assert len(tdint.scale(pair, "pga", 1.0).factors) == 1


# ---- Plug-ins


@states(
    "src/tdint/README.md", "With None, the measure is computed again for each factor, and `ida` and"
)
def measures_of_plugins():
    Path("bracketed.py").write_text(block("plugin-measure"), encoding="utf-8")
    line = f"scale {RECORD} --component HN1 --units m/s^2 --to bracketed=5 --plugin bracketed.py"
    assert "bracketed" in command(line, code=2).stderr


@states("src/tdint/README.md", "lists other imports with the names to import instead")
def imports_of_plugins():
    text = "from tdint.ground_motion.measures import Measure\n\nMEASURES = ()\n"
    Path("private.py").write_text(text, encoding="utf-8")
    result = runner().invoke(cli, ["check", "--plugin", "private.py"])
    assert "tdint.plugin" in result.output


# ---- Methods and kernels


@states("src/tdint/methods/README.md", "larger time steps are refused unless `--allow-unstable`")
def unstable_steps():
    line = "run frame.yaml --no-check --method central-difference --dt 0.1"
    assert "largest stable step" in command(line, code=5).stderr
    assert "diverged" in command(f"{line} --allow-unstable", code=5).stderr


@states(
    "src/tdint/methods/README.md", "stable up to omega dt = 3.745 without damping, 3.27 with 5 %"
)
def limits_of_noh_bathe():
    for damping, limit in ((0.0, 3.745), (0.05, 3.27)):
        steps = np.array([limit - 0.005, limit + 0.01]) / (2 * math.pi)
        below, above = tdint.stability("noh-bathe", steps, damping=damping).spectral_radius
        assert below <= 1.0 + 1e-9 < above


@states("src/tdint/methods/README.md", "The method adds no energy")
def moment4_adds_no_energy():
    for rho in (0.0, 0.5, 1.0):
        order = tdint.stability(f"moment4:rho_inf={rho}", np.geomspace(0.01, 100.0, 30))
        assert np.all(order.spectral_radius <= 1.0 + 1e-9)


@states("src/tdint/kernels/README.md", "The building alone selects the form")
@states("src/tdint/kernels/README.md", "| `plain` | all laws, no optional features |")
def forms():
    plain, modal = (
        variant(tdint.prepare({"stories": [STORY], "damping": damping}, motion()).building)
        for damping in ("2%", {"modal": "2%"})
    )
    assert (plain.form, modal.form) == ("plain", "full")


@states("src/tdint/kernels/README.md", "a hash of the code that it imports, without docstrings and")
def comments_are_not_hashed():
    one = b'"""A."""\n\n\ndef f(x):\n    """Return x."""\n    return x  # same\n'
    assert code_of_text(one) == code_of_text(
        one.replace(b"Return x", b"Give x").replace(b"# same", b"# y")
    )
    assert code_of_text(one) != code_of_text(one.replace(b"return x", b"return -x"))


@states(
    "src/tdint/kernels/README.md", "`tdint compile --show` lists the file and the origin of each"
)
def compile_show():
    output = command("compile frame.yaml --show").output
    assert "impulse4" in output and "linear" in output and os.environ["TDINT_CACHE_DIR"] in output


# ---- Tests


@cache
def flat(page):
    """Return the text of a page with single spaces."""
    return " ".join((ROOT / page).read_text(encoding="utf-8").split())


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("probe", dict.fromkeys(row[2] for row in STATED), ids=lambda f: f.__name__)
def test_statement_is_true(probe, tmp_path, monkeypatch):
    for page, sentence, function in STATED:
        assert function is not probe or " ".join(sentence.split()) in flat(page), sentence
    monkeypatch.chdir(tmp_path)
    (tmp_path / "frame.yaml").write_text(FILE, encoding="utf-8")
    probe()


def test_each_page_has_probes():
    assert {page for page, _, _ in STATED} == PAGES
    assert all((readmes.ROOT / page).exists() for page in PAGES)
