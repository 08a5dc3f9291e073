"""Text and addresses for a package index: the README, with links to files of the released version.

Without the address of a repository, images and links to files are removed.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

_CHECKOUT = re.compile(r"<!-- checkout -->.*?<!-- end: checkout -->\n", re.DOTALL)
_FIRST_RUN = """```
$ pip install tdint
$ tdint init office.yaml --stories 5 --period 0.8
$ tdint run office.yaml
```

"""
_COMMENT = re.compile(r"<!--.*?-->\n*", re.DOTALL)
_PICTURE = re.compile(r"!\[[^]]*\]\((?!https?:)[^)]*\)\n*")
_LINK = re.compile(r"\[([^]]*)\]\((?!https?:)([^)#]*)(#[^)]*)?\)")


class ReadmeHook(MetadataHookInterface):
    """Hook of hatchling that adds the README and the addresses to the metadata."""

    def update(self, metadata: dict[str, Any]) -> None:
        root = Path(self.root)
        project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
        source = (root / project["tool"]["hatch"]["version"]["path"]).read_text(encoding="utf-8")
        found = re.search(r'^__version__ = "(.+)"', source, re.MULTILINE)
        addresses = project["tool"]["tdint"]
        repository = addresses["repository"].rstrip("/")
        text = for_index(
            (root / "README.md").read_text(encoding="utf-8"), repository, found[1] if found else ""
        )
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
        metadata["urls"] = urls(repository, addresses["site"])


def urls(repository: str, site: str = "") -> dict[str, str]:
    """Return the project addresses by label; empty without a repository and a site."""
    labels = {"Documentation": f"{site.rstrip('/')}/"} if site else {}
    if not repository:
        return labels
    return labels | {
        "Homepage": repository,
        "Source": repository,
        "Issues": f"{repository}/issues",
        "Changelog": f"{repository}/blob/main/CHANGELOG.md",
    }


def for_index(text: str, repository: str = "", version: str = "") -> str:
    """Convert the README for a package index.

    Comments are removed, and the first example is replaced by an example that needs no checkout.
    Links and images refer to the files of a version in the repository. Without a repository, links
    become file names and images are removed.
    """
    text = _COMMENT.sub("", _CHECKOUT.sub(lambda _: _FIRST_RUN, text))
    if not repository:
        return _LINK.sub(_text_of_link, _PICTURE.sub("", text))

    def absolute(link: re.Match[str]) -> str:
        mark, label, file, section = link.groups()
        if not file:
            return link[0]
        return f"{mark}[{label}]({repository}/{'raw' if mark else 'blob'}/v{version}/{file}{section or ''})"  # noqa: E501

    return re.sub(f"(!?){_LINK.pattern}", absolute, text)


def _text_of_link(link: re.Match[str]) -> str:
    """Return the text of a link, with the linked file."""
    label, file, section = link.groups()
    return label if section else f"{label} (`{file}`)"
