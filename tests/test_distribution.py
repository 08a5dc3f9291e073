"""Installed files: metadata, source archive, and the package as a command."""

import json
import re
import subprocess
import sys
import tomllib
import types
from importlib.metadata import metadata
from pathlib import Path

import pytest
import yaml

import readmes

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.mark.long
@pytest.mark.parametrize("package", ["tdint", "tdint_cli"])
def test_package_is_executed_as_command(package, tmp_path):
    """Messages and exit code equal those of `tdint`."""
    command = [sys.executable, "-m", package, "run", "none.yaml"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 3 and "none.yaml: file not found" in done.stderr


def test_description_for_index_has_only_absolute_links():
    description = metadata("tdint")["Description"] or metadata("tdint").get_payload()
    assert "tdint run" in description
    assert re.findall(r"\]\((?!https?:)[^)]*\)", description) == []
    assert "<!--" not in description


def index_readme(monkeypatch):
    """Return the module that creates the description for a package index."""
    interface = types.ModuleType("hatchling.metadata.plugin.interface")
    # base class of the builder, which tests do not require
    interface.MetadataHookInterface = object
    monkeypatch.setitem(sys.modules, interface.__name__, interface)
    for name in ("hatchling", "hatchling.metadata", "hatchling.metadata.plugin"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    return readmes.program("index_readme")


def test_first_run_for_index_needs_no_checkout(monkeypatch):
    text = index_readme(monkeypatch).for_index((ROOT / "README.md").read_text(encoding="utf-8"))
    begin = text[: text.index("\n## ")]
    assert re.findall(r"^\$ (\w+ \w+)", begin, re.MULTILINE) == [
        "pip install",
        "tdint init",
        "tdint run",
    ]
    assert "checkout" not in begin


def test_source_archive_contains_checkout():
    listing = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listing.returncode:
        pytest.skip("not a checkout")
    included = PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    top = {line.partition("/")[0] for line in listing.stdout.splitlines()}
    # files that hatchling includes itself
    assert top - set(included) <= {"pyproject.toml", ".gitignore"}


def test_metadata_files_are_consistent():
    release = readmes.program("release")
    faults = release.faults("v0.0.1", "2026-01-01")
    assert [
        fault for fault in faults if "release.py" in fault
    ] == []  # codemeta.json and the BibTeX entry are current
    assert any("0.0.1 in the tag" in fault for fault in faults)
    assert any("2026-01-01 in the tagged commit" in fault for fault in faults)
    required = {name: PROJECT["tool"]["tdint"][name] for name in ("contact", "repository")}
    empty = [name for name, value in required.items() if not value]
    assert [fault for fault in faults if fault.endswith("is empty")] == [
        f"pyproject.toml: [tool.tdint] {name} is empty" for name in empty
    ]
    recipe = (ROOT / ".github" / "conda" / "meta.yaml").read_text()
    needed = re.search(r"run: \[python >=3.11, (.*)\]", recipe)[1].replace(
        "matplotlib-base", "matplotlib"
    )
    assert needed.replace(" ", "").split(",") == PROJECT["project"]["dependencies"]
    assert f"version: {release.read()[0]['version']}\n" in recipe


def test_consistent_release_is_accepted(tmp_path, monkeypatch):
    """All files have the version and the day of the tag, and a contact is specified."""
    module = readmes.program("release")
    citation, project = module.read()
    project["tool"]["tdint"] = {"contact": "somebody", "repository": "somewhere"}
    citation |= {"version": "1.2.3", "date-released": "2026-12-31"}
    for name, text in {
        "CHANGELOG.md": "# Changelog\n\n## 1.2.3 (2026-12-31)\n",
        "README.md": module.bibtex(citation, project),
        "src/tdint/system.py": '__version__ = "1.2.3"\n',
        "codemeta.json": module.codemeta(citation, project),
        "CITATION.cff": 'license: BSD-3-Clause\nrepository-code: "somewhere"\n',
        "conda/meta.yaml": "  home: somewhere\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    for name in module.TELLING:
        (tmp_path / name).write_text(
            f"Write to <!-- contact -->{module.contact(project)}<!-- end -->."
        )
    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(module, "CODEMETA", tmp_path / "codemeta.json")
    monkeypatch.setattr(module, "README", tmp_path / "README.md")
    monkeypatch.setattr(module, "read", lambda: (citation, project))
    assert module.faults("v1.2.3", "2026-12-31") == []
    assert "  year    = {2026}," in module.bibtex(citation, project)


def test_authors_and_address_are_written_to_metadata():
    module = readmes.program("release")
    citation, project = module.read()
    person = {
        "family-names": "Beck",
        "given-names": "Ada",
        "name-particle": "van",
        "orcid": "https://orcid.org/0",
    }
    citation["authors"] = [person, {"name": "The others"}]
    project["tool"]["tdint"] = {"contact": "", "repository": "https://example.org/a/tdint"}
    assert "  author  = {van Beck, Ada and {The others}}," in module.bibtex(citation, project)
    metadata_entries = json.loads(module.codemeta(citation, project))
    assert metadata_entries["author"][0] == {
        "type": "Person",
        "id": "https://orcid.org/0",
        "givenName": "Ada",
        "familyName": "Beck",
    }
    assert metadata_entries["codeRepository"] == "https://example.org/a/tdint"
    assert module.contact(project) == "https://example.org/a/tdint/security/advisories/new"
    project["tool"]["tdint"]["contact"] = "ada@example.org"
    assert module.contact(project) == "ada@example.org"


def test_links_for_index_point_to_files_of_version(monkeypatch):
    module = index_readme(monkeypatch)
    site = "https://example.org/a/tdint"
    text = (
        "See [this](cli/README.md#run), [that](https://x.org), [here](#x) and ![a "
        "picture](configs/a.png)."
    )
    assert module.for_index(text, site, "1.2.3") == (
        f"See [this]({site}/blob/v1.2.3/cli/README.md#run), [that](https://x.org), [here](#x) and "
        f"![a picture]({site}/raw/v1.2.3/configs/a.png)."
    )
    assert module.urls("") == {} and set(module.urls(site)) == {
        "Homepage",
        "Source",
        "Issues",
        "Changelog",
    }


def test_addresses_are_written_to_citation_recipe_and_index(monkeypatch):
    module = readmes.program("release")
    address, site = "https://example.org/a/tdint", "https://pages.example.org"
    project = {"tool": {"tdint": {"contact": "", "repository": address, "site": site}}}
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    filled = module.with_addresses(citation, project)
    assert yaml.safe_load(filled)["repository-code"] == address
    assert yaml.safe_load(filled)["url"] == site
    assert module.with_addresses(filled, project) == filled
    recipe = (ROOT / ".github" / "conda" / "meta.yaml").read_text(encoding="utf-8")
    assert f"  home: {address}\n  doc_url: {site}\n" in module.with_home(recipe, project)
    assert module.with_home(module.with_home(recipe, project), project).count("  doc_url:") == 1
    empty = {"tool": {"tdint": {"contact": "", "repository": "", "site": ""}}}
    assert module.with_addresses(filled, empty) == citation
    assert "  home: OWNER\n" in module.with_home(recipe, empty)
    assert index_readme(monkeypatch).urls(address, site)["Documentation"] == f"{site}/"


def test_licenses_are_consistent():
    """The license of the program is BSD-3-Clause, and that of the recordings in records/kaikoura is
    CC BY 3.0 NZ."""
    module = readmes.program("release")
    citation, project = module.read()
    assert citation["license"] == "BSD-3-Clause"
    urls = [entry["license-url"] for entry in citation["references"]]
    assert urls == [module.DATA_LICENSE]
    stated = json.loads(module.codemeta(citation, project))["license"]
    assert stated == ["https://spdx.org/licenses/BSD-3-Clause", module.DATA_LICENSE]
    assert module.DATA_LICENSE in (ROOT / "records" / "README.md").read_text(encoding="utf-8")
    recipe = (ROOT / ".github" / "conda" / "meta.yaml").read_text(encoding="utf-8")
    assert f"  license: {PROJECT['project']['license']}\n" in recipe


def test_license_files_of_code_and_data_are_separate():
    assert PROJECT["project"]["license"] == "BSD-3-Clause AND LicenseRef-CC-BY-3.0-NZ"
    code, data = (
        (ROOT / name).read_text(encoding="utf-8") for name in PROJECT["project"]["license-files"]
    )
    assert code.startswith("BSD 3-Clause License") and code.rstrip().endswith(
        "POSSIBILITY OF SUCH DAMAGE."
    )
    assert "LicenseRef-CC-BY-3.0-NZ" in data and "GeoNet" in data


@pytest.mark.parametrize(
    "file", sorted((ROOT / ".github" / "workflows").iterdir()), ids=lambda file: file.stem
)
def test_workflows_pin_actions_and_limit_permissions(file):
    """Actions are pinned by hash, permissions are minimal, and no job runs for hours."""
    text = file.read_text(encoding="utf-8")
    flow = yaml.safe_load(text)
    assert flow["permissions"] == {"contents": "read"}
    assert "concurrency" in flow
    for job in flow["jobs"].values():
        if "uses" not in job:
            assert job["timeout-minutes"] <= 120
            assert set(job.get("permissions", {"id-token": "write"})) - {"pages"} == {"id-token"}
    used = re.findall(r"uses: (?!\$/)(\S+)", text)
    assert [action for action in used if not re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", action)] == []


def test_paper_has_required_length_sections_and_references():
    head, _, body = (
        (ROOT / ".github/paper/paper.md").read_text(encoding="utf-8").partition("\nbibliography")
    )
    assert head.startswith("---\ntitle")
    assert 750 <= len(body.split()) <= 1750
    required = (
        "Summary|Statement of need|State of the field|Software design|Research impact statement|AI "
        "usage disclosure"
    )
    assert len(re.findall(rf"\n# (?:{required})", body)) == 6
    entries = re.findall(
        r"@\w+\{(?:.|\n)*?\n\}", (ROOT / ".github/paper/paper.bib").read_text(encoding="utf-8")
    )
    assert [entry for entry in entries if "  year = {" not in entry] == []
    entries = set(
        re.findall(r"@\w+\{(\w+),", (ROOT / ".github/paper/paper.bib").read_text(encoding="utf-8"))
    )
    assert set(re.findall(r"\[@(\w+)", body)) == entries
    pictures = re.findall(r"!\[(.*?)\]\((.*?)\)", body, re.DOTALL)
    assert pictures and all(
        (ROOT / ".github/paper" / file).is_file() and "`" in text for text, file in pictures
    )
