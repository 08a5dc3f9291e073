"""The README as a package index shows it: without the pictures and links that lead into the source archive."""

from __future__ import annotations

import re
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
    """Puts `for_index` of README.md into the metadata."""

    def update(self, metadata: dict[str, Any]) -> None:
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": for_index(text)}


def for_index(text: str) -> str:
    """A text without comments and pictures, its first run one that needs no checkout; a link to a file of the source
    archive becomes the file's name."""
    text = _CHECKOUT.sub(lambda _: _FIRST_RUN, text)
    return _LINK.sub(_words, _PICTURE.sub("", _COMMENT.sub("", text)))


def _words(link: re.Match[str]) -> str:
    words, file, section = link.groups()
    return words if section else f"{words} (`{file}`)"
