"""Each command has a function in Python that returns the printed table. Results have a short text
and can be pickled."""

import csv
import io
import pickle
import pydoc
import subprocess
import sys
from operator import attrgetter

import numpy as np
import pytest

import tdint as package
from csv_rows import rows
from selection import every
from tdint.errors import ModelError, RecordError, UsageError
from tdint.output.tables.table import cell_text
from tdint_cli.main import COMMANDS

STRIPES = "im,collapses,records\n1,1,20\n2,8,20\n3,18,20\n"
BUILDINGS = (
    "id,numberofstories,yearbuilt,structuretype,planarea\na,4,1985,C1,600\nb,2,1990,W1,120\n"
)
CAMPAIGN = """\
buildings: {models: [shaken.yaml]}
records: {files: [motion.mseed], units: m/s^2}
intensity: {scales: [0.5, 1.0]}
analysis: {method: newmark-average}
"""
RECORD = ("motion.mseed", "--component", "HNE", "--units", "m/s^2")


@pytest.fixture
def study(folder):
    """Directory with tables and a campaign in addition to models and records."""
    for name, text in (
        ("stripes.csv", STRIPES),
        ("buildings.csv", BUILDINGS),
        ("campaign.yaml", CAMPAIGN),
    ):
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def motion(**options):
    return package.read_record("motion.mseed", component="HNE", units="m/s^2", **options)


def check_columns(result, printed):
    """Check that columns equal the columns of a CSV text, within its digits."""
    header, *lines = csv.reader(io.StringIO(printed))
    assert list(result) == header
    for name, cells in zip(header, zip(*lines, strict=True), strict=True):
        values = result[name]
        if isinstance(values, list):
            assert [cell_text(value) for value in values] == list(cells), name
        else:
            expected = [float(cell) if cell else np.nan for cell in cells]
            np.testing.assert_allclose(
                np.asarray(values, float), expected, rtol=1e-11, atol=1e-300, err_msg=name
            )


CASES = {
    "campaign": (
        ("campaign", "campaign.yaml", "-o", "out"),
        lambda: package.campaign("campaign.yaml", jobs=1),
    ),
    "check": (("check", "shaken.yaml"), lambda: package.check("shaken.yaml")),
    "drift-spectrum": (
        ("drift-spectrum", *RECORD, "--periods", "0.2:10:20"),
        lambda: package.drift_spectrum(motion(), np.geomspace(0.2, 10.0, 20)),
    ),
    "failures": (
        ("failures", "--method", "impulse4,newmark-average", "--problem", "large-step"),
        lambda: package.failures(["impulse4", "newmark-average"], ["large-step"]),
    ),
    "fragility": (("fragility", "stripes.csv"), lambda: package.fragility("stripes.csv")),
    "fourier": (("spectrum", *RECORD, "--fourier"), lambda: package.fourier_spectrum(motion())),
    "info": (("info", *RECORD), lambda: package.record_info(motion())),
    "inventory": (
        ("inventory", "buildings.csv", "--units", "m"),
        lambda: package.inventory("buildings.csv", units="m"),
    ),
    "methods": (("methods",), lambda: package.methods()),
    "modes": (("modes", "shaken.yaml"), lambda: package.modes(package.load_model("shaken.yaml"))),
    "modes --target": (
        ("modes", "shaken.yaml", "--target", "asce7:sds=0.4,sd1=0.3,tl=8"),
        lambda: package.response_spectrum_analysis("shaken.yaml", "asce7:sds=0.4,sd1=0.3,tl=8"),
    ),
    "modes --transfer": (
        ("modes", "shaken.yaml", "--transfer"),
        lambda: package.transfer_function("shaken.yaml"),
    ),
    "order": (
        ("order", "--method", "hht", "--frequency-ratio", "0.5"),
        lambda: package.order("hht", frequency_ratio=0.5),
    ),
    "overshoot": (
        ("overshoot", "--method", "wilson", "--steps", "3"),
        lambda: [
            package.overshoot("wilson", start, steps=3) for start in ("displacement", "velocity")
        ],
    ),
    "pushover": (
        ("pushover", "shaken.yaml", "--drift", "2%"),
        lambda: package.pushover("shaken.yaml", "2%"),
    ),
    "pushover --target": (
        ("pushover", "shaken.yaml", "--drift", "4%", "--target", "ec8:type=1,soil=C,ag=0.05g"),
        lambda: package.target_displacements(
            package.pushover("shaken.yaml", "4%"), "ec8:type=1,soil=C,ag=0.05g"
        ),
    ),
    "scale": (
        ("scale", *RECORD, "--to", "sa=2m/s^2", "--at", "0.5"),
        lambda: package.scale([motion()], "sa(0.5)", 2.0),
    ),
    "sensitivity": (
        ("sensitivity", "shaken.yaml", *RECORD, "--vary", "damping=2%:5%,mass_factor=0.9:1.1"),
        lambda: package.sensitivity(
            "shaken.yaml", motion(), {"damping": (0.02, 0.05), "mass_factor": (0.9, 1.1)}
        ),
    ),
    "spectrum": (
        ("spectrum", *RECORD, "--period", "0.2,1"),
        lambda: package.spectrum(motion(), [0.2, 1.0]),
    ),
    "spectrum --ductility": (
        ("spectrum", *RECORD, "--period", "0.2,1", "--ductility", "3", "--hardening", "0.1"),
        lambda: package.constant_ductility(motion(), [0.2, 1.0], [3.0], hardening=0.1),
    ),
    "spectrum --rotd": (
        ("spectrum", "motion.mseed", "--units", "m/s^2", "--rotd", "0,50,100", "--period", "0.2,1"),
        lambda: package.rotated_spectrum(
            package.read_horizontals("motion.mseed", units="m/s^2"),
            [0.2, 1.0],
            percentiles=[0, 50, 100],
        ),
    ),
    "stability": (
        (
            "stability", "--method", "newmark-average", "--damping", "0,0.05",
            "--dt-over-t", "0.1:10:3",
        ),
        lambda: [
            package.stability("newmark-average", np.geomspace(0.1, 10.0, 3), damping=xi)
            for xi in (0.0, 0.05)
        ],
    ),
    "validate": (("validate",), package.validate),
}  # fmt: skip


@pytest.mark.parametrize(
    "name",
    every(
        2,
        [
            pytest.param(name, marks=[pytest.mark.long] * name.startswith("pushover"))
            for name in CASES
        ],
    ),
)
def test_functions_return_the_printed_tables(name, study, tdint):
    arguments, call = CASES[name]
    printed = tdint(*arguments, code=0)
    text = (
        (study / "out" / "runs.csv").read_text(encoding="utf-8")
        if name == "campaign"
        else printed.stdout
    )
    result = call()
    check_columns(package.to_dict(result), text)
    again = pickle.loads(pickle.dumps(result))
    assert repr(again) == repr(result) and len(repr(result)) < 250
    check_columns(package.to_dict(again), text)


@pytest.mark.parametrize(
    ("name", "pairs"),
    every(
        3,
        [
            ("spectrum", "period_s=periods sd_m=sd psv_m_s=psv psa_m_s2=psa sv_m_s=sv sa_m_s2=sa"),
            (
                "spectrum --ductility",
                "yield_sd_m=yield_displacement yield_psa_m_s2=yield_acceleration "
                "residual_m=residual",
            ),
            (
                "spectrum --ductility",
                "yield_strength_ratio=yield_strength_ratio reduction_factor=reduction_factor",
            ),
            (
                "drift-spectrum",
                "height_m=heights peak_drift_ratio=peak_drift_ratio "
                "roof_drift_ratio=roof_drift_ratio",
            ),
            ("fourier", "frequency_hz=frequencies fourier_amplitude_m_s=amplitude"),
            (
                "info",
                "pga_m_s2=record.pga pgv_m_s=measures.pgv pgd_m=measures.pgd "
                "mean_m_s2=measures.mean",
            ),
            (
                "info",
                "arias_intensity_m_s=measures.arias cav_m_s=measures.cav d5_75_s=measures.d5_75",
            ),
            ("modes --target", "shear_cqc_N=shear_cqc"),
            ("pushover --target", "drift_m=drift"),
        ],
    ),
)
def test_columns_equal_the_attributes_of_the_result(name, pairs, study):
    result = CASES[name][1]()
    first = result[0] if hasattr(result, "__getitem__") else result
    for column, attribute in (pair.split("=") for pair in pairs.split()):
        values = np.atleast_1d(attrgetter(attribute)(first))
        np.testing.assert_array_equal(package.to_dict(result)[column][: values.size], values)


def test_the_examples_and_the_chart(study, tdint):
    """The ranks of the examples need all methods of a call, and times of the chart are not
    compared."""
    examples = package.to_dict(package.paper_examples([1], ["newmark-linear", "wilson"]))
    check_columns(examples, tdint("examples", "1", "--method", "newmark-linear,wilson").stdout)
    methods = ["impulse4", "newmark-average"]
    chart = package.chart("shaken.yaml", motion(), method=methods, dt=[0.01], repeats=1).to_dict()
    options = ("--method", ",".join(methods), "--dt", "0.01", "--repeat", "1")
    table = rows(tdint("chart", "shaken.yaml", "--record", *RECORD, *options).stdout)
    assert [row["method"] for row in table] == chart["method"]
    np.testing.assert_allclose(
        [float(row["drift_error"]) for row in table], chart["drift_error"], rtol=1e-11
    )


def test_a_model_template_and_its_compiled_kernels():
    model = package.load_model(io.StringIO(package.model_template(3, period=0.4)))
    assert 2.0 * np.pi / package.modes(model).omega[0] == pytest.approx(0.4, rel=1e-8)
    package.compile_model(model)
    assert package.compile_model(model) == []  # All kernels of the model are compiled now.


def test_every_command_has_a_function_and_help_lists_them():
    function_names = {
        "compile": "compile_model",
        "examples": "paper_examples",
        "info": "record_info",
        "init": "model_template",
    }
    function_names |= {"law": "cyclic_test"}  # `law` would not describe the function.
    names = {function_names.get(command, command.replace("-", "_")) for command in COMMANDS}
    assert names <= set(package.__all__)
    for name in names | {"plot", "run_many", "to_dict"}:
        assert callable(getattr(package, name)), name
    text = pydoc.plain(pydoc.render_doc(package))
    assert [name for name in names if name not in text] == []
    import tdint.methods.bathe  # noqa: F401  # a package that is loaded is still the function

    assert len(package.methods("bathe")) == 1
    with pytest.raises(ModelError, match="nowhere"):
        package.campaign("nowhere.yaml")


@pytest.mark.long
def test_importing_loads_no_heavy_package():
    """A function imports only its requirements: `run` imports neither matplotlib nor click."""
    code = (
        "import sys, tdint\nloaded = lambda: [m for m in ('numpy', 'matplotlib', 'click') if m in "
        "sys.modules]\n"
        "print(loaded()); tdint.run; print(loaded())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["[]", "['numpy']"]


def test_an_interrupted_campaign_continues(study):
    interrupted = package.campaign("campaign.yaml", "kept", max_runs=1, jobs=1)
    continued = package.campaign("campaign.yaml", "kept", jobs=2)
    assert (
        sum(interrupted.statuses.values())
        <= sum(continued.statuses.values())
        == continued.asked
        == 4
    )
    uninterrupted = package.campaign("campaign.yaml").to_dict()
    np.testing.assert_array_equal(
        continued.to_dict()["peak_drift_m"], uninterrupted["peak_drift_m"]
    )


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: package.order("hth"), UsageError, "hth"),
        (lambda: package.order("hht", load="wind"), UsageError, "wind"),
        (
            lambda: package.overshoot("hht", "rest"),
            UsageError,
            "start must be one of the initial states displacement, velocity",
        ),
        (lambda: package.failures(problems=["hardning"]), UsageError, "hardening"),
        (lambda: package.paper_examples([4]), UsageError, "example 4 not found"),
        (lambda: package.scale([motion()]), UsageError, "scale requires an intensity measure"),
        (
            lambda: package.scale([motion()], "sa", 1.0),
            UsageError,
            "unknown intensity measure 'sa'",
        ),
        (
            lambda: package.scale([motion()], target="asce7:sds=1,sd1=0.6,tl=8", rule="best"),
            UsageError,
            "unknown rule",
        ),
        (lambda: package.scale([3.0], "pga", 1.0), RecordError, "a record must be"),
        (lambda: package.record_info("nowhere.mseed"), RecordError, "nowhere.mseed"),
        (lambda: package.inventory("buildings.csv", units="mile"), UsageError, "mile"),
        (lambda: package.fragility("buildings.csv"), ModelError, "columns"),
        (
            lambda: package.sensitivity("shaken.yaml", motion(), {"colour": (1.0, 2.0)}),
            UsageError,
            "colour",
        ),
        (lambda: package.model_template(0), UsageError, "the number of stories must be at least 1"),
        (lambda: package.to_dict([]), UsageError, "the list is empty"),
        (lambda: package.to_dict([motion(), package.methods()]), UsageError, "different columns"),
    ],
)
def test_invalid_arguments_are_refused_in_one_line(call, error, message, study):
    with pytest.raises(error, match=message) as caught:
        call()
    assert len(str(caught.value).splitlines()) == 1


def test_internal_errors_of_a_command_test_show_their_traceback(tdint, folder, monkeypatch):
    """The helper `tdint` of command tests raises the error, unless a test requires its code."""

    def faulty(*arguments, **options):
        raise AttributeError("a bug of this test")

    monkeypatch.setattr("tdint.model.building.Building.modes", faulty)
    with pytest.raises(AssertionError, match="internal error") as failure:
        tdint("modes shaken.yaml")
    assert failure.value.__cause__.__traceback__.tb_next is not None
    assert "internal error" in tdint("modes shaken.yaml", code=1).stderr
