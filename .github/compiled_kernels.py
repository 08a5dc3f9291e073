"""Compiled kernels in the wheel, for the processors that TDINT_WHEEL_TARGETS names as `tdint compile --target` does.

    TDINT_WHEEL_TARGETS=x86-64-v2,x86-64-v3,aarch64,macos-x86-64-v2,macos-aarch64,windows-x86-64-v2 \\
        python -m build --wheel

Without it the wheel has none, and takes a second. Each object is looked into before it is taken (`foreign_objects`).
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class KernelHook(BuildHookInterface):
    """Has `tdint compile` write the objects, and puts them into the wheel."""

    @property
    def _targets(self) -> str:
        return os.environ.get("TDINT_WHEEL_TARGETS", "")

    def dependencies(self) -> list[str]:
        """What compiling needs, beside what reads objects of other systems."""
        return [*self.metadata.core.dependencies, "lief>=0.17"] if self._targets else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        self._folder = Path(tempfile.mkdtemp())
        if not self._targets or version == "editable":
            return
        root = Path(self.root)
        paths = os.pathsep.join([str(root / "src"), str(root / "cli"), *filter(None, sys.path)])
        command = [sys.executable, "-m", "tdint_cli", "compile", "--all", "--target", self._targets, "-o", self._folder]
        subprocess.run(command, env={**os.environ, "PYTHONPATH": paths}, check=True)
        sys.path.insert(0, str(root / ".github"))
        from foreign_objects import check

        for file in sorted(self._folder.rglob("*.object")):
            head, _, code = file.read_bytes().partition(b"\n")
            about = json.loads(head)
            check(code, about)
            place = f"tdint/kernels/prebuilt/{about['platform']}/{file.name}"
            build_data["force_include"][str(file)] = place

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)
