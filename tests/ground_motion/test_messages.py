"""Import of ObsPy."""

import importlib.metadata
import sys

import pytest

from tdint.ground_motion.messages import _postponed_import, quiet_import


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


def test_a_postponed_module_is_imported_when_it_is_first_used(monkeypatch):
    monkeypatch.delitem(sys.modules, "colorsys", raising=False)
    with _postponed_import("colorsys"):
        import colorsys
    assert "colorsys" not in sys.modules
    assert colorsys.rgb_to_hsv(0.0, 0.0, 0.0) == (0.0, 0.0, 0.0) and "colorsys" in sys.modules
    monkeypatch.delitem(sys.modules, "colorsys")
    with _postponed_import("colorsys"):
        from colorsys import ONE_SIXTH
    assert ONE_SIXTH == 1.0 / 6.0
