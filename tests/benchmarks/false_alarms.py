"""Plausibility warnings of all models in files and directories: python false_alarms.py PATH...

Models are YAML files, YAML blocks and one-line models of Markdown pages, and texts in JSON files
and Python modules that contain `stories:` or `building:`. Loads and damage states, which may refer
to other files, are removed from models that cannot be read without these files.
"""

from __future__ import annotations

import ast
import io
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from tdint.errors import TdintError
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model
from tdint.model.definition import Model
from tdint.model.plausibility import plausibility_warnings

_MARKDOWN = (r"```ya?ml[^\n]*\n(.*?)```", r"`(\{?\s*stories:[^`]*)`", r"echo '(stories:.*?)'")


def _json_texts(value: Any) -> Iterator[str]:
    """Yield all texts in a JSON value."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _json_texts(item)


def texts(path: Path) -> Iterator[str]:
    """Yield the texts of a file that may be models."""
    content = path.read_text(encoding="utf-8", errors="replace")
    if path.suffix in (".yaml", ".yml"):
        yield content
    elif path.suffix == ".md":
        for pattern in _MARKDOWN:
            yield from (match[1] for match in re.finditer(pattern, content, re.DOTALL))
    elif path.suffix == ".json":
        yield from _json_texts(json.loads(content))
    elif path.suffix == ".py":
        for node in ast.walk(ast.parse(content)):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value


def model_of(text: str) -> Model | None:
    """Return the model that a text defines; None if it is not a model."""
    if "stories" not in text and "building" not in text:
        return None
    try:
        content = yaml.safe_load(text)
    except yaml.YAMLError:
        return None
    if not isinstance(content, dict) or not {"stories", "building"} & set(content):
        return None
    kept = {key: content[key] for key in content if key not in ("excitation", "damage", "analysis")}
    for source in (io.StringIO(text), kept):
        try:
            return load_model(source)
        except TdintError:
            continue
    return None


def main(roots: list[str]) -> None:
    """Print the warnings of each model, and the numbers of models and of models with warnings."""
    seen: set[str] = set()
    counts = {"models": 0, "with heights": 0, "with warnings": 0, "with heights and warnings": 0}
    for root in map(Path, roots):
        for path in sorted(root.rglob("*")) if root.is_dir() else [root]:
            if path.suffix not in (".yaml", ".yml", ".md", ".json", ".py") or not path.is_file():
                continue
            for text in texts(path):
                model = None if text in seen else model_of(text)
                if model is None:
                    continue
                seen.add(text)
                try:
                    warnings = plausibility_warnings(model, assemble(model))
                except TdintError:
                    continue
                has_heights = any(story.height for story in model.stories)
                counts["models"] += 1
                counts["with heights"] += has_heights
                counts["with warnings"] += bool(warnings)
                counts["with heights and warnings"] += has_heights and bool(warnings)
                for warning in warnings:
                    print(f"{path}: {warning}")
    print(", ".join(f"{count} {name}" for name, count in counts.items()))


if __name__ == "__main__":
    main(sys.argv[1:])
