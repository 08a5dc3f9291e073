"""Model files with two directions: common values, values of a direction, and refusals."""

import pytest

import tdint
from tdint import load_model
from tdint.errors import ModelError
from tdint.model.config.model_file import model_schema

STORY = {"mass": 1e5, "height": 3.0, "x": {"stiffness": 4e7}, "y": {"stiffness": 2e7}}


def _faults(content):
    with pytest.raises(ModelError) as caught:
        load_model(content)
    return str(caught.value)


def test_values_of_directions_and_common_values():
    model = load_model(
        {
            "units": {"length": "m", "force": "kN", "mass": "t"},
            "stories": [
                {
                    "mass": 100,
                    "height": 3,
                    "repeat": 2,
                    "x": {"stiffness": 4e4},
                    "y": {"stiffness": 2e4},
                },
                {"mass": 80, "stiffness": 3e4},
            ],
            "damping": "5%",
            "y": {
                "p_delta": False,
                "links": [{"name": "brace", "from": "ground", "to": 1, "dashpot": 10}],
            },
            "x": {"p_delta": False},
            "excitation": {"x": {"record": "a.AT2"}, "y": {"record": "b.AT2"}},
        }
    )
    x, y = model.directions
    assert [story.stiffness for story in x.stories] == [4e7, 4e7, 3e7]
    assert [story.stiffness for story in y.stories] == [2e7, 2e7, 3e7]
    assert [story.mass for story in x.stories] == [story.mass for story in y.stories]
    assert (x.links, [link.name for link in y.links]) == ((), ["brace"])
    assert (x.excitation.record.file, y.excitation.record.file) == ("a.AT2", "b.AT2")
    assert x.across is None and y.across is None
    assert load_model(model.to_dict()).directions[1].stories == y.stories


def test_the_azimuth_alone_makes_two_equal_directions():
    story = {"mass": 1e5, "stiffness": 4e7}
    record = {"record": "both.mseed", "azimuth": 30}
    model = load_model({"stories": [story], "excitation": record})
    assert model.axis_azimuth == 30.0
    # The recording has both components and is read one time.
    assert model.across.excitation.record is None
    assert model.across.stories == model.stories
    assert load_model({"stories": [story]}).across is None


def test_an_error_in_a_common_value_is_reported_one_time():
    assert _faults({"stories": [{**STORY, "mass": -1}]}).count("mass") == 1


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"stories": [STORY], "torsion": 1}, "without torsion"),
        ({"stories": [{**STORY, "eccentricity": 1}]}, "without torsion"),
        (
            {"stories": [{**STORY, "y": {"stiffness": 2e7, "law": {"type": "biaxial"}}}]},
            "a law cannot depend on both drifts.*sqrt 2",
        ),
        (
            {
                "stories": [STORY],
                "links": [{"name": "a", "from": 1, "to": 2, "dashpot": 1, "direction": "xy"}],
            },
            "acts in one direction; give its component in the mappings `x` and `y`",
        ),
        (
            {
                "stories": [
                    {
                        **STORY,
                        "isolator": True,
                        "stiffness": 1e8,
                        "law": {"type": "bilinear", "yield_force": 1e4, "hardening": "1%"},
                        "x": {},
                        "y": {},
                    }
                ]
            },
            "biaxial: two separate springs overestimate its strength by up to sqrt 2",
        ),
        ({"stories": [{"mass": 1e5, "x": {"stiffness": 4e7}}]}, "`x` is given, but not `y`"),
        ({"stories": [{**STORY, "stiffness": 3}]}, "stiffness: given for both directions"),
        ({"stories": [{**STORY, "x": {"stiffness": 1, "mass": 3}}]}, r"x\.mass: not a key of one"),
        ({"stories": [{**STORY, "x": 3}]}, r"x: must be a mapping with the keys stiffness"),
        ({"stories": [STORY], "x": {"analysis": {}}, "y": {}}, r"x\.analysis: not a key of one"),
        ({"stories": [STORY], "building": {}}, "cannot be used with two directions"),
        (
            {"stories": [STORY], "excitation": {"x": {}, "y": {"record": "a"}}},
            "the ground motion is missing",
        ),
        (
            {
                "stories": [STORY],
                "excitation": {"azimuth": 3, "x": {"record": "a"}, "y": {"record": "b"}},
            },
            "act along the axes",
        ),
    ],
)
def test_what_two_directions_refuse(content, message):
    with pytest.raises(ModelError, match=message):
        load_model(content)


def test_the_schema_has_the_directions():
    schema = model_schema()["properties"]
    story = schema["stories"]["items"]["properties"]
    assert set(story["x"]["properties"]) > {"stiffness", "law", "dashpot", "elements"}
    assert "mass" not in story["y"]["properties"]
    assert set(schema["excitation"]["properties"]["y"]["properties"]) > {"record", "forces"}
    assert "damping" in schema["x"]["properties"]


def test_base_of_each_direction():
    """Each direction rocks on its own spring, as the model with this direction alone."""
    stories = [{"mass": 2.0, "height": 3.0, "x": {"stiffness": 90.0}, "y": {"stiffness": 60.0}}]
    both = tdint.load_model(
        {
            "stories": stories,
            **{
                name: {"base": {"rotation": spring}}
                for name, spring in (("x", 700.0), ("y", 500.0))
            },
        }
    )
    for model, stiffness, spring in zip(both.directions, (90.0, 60.0), (700.0, 500.0), strict=True):
        flexibility = 1.0 / stiffness + 3.0**2 / spring
        assert tdint.matrices(model).stiffness[0, 0] == pytest.approx(1.0 / flexibility, rel=1e-12)
