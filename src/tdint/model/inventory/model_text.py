"""The model file of a derived building, as text."""

from __future__ import annotations

import json

from tdint.model.definition import RayleighRatio
from tdint.model.inventory.definition import DerivedBuilding


def model_text(name: str, building: DerivedBuilding, rules: str) -> str:
    """A model file in SI units with everything written out: name, stories from the ground up, damping, method."""
    lines = [
        f"# A {building.design_level}-code {building.type} building by the rules {rules}, made by `tdint inventory`.",
        f"name: {json.dumps(name, ensure_ascii=False)}",
        "stories:",
    ]
    for story in building.stories:
        strength, ultimate, drift, pinching, unloading = story.law.parameters
        lines += [
            f"  - mass: {story.mass!r}",
            f"    height: {story.height!r}",
            f"    stiffness: {story.stiffness!r}",
            f"    law: {{type: trilinear-pinching, yield_force: {strength!r}, ultimate_force: {ultimate!r}, "
            f"ultimate_drift: {drift!r}, pinching: {pinching!r}, unloading: {unloading!r}}}",
        ]
    damping = building.damping
    if isinstance(damping, RayleighRatio):
        form = f"ratio: {damping.ratios[0]!r}, modes: [{damping.modes[0]}, {damping.modes[1]}]"
    else:
        form = f"mass: {damping.mass!r}, stiffness: {damping.stiffness!r}"
    return "\n".join([*lines, f"damping: {{rayleigh: {{{form}}}}}", "analysis: {method: impulse4}", ""])
