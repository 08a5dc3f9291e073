"""Errors of models of matrices and flexural stories, one line each."""

import numpy as np
import pytest

import tdint
from tdint.errors import AnalysisError, ModelError, UsageError

TWO = [{"mass": 1, "height": 3}, {"mass": 1, "height": 3}]
GOOD = [[3.0, -1.0], [-1.0, 1.0]]
STIFF = {"flexural": {"EI": 1e9}}


def frame(matrix=GOOD, stories=TWO, **more):
    return {"stories": stories, "stiffness_matrix": matrix, **more}


def rows(mass=(1.0, 1.0), stiffness=GOOD, **more):
    return {"matrices": {"mass": list(mass), "stiffness": stiffness, **more}}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (frame([[3.0, -1.0], [-0.9, 1.0]]), r"must be symmetric; \[1, 2\] is -1, \[2, 1\] is -0.9"),
        (frame([[3.0, -1.0], [-1.0, -1.0]]), r"row 2, column 2 \(2\) is -1"),
        (frame([[1.0, -2.0], [-2.0, 1.0]]), r"must be positive definite; row 2, column 2"),
        (frame([[1.0]]), r"must have 2 rows of 2 numbers, got 1 row"),
        (frame([[1.0, 0.0], [0.0]]), r"must have 2 rows of 2 numbers, got 1 number in row 2"),
        (frame(stories=[{**TWO[0], "stiffness": 5}, TWO[1]]), r"stories\[1\].stiffness: .*replace"),
        (frame(stories=[{**TWO[0], "law": "linear"}, TWO[1]]), r"stories\[1\].law: .*linear"),
        (frame(stories=[{**TWO[0], "elements": []}, TWO[1]]), r"stories\[1\].elements"),
        (frame(stories=[{**TWO[0], "dashpot": 5}, TWO[1]]), r"stories\[1\].dashpot"),
        (frame(p_delta=True), r"P-delta of stories needs their springs"),
        (frame(attachments=[{"floor": 1, "mass": 1, "stiffness": 1}]), r"attachments: cannot be"),
        (frame(base={"rotation": 1}), r"base: needs flexural stories"),
        (
            frame(damping={"rayleigh": {"mass": 0, "stiffness": 0.1, "tangent": True}}),
            r"a linear model has no tangent",
        ),
        (rows(mass=(1.0, -2.0)), r"matrices.mass: .*row 2, column 2 \(row_2\) is -2"),
        (rows(mass=(0.0, 0.0)), r"at least one row needs a mass"),
        (rows(stiffness=[]), r"matrices.stiffness: must contain at least one row$"),
        (rows(names=["u"]), r"must have 2 names"),
        (rows(names=["u", "u"]), r"must be different names"),
        (rows(influence=[1]), r"influence must have 2 numbers"),
        (rows(influence=[0, 0]), r"influence must not be zero"),
        ({**rows(damping=[1, 1]), "damping": {"modal": 0.05}}, r"give one of the two"),
        ({**rows(), "stories": TWO}, r"stories: cannot be used with `matrices`"),
        (
            {"stories": [{**TWO[0], **STIFF}, {**TWO[1], "stiffness": 4}]},
            r"story 2 needs `flexural`",
        ),
        ({"stories": [{"mass": 1, **STIFF}]}, r"height: is missing"),
    ],
)
def test_errors(content, message):
    with pytest.raises(ModelError, match=message) as raised:
        tdint.load_model(content)
    assert "Traceback" not in str(raised.value)


def test_matrix_in_a_file(tmp_path):
    (tmp_path / "K.csv").write_text("3,-1\n-1,1\n")
    model = tmp_path / "model.yaml"
    model.write_text(
        "{stories: [{mass: 1, height: 3}, {mass: 1, height: 3}], stiffness_matrix: K.csv}"
    )
    assert tdint.load_model(model).matrices.stiffness == ((3.0, -1.0), (-1.0, 1.0))
    (tmp_path / "K.csv").write_text("3,-1\n-1,x\n")
    with pytest.raises(ModelError, match=r"K.csv:2: must contain numbers only, got 'x'"):
        tdint.load_model(model)
    (tmp_path / "K.csv").write_text("")
    model.write_text("matrices: {mass: [1], stiffness: K.csv}")
    with pytest.raises(ModelError, match=r"matrices.stiffness: must contain at least one row"):
        tdint.load_model(model)


def test_units():
    units = {"length": "mm", "force": "kN", "mass": "t"}
    model = tdint.load_model({"units": units, **rows(stiffness=[[2.0, 0.0], [0.0, 1.0]])})
    assert np.diag(model.matrices.stiffness) == pytest.approx([2e6, 1e6])
    assert model.stories[0].mass == 1000.0


def test_what_needs_springs_is_refused():
    model = tdint.load_model(frame())
    with pytest.raises(AnalysisError, match=r"impulse4 does not support models of matrices.*exact"):
        tdint.run(model, method="impulse4", dt=0.1, duration=1)
    with pytest.raises(UsageError, match="pushover needs springs of stories"):
        tdint.pushover(model, 0.01)
    with pytest.raises(UsageError, match=r"stories.mass cannot be changed"):
        model.replace(**{"stories.mass": 2.0})
    with pytest.raises(UsageError, match="the transfer function is for floors"):
        tdint.transfer_function(tdint.load_model(rows()))
