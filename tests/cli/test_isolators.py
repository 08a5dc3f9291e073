"""Isolator stories: displacements instead of drift ratios, P-delta with their height, and no
Rayleigh damping; warnings of stories that become unstable by P-delta."""

from pathlib import Path

import numpy as np
import pytest

from cli.test_report import Page
from csv_rows import rows
from tdint.errors import ModelError
from tdint.model.building import assemble, stiffness_after_yield, unstable_after_yield
from tdint.model.config.model_file import load_model
from tdint.output.report import damping_text
from tdint.units import STANDARD_GRAVITY

UPPER = "  - {repeat: 3, mass: 20, height: 3, stiffness: 9000}\n"
RAYLEIGH = "damping: {rayleigh: {mass: 0.3, stiffness: 0.004}}\n"


def model(tmp_path: Path, first: str, upper: str = UPPER, sections: str = ""):
    file = tmp_path / "model.yaml"
    file.write_text(f"stories:\n  - {{{first}}}\n{upper}{sections}")
    return load_model(file)


@pytest.mark.parametrize("below", [0, 2])
def test_rayleigh_damping_excludes_isolators(tmp_path, below):
    """A rigid-body motion above the isolator is not damped. Relative motions of the floors above
    are damped as on a fixed base."""
    first = "mass: 20, height: 3, stiffness: 9000"
    fixed = assemble(model(tmp_path, first, UPPER, RAYLEIGH)).damping_matrix()
    under = "mass: 30, height: 4, stiffness: 8000"
    isolator = "mass: 25, height: 0.5, stiffness: 300, isolator: true"
    stories = [*[under] * below, isolator, first]
    upper = "".join(f"  - {{{story}}}\n" for story in stories[1:]) + UPPER
    damping = assemble(model(tmp_path, stories[0], upper, RAYLEIGH)).damping_matrix()
    block = np.zeros(len(damping))
    block[below:] = 1.0
    assert np.abs(damping @ block)[below:] == pytest.approx(0.0, abs=1e-12)
    assert damping[below + 1 :, below + 1 :] == pytest.approx(fixed, rel=1e-12, abs=1e-12)
    assert damping == pytest.approx(damping.T, rel=1e-12, abs=1e-12)
    if below:
        lower_part = assemble(
            model(tmp_path, under, f"  - {{{under}}}\n", RAYLEIGH)
        ).damping_matrix()
        assert damping[:below, :below] == pytest.approx(lower_part, abs=1e-12)


def test_rayleigh_damping_includes_isolators_on_request(tmp_path):
    plain = assemble(
        model(tmp_path, "mass: 25, stiffness: 300", sections=RAYLEIGH)
    ).damping_matrix()
    included = assemble(
        model(tmp_path, "mass: 25, stiffness: 300, isolator: rayleigh", sections=RAYLEIGH)
    ).damping_matrix()
    assert (included == plain).all()


@pytest.mark.parametrize("damping", [RAYLEIGH, "damping: 3%\n"])
def test_a_report_states_that_rayleigh_damping_excludes_isolators(tmp_path, damping):
    """The damping ratio of the first mode differs from the specified ratio if isolators are
    excluded."""
    texts = {
        isolator: damping_text(
            model(tmp_path, f"mass: 25, stiffness: 300, isolator: {isolator}", sections=damping)
        )
        for isolator in ("true", "rayleigh", "false")
    }
    assert (
        texts["rayleigh"] == texts["false"]
        and texts["true"] == texts["false"] + ", without the share of the isolators"
    )


def test_p_delta_uses_weight_over_height_of_an_isolator(tmp_path):
    """The modes equal those of stories with stiffnesses reduced by W/h. The height of the isolator
    has no other effect."""
    weights = STANDARD_GRAVITY * np.array([85.0, 60.0, 40.0, 20.0])
    first = "mass: 25, height: 2.5, stiffness: 3000, isolator: true"
    isolated = assemble(model(tmp_path, first, UPPER, "p_delta: true\n"))
    k = np.array([3000.0, 9000.0, 9000.0, 9000.0]) - weights / np.array([2.5, 3.0, 3.0, 3.0])
    stories = "".join(f"  - {{mass: 20, stiffness: {value!r}}}\n" for value in k[1:].tolist())
    soft = assemble(model(tmp_path, f"mass: 25, stiffness: {k[0].item()!r}", stories))
    assert isolated.modes().omega == pytest.approx(soft.modes().omega, rel=1e-12)
    assert np.isnan(isolated.heights).tolist() == [True, False, False, False]
    assert isolated.height_contributions.tolist() == [0.0, 3.0, 3.0, 3.0]
    with pytest.raises(ModelError, match="p_delta needs the height"):
        model(tmp_path, "mass: 25, stiffness: 3000, isolator: true", sections="p_delta: true\n")


def test_isolator_drift_is_a_displacement_and_no_collapse(folder, tdint):
    """A displacement of 0.3 m of bearings with a height of 0.5 m is not a drift ratio of 60 %."""
    text = "name: {name}\nstories:\n  - {{mass: 25, stiffness: 50, {isolator}}}\n"
    for name, isolator in (("yes", "isolator: rayleigh, height: 0.5"), ("no", "height: 0.5")):
        Path(f"{name}.yaml").write_text(
            text.format(name=name, isolator=isolator) + UPPER + RAYLEIGH
        )
    run = ("motion.mseed", "--component", "HNN", "--units", "m/s^2", "--scale", "2")
    run += ("--duration", "2.99")
    with_isolator, without = (
        tdint("run", "yes.yaml", *run, "--plot=yes.png"),
        tdint("run", "no.yaml", *run),
    )
    assert "Status collapsed" in without.stderr and "collapsed" not in with_isolator.stderr
    assert "drift ratio" in with_isolator.stderr and "in story 1, roof" in with_isolator.stderr
    first, *upper_rows = rows(with_isolator.stdout)
    plain, *plain_upper_rows = rows(without.stdout)
    assert (first["height_m"], first["peak_drift_ratio"]) == ("", "")
    assert first["peak_drift_m"] == plain["peak_drift_m"] and float(plain["peak_drift_ratio"]) > 0.1
    # After a collapse there are no residual drifts.
    assert all(row["residual_drift_m"] == "" for row in (plain, *plain_upper_rows))
    for row, plain_row in zip(upper_rows, plain_upper_rows, strict=True):
        assert float(row["residual_drift_m"]) == 0.0  # a linear building
        assert {name for name in row if row[name] != plain_row[name]} == {
            "residual_drift_m",
            "residual_drift_m_error",
        }
    several = tdint("run yes.yaml motion.mseed other.mseed --units m/s^2 --limit 10%")
    (drift,) = (line for line in several.stderr.splitlines() if line.startswith("Mean drift"))
    assert "(story 1)" not in drift
    assert "\nMean isolator displacement " in several.stderr


def test_a_story_that_becomes_unstable_by_p_delta_causes_a_warning(folder, tdint):
    text = (
        "p_delta: true\nstories:\n  - {mass: 40, height: 2, stiffness: 3000, law: {type: bilinear, "
        "yield_force: 60, hardening: %s}}\n"
    )
    Path("falls.yaml").write_text(text % 0.05)
    weight, stiffness = 40 * STANDARD_GRAVITY / 2, 0.05 * 3000
    single = ("motion.mseed", "--component", "HNE", "--units", "m/s^2")
    several = ("motion.mseed", "other.mseed", "--units", "m/s^2")
    kip_in = 4448.2216152605 / 0.0254
    for arguments, unit in (
        (single, 1e6),
        (several, 1e6),
        ((*single, "--output-units", "kip,in"), kip_in),
    ):
        message = f": story 1: {weight / unit:.4g} and {stiffness / unit:.4g}"
        assert message in tdint("run", "falls.yaml", *arguments).stderr, arguments
    Path("stands.yaml").write_text(text % 0.07)
    assert "P-delta reduces" not in tdint("run", "stands.yaml", *single).stderr
    assert unstable_after_yield(load_model("shaken.yaml")) == ()


@pytest.mark.parametrize(
    ("law", "stiffness"),
    [
        ("{type: bilinear, yield_force: 60, hardening: 0.1}", 100.0),
        ("{type: bouc-wen, yield_force: 60, hardening: 0.1, exponent: 2, beta: 0.5}", 100.0),
        ("{type: peak-oriented, yield_force: 60, hardening: 0.1, unloading: 0}", 100.0),
        ("{type: tanh, strength: 60}", 0.0),
        (
            "{type: trilinear-pinching, yield_force: 50, ultimate_force: 80, ultimate_drift: 0.35, "
            "pinching: 1, unloading: 0}",
            100.0,
        ),
        ("linear", np.inf),
    ],
)
def test_the_stiffness_after_yield(tmp_path, law, stiffness):
    story = model(tmp_path, f"mass: 1, stiffness: 1000, law: {law}").stories[0]
    assert stiffness_after_yield(story) == pytest.approx(stiffness, rel=1e-12)


def test_the_report_contains_the_period_of_the_secant_stiffness(folder, tdint):
    """The period of a rigid block on an isolator is 2 pi sqrt(m / k) before yielding and
    2 pi sqrt(m d / V) with the secant stiffness."""
    Path("block.yaml").write_text(
        "stories:\n  - {mass: 25, stiffness: 3000, isolator: true, law: {type: bilinear, "
        "yield_force: 5, hardening: 0.1}}\n"
    )
    motion = ("motion.mseed", "--component", "HNN", "--units", "m/s^2")
    row = rows(tdint("run", "block.yaml", *motion, "--report", "block.html").stdout)[0]
    secant = float(row["peak_shear_N"]) / float(row["peak_drift_m"])
    before, at_peak = (2.0 * np.pi * np.sqrt(25.0 / k) for k in (3000.0, secant))
    text = (
        f"first period {before:.4g} s (before the isolators yield; {at_peak:.4g} s with their "
        "secant stiffness"
    )
    assert text in Page(Path("block.html").read_text("utf-8")).text and at_peak > 1.5 * before
    assert "for the initial stiffness of the isolators" in tdint("modes", "block.yaml").stderr


def test_plausibility_off_suppresses_warnings_with_a_reason(folder, tdint):
    text = Path("shaken.yaml").read_text()
    Path("odd.yaml").write_text(text + "collapse_drift: 0.5\n")
    Path("meant.yaml").write_text(
        text + "collapse_drift: 0.5\nplausibility: off, test rig in the laboratory\n"
    )
    assert "unusual collapse_drift: 0.5; " in tdint("check", "odd.yaml").stderr
    for command in ("check", "run"):
        messages = tdint(command, "meant.yaml").stderr
        assert "usual" not in messages and "not shown: test rig in the laboratory" in messages
    Path("bare.yaml").write_text(text + "plausibility: off\n")
    assert "plausibility: must be `off`" in tdint("check", "bare.yaml", code=3).stderr
