"""Content of valid model files in SI units."""

import hashlib
import io
import math
import subprocess
import sys
from pathlib import Path

import pytest

from tdint.ground_motion.choice import Processing, RecordChoice
from tdint.model.config.model_file import load_model
from tdint.model.definition import (
    Analysis,
    Excitation,
    Force,
    Initial,
    ModalDamping,
    RayleighCoefficients,
    RayleighRatio,
    RecordSource,
)
from tdint.model.story import PowerDashpot, Story
from tdint.model.story_laws import Law

G = 9.80665

EVERYTHING = """\
name: ten-story office
units: {length: cm, force: kN, mass: t}
stories:
  - {mass: 200, height: 400, stiffness: 3.5e3}
  - repeat: 2
    mass: 150
    height: 350
    stiffness: 3E3
    law: {type: bilinear, yield_force: 2.5e3, hardening: 0.03}
    dashpot: 2
  - mass: 100
    height: 350
    law:
      type: polynomial
      coefficients: [2e3, -3, 4.0]
damping: {rayleigh: {ratio: [0.02, 0.05], modes: [1, 3]}}
p_delta: true
excitation:
  record: {file: ../records/x.mseed, units: cm/s^2, component: HNE, scale: -1.5, inventory: station.xml, trim: ":30",
           baseline: linear, pad: 5, highpass: 0.1, lowpass: 25, filter_order: 3, resample: 0.005}
  forces:
    - {floor: 1, amplitude: 500, omega: 25, phase: cos}
    - {floor: 4, amplitude: -2, omega: 0.5, phase: sin}
initial: {displacement: [0.1, 0, 0, -2], velocity: [0, 1, 0, 0]}
analysis: {method: "generalized-alpha:rho_inf=0.8", dt: 0.01, duration: 40}
collapse_drift: 0.05
"""  # noqa: E501


def load(text: str):
    return load_model(io.StringIO(text))


def one_story(extra: str = "", story: str = "mass: 1, stiffness: 1"):
    return load(f"stories: [{{{story}}}]\n{extra}")


def test_model_with_all_features_is_read_in_si(tmp_path: Path) -> None:
    path = tmp_path / "building.yaml"
    path.write_text(EVERYTHING)
    model = load_model(path)

    assert model.name == "ten-story office"
    assert model.source == str(path)
    assert hashlib.sha256(model.text).hexdigest() == hashlib.sha256(EVERYTHING.encode()).hexdigest()
    assert len(model.stories) == 4
    first, second, third, fourth = model.stories
    assert first == Story(2e5, 4.0, 3.5e8, Law("linear", ()), 0.0)
    assert second.stiffness == pytest.approx(3e8)
    assert second.law == Law("bilinear", (2.5e6, 0.03))
    assert second.dashpot == pytest.approx(2e5)  # 2 kN s/cm
    assert third is second
    assert fourth.stiffness == pytest.approx(2e8)  # 2e3 kN/cm
    assert fourth.law.name == "polynomial"
    assert fourth.law.parameters == pytest.approx((2e8, -3e7, 4e9))  # kN/cm, kN/cm^2, kN/cm^3
    assert fourth.height == pytest.approx(3.5)
    assert model.damping == RayleighRatio((0.02, 0.05), (1, 3))
    assert model.p_delta is True
    processing = Processing((None, 30.0), "linear", (5.0, 5.0), 0.1, 25.0, 3, 0.005)
    choice = RecordChoice("cm/s^2", "HNE", str(tmp_path / "station.xml"), processing)
    assert model.excitation.record == RecordSource(
        str(tmp_path.parent / "records/x.mseed"), choice, -1.5
    )
    assert model.excitation.forces == (Force(1, 5e5, 0.0, 25.0), Force(4, 0.0, -2e3, 0.5))
    assert model.initial.displacement == pytest.approx((0.001, 0.0, 0.0, -0.02))
    assert model.initial.velocity == pytest.approx((0.0, 0.01, 0.0, 0.0))
    assert model.analysis == Analysis("generalized-alpha:rho_inf=0.8", 0.01, 40.0)
    assert model.collapse_drift == 0.05


def test_default_values_of_model() -> None:
    model = load("stories: [{mass: 1, stiffness: 2}, {mass: 3, stiffness: 4}]")
    assert model.name == "model"
    assert model.source == "<stream>"
    assert model.stories == (
        Story(1.0, None, 2.0, Law("linear", ()), 0.0),
        Story(3.0, None, 4.0, Law("linear", ()), 0.0),
    )
    assert model.damping is None
    assert model.p_delta is False
    assert model.excitation == Excitation(None, ())
    assert model.initial == Initial((0.0, 0.0), (0.0, 0.0))
    assert model.analysis == Analysis(None, None, None)
    assert model.collapse_drift == 0.10


@pytest.mark.parametrize(
    ("units", "mass", "stiffness"),
    [
        ("{}", 1.0, 1.0),
        ("{mass: t}", 1e3, 1.0),
        ("{length: mm, force: N, mass: kg}", 1.0, 1e3),
        ("{length: m, force: MN, mass: kg}", 1.0, 1e6),
        (
            "{length: in, force: kip, mass: kip*s^2/in}",
            453.59237 * G / 0.0254,
            453.59237 * G / 0.0254,
        ),
        ("{length: ft, force: lbf, mass: lb}", 0.45359237, 0.45359237 * G / 0.3048),
    ],
)
def test_units_of_mass_and_stiffness(units: str, mass: float, stiffness: float) -> None:
    (story,) = one_story(f"units: {units}").stories
    assert story.mass == pytest.approx(mass, rel=1e-14)
    assert story.stiffness == pytest.approx(stiffness, rel=1e-14)


@pytest.mark.parametrize(
    ("damping", "expected"),
    [
        ("none", None),
        ("{rayleigh: {ratio: 0.05, modes: [3, 1]}}", RayleighRatio((0.05, 0.05), (3, 1))),
        ("{rayleigh: {ratio: [0, 0.05], modes: [1, 2]}}", RayleighRatio((0.0, 0.05), (1, 2))),
        ("{rayleigh: {mass: 0, stiffness: 1e-3}}", RayleighCoefficients(0.0, 1e-3)),
        ("{modal: 0.05}", ModalDamping((0.05,))),
        ("{modal: [0.05, 0.04, 0.03]}", ModalDamping((0.05, 0.04, 0.03))),
        ("{modal: {ratio: 0.05, modes: 3}}", ModalDamping((0.05, 0.05, 0.05))),
        ("{modal: {ratio: 0.05, modes: 2}}", ModalDamping((0.05, 0.05, 0.0))),
        ("{modal: {ratio: 0.05, modes: 1}}", ModalDamping((0.05, 0.0))),
    ],
)
def test_damping_models(damping: str, expected: object) -> None:
    assert (
        load(f"stories: [{{repeat: 3, mass: 1, stiffness: 1}}]\ndamping: {damping}").damping
        == expected
    )


def test_damping_models_of_one_story() -> None:
    assert one_story("damping: {modal: {ratio: 0.05, modes: 1}}").damping == ModalDamping((0.05,))
    assert one_story(
        "damping: {rayleigh: {mass: 1, stiffness: 0}}"
    ).damping == RayleighCoefficients(1.0, 0.0)


@pytest.mark.parametrize(
    ("phase", "shift"), [("cos", 0.0), ("sin", -math.pi / 2), ("0.7", 0.7), ("-2e0", -2.0)]
)
def test_phase_of_harmonic_force(phase: str, shift: float) -> None:
    text = f"excitation: {{forces: [{{floor: 1, amplitude: 3, omega: 2, phase: {phase}}}]}}"
    (force,) = one_story(text).excitation.forces
    for t in (0.0, 0.3, 1.7):
        value = force.cosine * math.cos(force.omega * t) + force.sine * math.sin(force.omega * t)
        assert value == pytest.approx(3 * math.cos(2 * t + shift), abs=1e-14)


def test_stiffness_may_repeat_stiffness_of_law() -> None:
    law = "law: {type: polynomial, coefficients: [0.3, 1]}"
    assert one_story(story=f"mass: 1, {law}").stories[0].stiffness == 0.3
    assert one_story(story=f"mass: 1, stiffness: 0.30000000001, {law}").stories[0].stiffness == 0.3


@pytest.mark.parametrize(
    ("record", "file"),
    [
        ("x.mseed", "folder/x.mseed"),
        ("/data/x.mseed", "/data/x.mseed"),
        ("{file: '-'}", "-"),
        ("'-'", "-"),
    ],
)
def test_record_path_is_relative_to_model_file(
    record: str, file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    Path("folder/model.yaml").write_text(
        f"stories: [{{mass: 1, stiffness: 1}}]\nexcitation: {{record: {record}}}"
    )
    expected = RecordSource(file)
    assert load_model("folder/model.yaml").excitation.record == expected
    with Path("folder/model.yaml").open() as stream:
        model = load_model(stream)
    assert model.excitation.record == expected
    assert model.source == "folder/model.yaml"
    assert model.name == "model"


def test_yaml_aliases() -> None:
    model = load(
        "stories:\n"
        "  - &typical {mass: &m 2, stiffness: 5, law: &law {type: bilinear, yield_force: 1, "
        "hardening: 0}}\n"
        "  - *typical\n"
        "  - {mass: *m, stiffness: 7, law: *law}\n"
    )
    first, second, third = model.stories
    assert first == second
    assert third == Story(2.0, None, 7.0, Law("bilinear", (1.0, 0.0)), 0.0)


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_bytes_and_byte_order_mark(newline: str, tmp_path: Path) -> None:
    data = (
        b"\xef\xbb\xbf"
        + f"name: Büro{newline}stories: [{{mass: 1, stiffness: 1}}]{newline}".encode()
    )
    (tmp_path / "m.yaml").write_bytes(data)
    model = load_model(tmp_path / "m.yaml")
    assert model.name == "Büro"
    assert model.text == data


def test_model_is_read_from_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    data = b"stories: [{mass: 1, stiffness: 1}]\nexcitation: {record: r.mseed}\n"
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data), encoding="ascii"))
    model = load_model("-")
    assert (model.source, model.name, model.text) == ("-", "model", data)
    assert model.excitation.record == RecordSource("r.mseed")


def test_power_law_dashpot_in_other_units(tmp_path: Path) -> None:
    """100 kN at 1 cm/s with exponent 0.5 are 1e5 N (100 s/m)^0.5 = 1e6 N (s/m)^0.5."""
    file = tmp_path / "model.yaml"
    file.write_text(
        "units: {length: cm, force: kN, mass: kg}\n"
        "stories: [{mass: 1, stiffness: 10, dashpot: {coefficient: 100, exponent: 0.5, "
        "linear_below: 0.2}},\n"
        "          {mass: 1, stiffness: 10, dashpot: {coefficient: 3, exponent: 1}}]\n"
        "initial: {displacement: [1, 1]}\n"
    )
    first, second = load_model(file).stories
    assert first.dashpot == 0.0
    assert first.power_dashpot == PowerDashpot(pytest.approx(1e6), 0.5, pytest.approx(0.002))
    assert second.power_dashpot == PowerDashpot(pytest.approx(3e5), 1.0, 0.0)


def test_reading_config_imports_no_large_package() -> None:
    heavy = "{'numpy', 'numba', 'scipy', 'obspy', 'click', 'matplotlib'}"
    code = f"import sys, tdint.model.config.model_file; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
