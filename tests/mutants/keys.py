"""Mutants of the keys of YAML files (see `inputs.py`).

The entries of a mapping are changed before their values are converted. A parameter of a law is, for
example, `law(gap).gap` in stories and in elements.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from mutants.places import Mutant, Place
from tdint.kernels.laws.law import LawParameter
from tdint.model.config.model_file import model_schema
from tdint.model.keys import fields
from tdint.model.keys.nodes import MappingNode, ScalarNode
from tdint.model.story_laws import LAWS
from tdint.studies.campaign.reader import campaign_schema

RENAMED = "renamed"
"""Attribute of the faults of a file that contains the names in places: those of mappings with a
law, and `*` for entries with any name."""


class FileKeys:
    """Patch of `fields.Section`; see `inputs.Inputs`."""

    def __init__(self) -> None:
        self.specified: set[Place] = set()
        self.mutant: Mutant | None = None
        self._receivers: dict[Place, str] = {}
        self._needed: set[Place] = set()
        self._mutated: list[MappingNode] = []  # a mapping that is read twice is changed once
        self._unchanged = fields.Section.__init__
        fields.Section.__init__ = self._start()  # type: ignore[method-assign]

    def _start(self) -> Callable[..., None]:
        """Return a function in place of the constructor of a section."""

        def start(
            section: fields.Section, value: fields.Value, node: MappingNode, keys: Any
        ) -> None:
            """Record the keys of the mapping, and change its entries."""
            path = _path(value, node)
            names = [key.text for key, _ in node.entries if isinstance(key, ScalarNode)]
            # The names of a mapping with any names are no keys.
            if isinstance(keys, fields.Keys) or path.startswith("law(") or list(keys) != names:
                node = self._change(value, node, keys, path)
            else:
                renamed = vars(value.faults)[RENAMED]
                renamed.update({f"{value.key}.{name}": f"{path}.*" for name in names})
            self._unchanged(section, value, node, keys)

        return start

    def _change(self, value: fields.Value, node: MappingNode, keys: Any, path: str) -> MappingNode:
        """Record the keys of a mapping, and return the mutated mapping."""
        types = _types(keys, path)
        names = [key.text for key, _ in node.entries if isinstance(key, ScalarNode)]
        for name in [name for name in types if name in names]:
            place = _place(value.faults.file_type, path, name)
            self.specified.add(place)
            if place not in self._receivers:
                following = list(types)[list(types).index(name) + 1 :]
                similar = [other for other in following if types[other] == types[name]]
                self._receivers[place] = similar[0] if similar else ""
            if _is_needed(name, keys, path):
                self._needed.add(place)
            if self.mutant is not None and self.mutant.place == place:
                if not any(node is mutated for mutated in self._mutated):
                    node = _mutated(node, name, self.mutant.receiver)
                    self._mutated.append(node)
                    object.__setattr__(value, "node", node)  # for `Value.peek`
                return node
        return node

    def mutants(self) -> Iterator[Mutant]:
        """Yield the mutants of the declared keys.

        An ignored required key is an error in every file, and no mutant.
        """
        declared = set(_declared())
        schemas = {file_type for file_type, _ in declared}
        others = {place for place in self._receivers if place[0] not in schemas}
        for place in sorted(declared | others):
            if place not in self._needed:
                yield Mutant(place)
            if receiver := self._receivers.get(place, ""):
                yield Mutant(place, receiver)


def _types(keys: Any, path: str) -> dict[str, object]:
    """Return the type of the value of each key; equal types can be exchanged."""
    if isinstance(keys, fields.Keys):
        return dict(keys.types())
    parameters = {parameter.name: parameter for parameter in _parameters(path)}
    return {
        key: (parameter.many, parameter.points, parameter.choices, parameter.force)
        if (parameter := parameters.get(key))
        else key
        for key in keys
        if key != "type"
    }


def _parameters(path: str) -> tuple[LawParameter, ...]:
    """Return the parameters of the law in a path."""
    law = re.match(r"law\((\S+)\)", path)
    return LAWS[law[1]].parameters if law and law[1] in LAWS else ()


def _is_needed(name: str, keys: Any, path: str) -> bool:
    """Return True if a file without the key is refused."""
    if isinstance(keys, fields.Keys):
        return any(key.name == name and key.needed for key in keys.declared)
    return any(
        parameter.name == name and parameter.default is None and parameter.without is None
        for parameter in _parameters(path)
    )


def _declared() -> Iterator[Place]:
    """Yield the keys in the schemas of the two kinds of files."""
    for file_type, schema in (
        ("model file", model_schema()),
        ("campaign file", campaign_schema()),
    ):
        for path in _paths(schema, ""):
            yield file_type, path


def _paths(schema: Any, path: str) -> Iterator[str]:
    """Yield the keys of a schema."""
    if isinstance(schema, list):
        for part in schema:
            yield from _paths(part, path)
    elif isinstance(schema, dict):
        properties = schema.get("properties", {})
        law = properties.get("type", {}).get("enum", ())
        if len(law) == 1:
            path = f"law({law[0]})"
        for name, inner in properties.items():
            place = f"{path}.{name}".lstrip(".")
            if name != "type":
                yield _common(place)
            yield from _paths(inner, place)
        yield from _paths(schema.get("items"), f"{path}[]")
        yield from _paths(schema.get("additionalProperties"), f"{path}.*")
        yield from _paths(schema.get("anyOf"), path)


def _place(file_type: str, path: str, name: str) -> Place:
    """Return the place of a key. Models inside of files of problems are model files."""
    place = f"{path}.{name}".lstrip(".")
    is_model = place.startswith(("law(", "problems[].model."))
    owner = "model file" if is_model else file_type
    return owner, _common(place.removeprefix("problems[].model."))


def _common(place: str) -> str:
    """Return the common place of keys that one function reads: those of elements with any law, and
    the distributions of any parameter."""
    place = re.sub(
        r"^law\(\S+\)\.(name|stiffness|factor|angle)$", r"stories[].elements[].\1", place
    )
    return re.sub(r"^vary\.[a-z_]+\.", "vary.*.", place)


def _mutated(node: MappingNode, name: str, receiver: str) -> MappingNode:
    """Return a mapping without a key, or with the value of the key under the name of another."""
    entries = []
    for key, entry in node.entries:
        if isinstance(key, ScalarNode) and key.text == name:
            if receiver:
                entries.append((replace(key, text=receiver), entry))
        elif isinstance(key, ScalarNode) and receiver and key.text == receiver:
            entries.append((replace(key, text=name), entry))
        else:
            entries.append((key, entry))
    return replace(node, entries=tuple(entries))


def _path(value: fields.Value, node: MappingNode) -> str:
    """Return the key of a mapping without numbers of entries, with the names of laws."""
    renamed = vars(value.faults).setdefault(RENAMED, {})
    path = value.key
    for outer in sorted(renamed, key=len, reverse=True):
        if path == outer or path.startswith(f"{outer}."):
            path = renamed[outer] + path[len(outer) :]
            break
    for key, entry in node.entries:
        if isinstance(key, ScalarNode) and key.text == "type" and isinstance(entry, ScalarNode):
            path = f"law({entry.text})" if entry.text in LAWS else path
            renamed[value.key] = path
    return re.sub(r"\[\d+\]", "[]", path)
