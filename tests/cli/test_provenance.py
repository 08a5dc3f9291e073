"""Options and versions of the sources in JSON summaries; test_files.py tests that each output has a
summary."""

import hashlib
from pathlib import Path

import pytest

import tdint
from tdint.system import __version__, version_of_sources


def test_a_changed_checkout_is_not_reported_as_a_release(tmp_path, monkeypatch):
    """A package with an edited file also has a version with a hash. The hash depends only on the
    sources, not on their directory."""
    own = Path(tdint.__file__).parent
    system, digest = version_of_sources()
    assert system in (__version__, f"{__version__}+sources.{digest[:8]}")
    names = sorted(file.relative_to(own).as_posix() for file in own.rglob("*.py"))
    lines = "".join(
        f"{name} {hashlib.sha256((own / name).read_bytes()).hexdigest()}\n" for name in names
    )
    assert digest == hashlib.sha256(lines.encode()).hexdigest()[:16]
    _packed(tmp_path, monkeypatch)
    assert version_of_sources.__wrapped__()[0] == __version__
    (tmp_path / "tdint" / "terminal.py").write_text("changed = True\n")
    changed, other = version_of_sources.__wrapped__()
    assert changed == f"{__version__}+sources.{other[:8]}" and other != digest


def _packed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Create an installed package tdint with two files and the RECORD of its installation."""
    from base64 import urlsafe_b64encode
    from importlib.metadata import Distribution

    from tdint import system

    about = folder / "tdint-0.dist-info"
    (folder / "tdint").mkdir()
    about.mkdir()
    record = ""
    for name in ("system.py", "terminal.py"):
        content = f"name = {name!r}\n".encode()
        (folder / "tdint" / name).write_bytes(content)
        digest = urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record += f"tdint/{name},sha256={digest},{len(content)}\n"
    (about / "RECORD").write_text(record)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: tdint\nVersion: 0\n")
    monkeypatch.setattr(system, "__file__", str(folder / "tdint" / "system.py"))
    monkeypatch.setattr("importlib.metadata.distribution", lambda _: Distribution.at(about))
