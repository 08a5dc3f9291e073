"""Build hook that adds compiled kernels to the wheel, for the processors of TDINT_WHEEL_TARGETS.

    TDINT_WHEEL_TARGETS=linux-x86-64-v2,linux-x86-64-v3 python -m build --wheel

The variable has the values of `tdint compile --target`. All kernels must be for the same platform,
since pip selects a wheel by its platform tag. Without the variable, the wheel contains no kernels,
is for all platforms, and is built within a second. `foreign_objects` checks each object.
`wheels.sh` builds all wheels.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from sysconfig import get_platform
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

TAGS = {
    ("linux", True): "manylinux_2_17_x86_64",
    ("linux", False): "manylinux_2_17_aarch64",
    ("darwin", True): "macosx_10_9_x86_64",
    ("darwin", False): "macosx_11_0_arm64",
    ("win32", True): "win_amd64",
}
"""Tag of the wheel by platform; the second key is True for x86-64. The objects call only the
mathematical functions of the C library, so these old versions of the systems are sufficient."""


class KernelHook(BuildHookInterface):
    """Build hook that runs `tdint compile` and adds the object files to the wheel."""

    @property
    def _targets(self) -> str:
        return os.environ.get("TDINT_WHEEL_TARGETS", "")

    def dependencies(self) -> list[str]:
        """Return the packages that are required to compile kernels and to check them."""
        return [*self.metadata.core.dependencies, "lief>=0.17"] if self._targets else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        self._folder = Path(tempfile.mkdtemp())
        if not self._targets or version == "editable":
            return
        root = Path(self.root)
        paths = os.pathsep.join([str(root / "src"), str(root / "cli"), *filter(None, sys.path)])
        command = [
            sys.executable,
            "-m",
            "tdint_cli",
            "compile",
            "--all",
            "--target",
            self._targets,
            "-o",
            self._folder,
        ]
        subprocess.run(command, env={**os.environ, "PYTHONPATH": paths}, check=True)
        sys.path.insert(0, str(root / ".github"))
        from foreign_objects import check

        tags = set()
        for file in sorted(self._folder.rglob("*.object")):
            head, _, code = file.read_bytes().partition(b"\n")
            about = json.loads(head)
            check(code, about)
            place = f"tdint/kernels/prebuilt/{about['platform']}/{file.name}"
            build_data["force_include"][str(file)] = place
            tags.add(
                TAGS.get((about["platform"], "x86-64" in about["target"]))
                if self._targets != "native"
                else None
            )
        if len(tags) != 1:
            raise ValueError(f"TDINT_WHEEL_TARGETS={self._targets}: a wheel is for one platform")
        build_data["tag"] = (
            f"py3-none-{tags.pop() or get_platform().replace('-', '_').replace('.', '_')}"
        )
        build_data["pure_python"] = False

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)
