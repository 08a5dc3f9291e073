"""Import of ObsPy."""

import importlib.metadata
import sys

import pytest

from tdint.ground_motion.messages import import_at_first_use, quiet_import


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


def test_a_module_is_loaded_when_it_is_first_used(monkeypatch):
    monkeypatch.delitem(sys.modules, "colorsys", raising=False)
    import_at_first_use("colorsys", "sys", "no_such_module")
    import colorsys

    assert "rgb_to_hsv" not in object.__getattribute__(colorsys, "__dict__")
    assert colorsys.rgb_to_hsv(0.0, 0.0, 0.5) == (0.0, 0.0, 0.5)
    assert "no_such_module" not in sys.modules
