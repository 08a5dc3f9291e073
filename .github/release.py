"""What a release goes by: python .github/release.py [TAG DATE]

Without arguments it writes what CITATION.cff says into codemeta.json and into README.md as BibTeX. With a tag and the
day of its commit (2026-12-31) it tells all that stands in the way of a release, and ends with 1 if anything does.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[1]
CODEMETA = ROOT / ".github" / "codemeta.json"
README = ROOT / "README.md"
_BIBTEX = re.compile(r"(?<=```bibtex\n).*?(?=```)", re.DOTALL)


def read() -> tuple[dict[str, Any], dict[str, Any]]:
    """CITATION.cff and pyproject.toml."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    return citation, tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def codemeta(citation: dict[str, Any], project: dict[str, Any]) -> str:
    """The metadata of the software in the words of CodeMeta 3."""
    told = project["project"]
    place = project["tool"]["tdint"]["repository"]
    found = {
        "@context": "https://w3id.org/codemeta/3.0",
        "type": "SoftwareSourceCode",
        "name": "tdint",
        "description": told["description"],
        "version": citation["version"],
        "datePublished": str(citation.get("date-released", "")),
        "author": [{"type": "Organization", "name": one["name"]} for one in citation["authors"]],
        "license": f"https://spdx.org/licenses/{citation['license']}",
        "keywords": citation["keywords"],
        "codeRepository": place,
        "developmentStatus": "active",
        "programmingLanguage": "Python",
        "runtimePlatform": f"Python {told['requires-python']}",
        "softwareRequirements": told["dependencies"],
    }
    return json.dumps({name: value for name, value in found.items() if value}, indent=2) + "\n"


def bibtex(citation: dict[str, Any], project: dict[str, Any]) -> str:
    """The entry of BibTeX for the software, as biblatex and BibTeX's newer styles know it."""
    fields = {
        "author": " and ".join(f"{{{one['name']}}}" for one in citation["authors"]),
        "title": f"{{{citation['title']}}}",
        "version": citation["version"],
        "year": str(citation.get("date-released", ""))[:4],
        "url": project["tool"]["tdint"]["repository"],
        "license": citation["license"],
    }
    lines = [f"  {name:7} = {{{value}}}," for name, value in fields.items() if value]
    return "\n".join(["@software{tdint,", *lines, "}"]) + "\n"


def faults(tag: str, day: str) -> list[str]:
    """What stands in the way of a release under a tag, of a commit of a day."""
    citation, project = read()
    version = re.search(r'__version__ = "(.+)"', (ROOT / project["tool"]["hatch"]["version"]["path"]).read_text())
    heading = re.search(r"^## (\S+) \((.+)\)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    versions = {
        "the tag": tag.removeprefix("v"),
        "src/tdint/system.py": version and version[1],
        "CITATION.cff": citation["version"],
        "CHANGELOG.md": heading and heading[1],
    }
    days = {
        "the tagged commit": day,
        "CITATION.cff (date-released)": str(citation.get("date-released")),
        "CHANGELOG.md": heading and heading[2],
    }
    found = []
    for what, said in (("version", versions), ("date", days)):
        if len(set(said.values())) > 1:
            found.append(f"one {what}, please: " + ", ".join(f"{value} in {place}" for place, value in said.items()))
    found += [
        f"pyproject.toml: [tool.tdint] {name} is empty" for name, value in project["tool"]["tdint"].items() if not value
    ]
    if CODEMETA.read_text(encoding="utf-8") != codemeta(citation, project):
        found.append(".github/codemeta.json is not what CITATION.cff says: run python .github/release.py")
    if bibtex(citation, project) not in README.read_text(encoding="utf-8"):
        found.append("README.md: the BibTeX entry is not what CITATION.cff says: run python .github/release.py")
    return found


if __name__ == "__main__":
    if sys.argv[1:]:
        found = faults(*sys.argv[1:])
        print("\n".join(found) or "ready")  # noqa: T201 (it is what the program is for)
        sys.exit(bool(found))
    CODEMETA.write_text(codemeta(*read()), encoding="utf-8")
    text = README.read_text(encoding="utf-8")
    README.write_text(_BIBTEX.sub(lambda _: bibtex(*read()), text), encoding="utf-8")
