"""Import of ObsPy."""

import importlib.metadata

import pytest

from tdint.ground_motion.messages import quiet_import


def test_versions_during_the_import_of_obspy_are_those_of_the_packages():
    version = importlib.metadata.version
    names = ("numpy", "scipy", "matplotlib", "tdint")
    expected = {name: version(name) for name in names}
    with quiet_import():
        assert importlib.metadata.version is not version
        assert {name: importlib.metadata.version(name) for name in names} == expected
        with pytest.raises(importlib.metadata.PackageNotFoundError):
            importlib.metadata.version("no-such-package")
    assert importlib.metadata.version is version
