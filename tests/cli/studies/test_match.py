"""`tdint match`: effects of its options."""

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import tdint as tdint_api
from cli.test_report import page
from csv_rows import rows
from tdint.ground_motion.origin import MotionOrigin, matched_clause
from tdint.output.spectrum_text import spectrum_text

CALL = ("match", "motion.mseed", "--component", "HNE", "--units", "m/s^2", "-o", "m")
TARGET = ("--target", "ec8:type=1,soil=B,ag=0.2g")


@pytest.mark.usefixtures("folder", "short_matching")
def test_the_maximum_misfit(tdint):
    """A misfit is reported above --max-misfit, and is an error with --require."""
    tdint(*CALL, *TARGET, code=0)
    (row,) = rows("m/matched.csv")
    misfit = float(row["largest_misfit"])
    for limit, code in ((1.01 * misfit, 0), (0.99 * misfit, 5)):
        shutil.rmtree("m")
        result = tdint(*CALL, *TARGET, "--require", "--max-misfit", limit, code=code)
        assert (code == 5) == ("--max-misfit" in result.stderr)


@pytest.mark.usefixtures("folder", "short_matching")
def test_the_range_of_periods(tdint):
    """The misfit is that of the spectrum within --range."""
    Path("flat.csv").write_text("period_s,sa_g\n0.05,0.3\n4,0.3\n")
    found = []
    for periods in ("0.2:0.6", "0.6:1.8"):
        tdint(*CALL, "--target", "flat.csv", "--range", periods, "--overwrite", code=0)
        (row,) = rows("m/matched.csv")
        (motion,) = json.loads(Path("m/matched.json").read_text())["motions"]
        low, high = map(float, periods.split(":"))
        grid = ",".join(f"{period:.6g}" for period in np.geomspace(1.001 * low, 0.999 * high, 40))
        spectrum = rows(tdint("spectrum", f"m/{motion}", "--period", grid, code=0).stdout)
        misfit = max(abs(float(line["psa_m_s2"]) / (0.3 * 9.80665) - 1.0) for line in spectrum)
        assert 0.5 * float(row["largest_misfit"]) < misfit <= 1.001 * float(row["largest_misfit"])
        found.append(row["factor"])
    assert found[0] != found[1]


MODEL = """\
name: one
stories: [{mass: 100, height: 3, stiffness: 4.0e3}]
damping: 5%
analysis: {method: newmark-average}
"""


@pytest.mark.usefixtures("folder", "short_matching")
@pytest.mark.long
def test_a_matched_motion_keeps_its_origin_in_every_result(tdint):
    """Seed, target, factor, change and misfit of the table of the match are in summary.json of a
    run and of a suite, in reports, verdicts and notes."""
    Path("one.yaml").write_text(MODEL)
    tdint(*CALL, *TARGET, code=0)
    (row,) = rows("m/matched.csv")
    (entry,) = json.loads(Path("m/matched.json").read_text())["written_motions"]
    file = Path("m") / entry["file"]
    assert entry["sha256"] == hashlib.sha256(file.read_bytes()).hexdigest()
    for motion, out in ((str(file), "single"), ("m", "suite")):
        call = ("run", "one.yaml", motion, "--limit", "2%", "--report", "p.html", "-o", out)
        result = tdint(*call, code=0)
        content = json.loads(Path(out, "summary.json").read_text())
        origin = (content["record"] if out == "single" else content["records"][0])["origin"]
        assert origin == entry["origin"]
        assert (origin["seed"], origin["seed_component"]) == ("motion.mseed", "HNE")
        assert origin["target"] == TARGET[1]
        assert origin["change"] == pytest.approx(float(row["change"]), rel=1e-9)
        assert origin["largest_misfit"] == pytest.approx(float(row["largest_misfit"]), rel=1e-9)
        assert "m/matched.json" in [item["file"] for item in content["inputs"]]
        factor = f"(seed factor {origin['factor']:.3g})"
        verdict = f"1 ground motion, matched to {spectrum_text(TARGET[1])} {factor}."
        assert verdict in result.stderr
        text = page("p.html").text
        assert (
            verdict in text
            and f"The ground motions are matched to {spectrum_text(TARGET[1])}" in text
        )
        assert "motion.mseed HNE" in text
        if out == "single":
            assert f"note: matched to {TARGET[1]}: seed motion.mseed HNE times" in result.stderr
        Path("p.html").unlink()


@pytest.mark.usefixtures("folder", "short_matching")
@pytest.mark.long
def test_an_edited_motion_has_no_origin(tdint):
    """The origin belongs to the samples of the file; a moved CSV file has it in its header."""
    tdint(*CALL, *TARGET, "--format", "csv", code=0)
    file = next(path for path in Path("m").glob("*.csv") if path.name != "matched.csv")
    record = tdint_api.read_record(str(file), units="m/s^2")
    assert record.origin.target == TARGET[1] and record.processing == record.origin.processing
    Path("moved.csv").write_bytes(file.read_bytes())
    assert tdint_api.read_record("moved.csv").origin == record.origin
    # Another line end changes the SHA-256 of the file, but not the samples.
    file.write_text(file.read_text() + "\n")
    assert tdint_api.read_record(str(file)).origin == record.origin
    lines = file.read_text().splitlines()
    time, value, *others = lines[100].split(",")
    lines[100] = ",".join((time, f"{2.0 * float(value):.12g}", *others))
    for path in (file, Path("moved.csv")):
        path.write_text("\n".join(lines))
        assert tdint_api.read_record(str(path)).origin is None
    # A JSON file of another program is ignored.
    for text in ("[]", "{", '{"written_motions": [{"sha256": 1}]}', "\0"):
        Path("moved.json").write_text(text)
        assert tdint_api.read_record("moved.csv", units="m/s^2").origin is None


@pytest.mark.usefixtures("folder", "short_matching")
@pytest.mark.long
@pytest.mark.parametrize("suffix", ["at2", "csv"])
def test_a_file_without_its_json_file_declares_its_origin(suffix, tdint):
    """The header states what matched.json states; verdict, notes and summary repeat it."""
    Path("one.yaml").write_text(MODEL)
    tdint(*CALL, *TARGET, "--format", suffix, code=0)
    (entry,) = json.loads(Path("m/matched.json").read_text())["written_motions"]
    alone = Path("alone") / entry["file"]
    alone.parent.mkdir()
    alone.write_bytes((Path("m") / entry["file"]).read_bytes())
    assert entry["sha256"] == hashlib.sha256(alone.read_bytes()).hexdigest()
    result = tdint("run", "one.yaml", str(alone), "--limit", "2%", "-o", "out", code=0)
    content = json.loads(Path("out/summary.json").read_text())
    assert content["record"]["origin"] == entry["origin"]
    assert not any(item["file"].endswith("matched.json") for item in content["inputs"])
    factor = f"(seed factor {entry['origin']['factor']:.3g})"
    assert f"1 ground motion, matched to {spectrum_text(TARGET[1])} {factor}." in result.stderr
    assert f"note: matched to {TARGET[1]}: seed motion.mseed HNE times" in result.stderr


def test_suites_state_the_share_of_matched_components():
    """A suite of which one component is matched, one processed and one recorded; two targets."""
    processed, matched, other = (
        MotionOrigin("a.txt"),
        MotionOrigin("a.txt", target="t.csv", factor=2.0),
        MotionOrigin("b.txt", target="u.csv", factor=3.0),
    )
    assert matched_clause([None, processed], 2) == ""
    assert matched_clause([matched], 1, str.upper) == "matched to T.CSV (seed factor 2)"
    assert matched_clause([matched, other], 2) == "matched to 2 targets (seed factors 2 to 3)"
    text = "partly matched to t.csv (1 of 3 components, seed factor 2)"
    assert matched_clause([matched, processed, None], 3) == text


@pytest.mark.usefixtures("folder", "short_matching")
@pytest.mark.long
def test_processing_of_an_exported_motion_is_stated_by_the_commands_that_read_it(tdint):
    """A matched motion that is processed and exported keeps its target."""
    call = ("motion.mseed", "--units", "m/s^2", "--highpass", "0.2")
    tdint("info", *call, "--export", "p.mseed", code=0)
    records = [
        tdint_api.read_record("p.mseed", component=component)
        for component in sorted({item["exported_as"] for item in exported("p.json")})
    ]
    for record in records:
        assert record.origin.target == "" and any("0.2 Hz" in step for step in record.processing)
        assert record.origin.seed == "motion.mseed"
        assert record.processing[0] in record.notes
    tdint(*CALL, *TARGET, code=0)
    tdint("info", "m", "--lowpass", "20", "--export", "q.csv", code=0)
    record = tdint_api.read_record("q.csv")
    assert record.origin.target == TARGET[1] and record.origin.seed == "motion.mseed"
    _, padding, lowpass = record.processing
    assert "padded with zeros" in padding and "20 Hz" in lowpass
    # An exported CSV file is a table without comments, which all programs read.
    assert Path("q.csv").read_text().startswith("time_s,")


def exported(file):
    return json.loads(Path(file).read_text())["records"]
