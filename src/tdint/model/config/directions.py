"""Model files with two directions: expand the nodes of the file into a document for each direction.

A story, the file and its `excitation` can contain mappings `x` and `y`. The document of a direction
contains all other keys, and the keys of its mapping. The reader of files for a single direction
then reads both documents (`model_file`). The directions are uncoupled: the masses and heights of
the stories are common, and no spring, damper or rotation connects both directions.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from tdint.model.keys.fields import ANY, Key, Keys, Value
from tdint.model.keys.nodes import ListNode, MappingNode, Node, ScalarNode
from tdint.model.story import Story
from tdint.model.story_laws import LAWS

DIRECTIONS = ("x", "y")

OF_SPRINGS = (
    "stiffness",
    "period",
    "law",
    "elements",
    "dashpot",
    "isolator",
    "rayleigh",
    "p_delta",
    "inertance",
)
"""Keys of stories that need a spring of the story."""

OF_STORY = (*OF_SPRINGS, "flexural", "rotary_inertia")
"""Keys of stories that a direction can have."""
OF_FILE = ("damping", "p_delta", "attachments", "links", "stiffness_matrix", "base", "initial")
"""Keys of the file that a direction can have."""
OF_EXCITATION = ("record", "displacement", "velocity", "forces")
"""Keys of `excitation` that a direction can have."""
_OF_BOTH = {"x": ("azimuth",), "y": ("azimuth", "record", "displacement", "velocity")}
"""Keys of `excitation`, outside of its mappings, that the document of a direction does not contain.
A motion outside of the mappings has both components, and is part of the document of x."""

_UNCOUPLED = "the two directions of a model are uncoupled chains of masses"
_TORSION = (
    f"{_UNCOUPLED}, without torsion; omit it for a symmetric building, or use a spatial model of "
    "another program"
)
_INTERACTION = (
    f"{_UNCOUPLED}: a law cannot depend on both drifts; give a separate law in `x` and `y`, which "
    "overestimates the strength in an oblique direction by up to sqrt 2"
)
_SHARED = (
    f"{_UNCOUPLED}: a link or a damper acts in one direction; give its component in the mappings "
    "`x` and `y`"
)
_REASONS = {
    **dict.fromkeys(("torsion", "eccentricity", "rotation", "rotational_inertia"), _TORSION),
    **dict.fromkeys(("interaction", "coupling", "biaxial", "yield_surface"), _INTERACTION),
    **dict.fromkeys(("direction", "directions", "angle_in_plan", "orientation"), _SHARED),
}
"""Reasons by the names of keys, or of the types of laws, that would couple the directions."""

_ISOLATOR = (
    "the yield surface of a friction or other yielding isolator is biaxial: two separate springs "
    "overestimate its strength by up to sqrt 2; run each direction as a model with one direction, "
    "or give the isolator an equivalent linear stiffness and a dashpot"
)


def with_directions(keys: tuple[Key, ...], names: Collection[str]) -> tuple[Key, ...]:
    """Return the keys of a mapping with `x` and `y`, which can contain the keys in `names`."""
    own = Keys(tuple(key for key in keys if key.name in names))
    meaning = "values of one of two directions, instead of a value for both:"
    return (*keys, *(Key(direction, own, f"{meaning} {direction}") for direction in DIRECTIONS))


def has_directions(root: Value) -> bool:
    """Return True if a model file, a story or the excitation contains `x` or `y`, or the excitation
    the `azimuth` of axis x."""
    excitation = root.peek("excitation")
    return bool(excitation and excitation.peek("azimuth")) or any(
        place.peek(name) for place in _places(root) for name in DIRECTIONS
    )


def _places(root: Value) -> Iterator[Value]:
    """Yield the mappings of a file that can contain the mappings of directions."""
    yield root
    if excitation := root.peek("excitation"):
        yield excitation
    stories = root.peek("stories")
    if stories and isinstance(stories.node, ListNode):
        for number, node in enumerate(stories.node.items, start=1):
            yield Value(node, f"stories[{number}]", root.faults)


def documents_of(root: Value) -> tuple[Value, Value]:
    """Return the documents of both directions. Reports incomplete mappings, and keys that are
    common to both directions or couple them."""
    for place in _places(root):
        present = [name for name in DIRECTIONS if place.peek(name)]
        if len(present) == 1:
            missing = "y" if present == ["x"] else "x"
            place.fault(f"`{present[0]}` is given, but not `{missing}`; give both directions")
    for name in ("matrices", "building"):
        if value := root.peek(name):
            value.fault("cannot be used with two directions; give `stories`")
    for key, node in _coupling_entries(root):
        is_type = key.text == "type" and isinstance(node, ScalarNode)
        name = node.text if is_type and isinstance(node, ScalarNode) else key.text
        if name in _REASONS:
            root.faults.add(key, name, _REASONS[name])
    x, y = (_document(root, direction) for direction in DIRECTIONS)
    return x, y


def _coupling_entries(root: Value) -> Iterator[tuple[ScalarNode, Node]]:
    """Yield the keys and values of the file, and of all mappings in its stories and devices."""
    inner = ("stories", "attachments", "links", *DIRECTIONS)
    nodes = [root.node]
    while nodes:
        node = nodes.pop()
        if isinstance(node, ListNode):
            nodes += [item for item in node.items if isinstance(item, ListNode | MappingNode)]
        for key, value in node.entries if isinstance(node, MappingNode) else ():
            if isinstance(key, ScalarNode):
                yield key, value
                # The rotation of a base is that of a section through the building in its direction.
                is_inner = node is not root.node or key.text in inner
                if is_inner and key.text != "base":
                    nodes.append(value)


def _document(root: Value, direction: str) -> Value:
    """Return the document of a direction."""
    document = _merged(root, direction, OF_FILE)
    entries: list[tuple[Node, Node]] = []
    for key, node in document.entries if isinstance(document, MappingNode) else ():
        name = key.text if isinstance(key, ScalarNode) else ""
        value = Value(node, name, root.faults)
        if name == "excitation":
            value = value._replace(node=_without(node, _OF_BOTH[direction]))
            node = _merged(value, direction, OF_EXCITATION)
        elif name == "stories" and isinstance(node, ListNode):
            stories = [
                _merged(Value(story, f"stories[{number}]", root.faults), direction, OF_STORY)
                for number, story in enumerate(node.items, start=1)
            ]
            node = node._replace(items=stories)
        entries.append((key, node))
    if isinstance(document, MappingNode):
        document = document._replace(entries=tuple(entries))
    return root._replace(node=document)


def _merged(value: Value, direction: str, allowed: Sequence[str]) -> Node:
    """Return a mapping with the entries of its mapping for `direction`, and without both mappings
    of directions. `allowed` are the keys that a direction can have."""
    own = value.peek(direction)
    common = _without(value.node, DIRECTIONS)
    if own is None or not isinstance(common, MappingNode):
        return common
    if not isinstance(own.node, MappingNode):
        own.fault(f"must be a mapping with the keys {', '.join(allowed)}")
        return common
    entries = []
    for key, entry in own.node.entries:
        name = key.text if isinstance(key, ScalarNode) else ""
        full_key = f"{own.key}.{name}"
        if name not in allowed:
            advice = f"a direction can have {', '.join(allowed)}; other keys are common to both"
            value.faults.add(key, full_key, f"not a key of one direction: {advice}")
        elif other := value._replace(node=common).peek(name):
            line = f" on line {other.node.line}" if other.node.line else ""
            message = f"given for both directions{line}, and for {direction}; give it once"
            value.faults.add(key, full_key, message)
        else:
            entries.append((key, entry))
    return common._replace(entries=(*common.entries, *entries))


def _without(node: Node, names: Collection[str]) -> Node:
    """Return a mapping without some keys; a node of another type unchanged."""
    if not isinstance(node, MappingNode):
        return node
    entries = (
        (key, value)
        for key, value in node.entries
        if not (isinstance(key, ScalarNode) and key.text in names)
    )
    return node._replace(entries=tuple(entries))


def read_azimuth(root: Value, *, has_pair: bool) -> float | None:
    """Return the azimuth of axis x, degrees; None without the key. With `has_pair`, the motion is a
    recording with components that can be rotated."""
    excitation = root.peek("excitation")
    azimuth = excitation.peek("azimuth") if excitation else None
    if azimuth and not has_pair:
        azimuth.fault(
            "the components in `x` and `y` act along the axes and are not rotated; omit it"
        )
    return azimuth.number(ANY) if azimuth else None


def check_isolators(root: Value, stories: Sequence[Story]) -> None:
    """Report isolators with a yield surface that both directions have in common."""
    for number, story in enumerate(stories, start=1):
        laws = [element.law for element in story.elements] or [story.law]
        is_elastic = all(LAWS[law.name].symmetric(law.parameters) for law in laws)
        if story.isolator and not is_elastic:
            root.fault(f"story {number}: {_ISOLATOR}")
            return
