"""Pickled methods and laws of plug-ins are used with the version of the plug-in that the process
executed when it pickled them, never with another version."""

import os
import pickle
from dataclasses import replace

import pytest

import readmes
import tdint
from registered import forget, forgotten  # noqa: F401 (forgotten is a fixture)
from tdint.errors import UsageError
from tdint.methods import catalogue
from tdint.model import plugins, story_laws
from tdint.model.story_laws import LAWS, Law

METHOD = """\
from tdint.methods.single_step import FAMILY, newmark
from tdint.plugin import Method

METHODS = (
    Method(
        name="own-newmark",
        family=FAMILY,
        coefficients=lambda: newmark(0.25, 0.5),
        rho_inf=lambda: 1.0,
        source="version 1",
    ),
)
"""


@pytest.fixture
def method_file(tmp_path):
    """Return a plug-in file with a method."""
    file = tmp_path / "own.py"
    file.write_text(METHOD)
    return file


@pytest.fixture
def law_file(tmp_path):
    """Return a plug-in file with the law of the README."""
    file = tmp_path / "hyperbolic.py"
    file.write_text(readmes.block("law-file"))
    return file


def edit(file):
    """Write another version of a plug-in, which has the same size."""
    text = file.read_text()
    before, after = ("version 1", "version 2") if "version 1" in text else ("elastic", "Elastic")
    assert before in text
    file.write_text(text.replace(before, after))


def test_method_of_loaded_other_version_is_refused(method_file):
    """The process that reads the method has executed another version of the plug-in before."""
    tdint.load_plugin(str(method_file))
    pickled = pickle.dumps(catalogue.parse("own-newmark"))
    forget()
    edit(method_file)
    tdint.load_plugin(str(method_file))
    assert catalogue.parse("own-newmark").method.source == "version 2"
    integrator = pickle.loads(pickled)
    with pytest.raises(UsageError, match=rf"requires the plug-in {method_file} .*'own-newmark' of"):
        print(integrator.method.source)


def test_law_of_loaded_other_version_is_refused(law_file):
    """The number of the law is the same in both versions."""
    tdint.load_plugin(str(law_file))
    pickled = pickle.dumps(Law("hyperbolic", (1.0,)))
    forget()
    edit(law_file)
    tdint.load_plugin(str(law_file))
    with pytest.raises(UsageError, match=rf"requires the plug-in {law_file} .*'hyperbolic' of"):
        pickle.loads(pickled)


def test_objects_of_same_version_in_other_directory_are_accepted(method_file, law_file, tmp_path):
    """Workers execute plug-ins that were sent to them from a temporary directory."""
    for file in (method_file, law_file):
        tdint.load_plugin(str(file))
    pickled = pickle.dumps((catalogue.parse("own-newmark"), Law("hyperbolic", (1.0,))))
    forget()
    (tmp_path / "other").mkdir()
    for file in (method_file, law_file):
        tdint.load_plugin(str(file.rename(tmp_path / "other" / file.name)))
    integrator, law = pickle.loads(pickled)
    assert (integrator.method.source, law) == ("version 1", Law("hyperbolic", (1.0,)))


def test_other_code_with_the_name_of_a_plugin_is_refused(method_file, law_file):
    """The reading process has registered other objects with the same names without a plug-in."""
    for file in (method_file, law_file):
        tdint.load_plugin(str(file))
    method, law = catalogue.parse("own-newmark").method, LAWS["hyperbolic"]
    pickled = pickle.dumps(catalogue.parse("own-newmark")), pickle.dumps(Law("hyperbolic", (1.0,)))
    catalogue._known()["own-newmark"] = replace(method, source="other")
    story_laws._LAWS[story_laws.CODES["hyperbolic"]] = replace(law, functions=lambda: None)
    with pytest.raises(UsageError, match=r"'own-newmark' of other code"):
        print(pickle.loads(pickled[0]).method.source)
    with pytest.raises(UsageError, match=r"'hyperbolic' of other code"):
        pickle.loads(pickled[1])


def test_file_that_was_edited_before_pickling_is_not_executed(method_file, law_file):
    """The hash in the pickled objects is the hash of the executed source."""
    for file in (method_file, law_file):
        tdint.load_plugin(str(file))
        edit(file)
    pickled = pickle.dumps(catalogue.parse("own-newmark")), pickle.dumps(Law("hyperbolic", (1.0,)))
    # This process continues to use the version that it executed.
    assert pickle.loads(pickled[0]).method.source == "version 1"
    assert pickle.loads(pickled[1]) == Law("hyperbolic", (1.0,))
    forget()
    integrator = pickle.loads(pickled[0])
    with pytest.raises(UsageError, match=f"plug-in {method_file}, which has changed"):
        print(integrator.method.source)
    with pytest.raises(UsageError, match=f"plug-in {law_file}, which has changed"):
        pickle.loads(pickled[1])


def test_file_of_same_size_and_time_is_executed(method_file):
    """Python would execute the cached bytecode of the first version, because size and time of the
    two versions are equal. Its hash would then be wrong."""
    time = method_file.stat().st_mtime
    for version in ("version 1", "version 2"):
        os.utime(method_file, (time, time))
        tdint.load_plugin(str(method_file))
        assert catalogue.parse("own-newmark").method.source == version
        forget()
        if version == "version 1":
            edit(method_file)


def test_executed_source_is_sent_to_workers(method_file):
    """The file was edited after its execution."""
    tdint.load_plugin(str(method_file))
    executed = method_file.read_bytes()
    edit(method_file)
    assert plugins.files_to_send() == (("own.py", executed),)
    assert plugins.files_received((("own.py", executed),)) == [str(method_file)]
    with pytest.raises(UsageError, match="a worker executed another version"):
        plugins.files_received((("own.py", method_file.read_bytes()),))


def test_refused_plugin_does_not_change_pickled_objects(method_file, law_file):
    """The refused plug-ins list a method and a law with names of built-in objects."""
    method_file.write_text(METHOD.replace("own-newmark", "newmark"))
    law_file.write_text(law_file.read_text().replace('"hyperbolic"', '"tanh"'))
    for file in (method_file, law_file):
        with pytest.raises(UsageError, match="already exists"):
            tdint.load_plugin(str(file))
    pickled = pickle.dumps((catalogue.parse("newmark"), Law("tanh", (1.0,))))
    assert str(method_file.parent).encode() not in pickled
    forget()
    for file in (method_file, law_file):
        file.unlink()
    integrator, law = pickle.loads(pickled)
    assert (integrator.label, law) == ("newmark", Law("tanh", (1.0,)))


def test_interrupted_plugin_is_executed_again(tmp_path):
    file = tmp_path / "own.py"
    file.write_text("raise KeyboardInterrupt\n" + METHOD)
    with pytest.raises(KeyboardInterrupt):
        tdint.load_plugin(str(file))
    file.write_text(METHOD)
    methods, _ = tdint.load_plugin(str(file))
    assert [method.name for method in methods] == ["own-newmark"]
