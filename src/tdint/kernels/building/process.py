"""Processes that compile."""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from threading import Lock
from typing import IO, Any

from tdint.errors import AnalysisError
from tdint.kernels.building.compilable import Compilable, Variant
from tdint.kernels.building.sources import OUTSIDE, closure, size
from tdint.kernels.building.target import Target, named, native
from tdint.system import processors

_PLACE = re.compile(r'(?:File "| at )(?:[^"]*[/\\])?([^"/\\]+\.py)(?:", line |\s\()(\d+)')
"""As Python and numba name a place."""

_MISSING = re.compile(r"name '(\w+)'")


@dataclass(frozen=True)
class Compilation:
    """One kernel in one variant, to be compiled for targets that numba optimizes alike."""

    kernel: Compilable
    variant: Variant
    targets: Mapping[str, Target]

    @property
    def module(self) -> str:
        """The kernel's module."""
        return self.kernel.function.__module__

    @property
    def settings(self) -> dict[str, str]:
        """The environment of a process that compiles it, and whatever else has the same
        settings."""
        cpu, features = next(iter(self.targets.values())).optimized_for
        return {
            "TDINT_KERNELS_VARIANT": self.variant.text,
            "TDINT_KERNELS_TARGETS": ",".join(self.targets),
            "NUMBA_CPU_NAME": cpu,
            "NUMBA_CPU_FEATURES": features,
            "TDINT_KERNELS_PLUGINS": json.dumps(self.plugins),
            "NUMBA_LOOP_VECTORIZE": str(int(self.kernel.vectorized)),
        }

    @property
    def plugins(self) -> dict[str, tuple[str, str]]:
        """Module and file of each law of the variant that is a plug-in's."""
        modules = {law: OUTSIDE[law] for law in self.variant.outside}
        return {law: (name, str(sys.modules[name].__file__)) for law, name in modules.items()}

    @property
    def request(self) -> tuple[str, str | None]:
        """The kernel as a process knows it: its name, and the file of a module that is not the
        package's.

        Raises
        ------
        AnalysisError
            It is in no module that another process can load.
        """
        module = sys.modules[self.module]
        if module.__name__ == "__main__" or not getattr(module, "__file__", None):
            raise AnalysisError(
                f"{self.kernel.name} cannot be compiled: put the kernel into a module of its own"
            )
        return self.kernel.name, None if module.__name__.startswith("tdint.") else str(
            module.__file__
        )

    def reason(self, text: list[str]) -> str:
        """What numba says behind its last "Failed in nopython", and where: the file and the line;
        else the last line that the process wrote."""
        marks = [i for i, line in enumerate(text) if "Failed in nopython" in line]
        behind = (
            [line.strip() for line in text[marks[-1] + 1 :] if line.strip()] if marks else text[-1:]
        )
        said = " ".join(behind[: 2 if behind[0].endswith(":") else 1]) if behind else ""
        if not said:
            return ""
        outside = [file for _, file in self.plugins.values()] + (
            [self.request[1]] if self.request[1] else []
        )
        files = [Path(file) for file in outside]
        files += [
            file for file in closure(self.module, self.variant.laws).values() if file not in files
        ]
        # A name that is not there has no place in what numba says.
        if missing := _MISSING.search(said):
            place = next(
                (f"{file}:{line}" for file in files if (line := _line_of(missing[1], file))), ""
            )
        else:
            named = {file.name: file for file in reversed(files)}
            matches = filter(None, map(_PLACE.search, (*behind, *text[::-1])))
            places = [f"{named[match[1]]}:{match[2]}" for match in matches if match[1] in named]
            in_plugins = (
                [place for place in places if place.startswith(tuple(outside))] if outside else []
            )
            place = next(iter([*in_plugins, *places]), "")
        return f"{place or (outside[-1] if outside else '')}: {said}".removeprefix(": ")


def _line_of(name: str, file: Path) -> int:
    """The line of a source on which a name is used first; 0 if it is not."""
    if file.suffix != ".py":
        return 0
    names = (node for node in ast.walk(ast.parse(file.read_bytes())) if isinstance(node, ast.Name))
    return min(
        (node.lineno for node in names if node.id == name and isinstance(node.ctx, ast.Load)),
        default=0,
    )


class _Process:
    """A process that compiles kernels of the same settings, one after the other: what they share is
    compiled once."""

    def __init__(self, settings: Mapping[str, str]) -> None:
        """Raises OSError where no process can be started."""
        self.settings = settings
        pipe = subprocess.PIPE
        path = os.pathsep.join(filter(None, sys.path))
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "tdint.kernels.build"],
            stdin=pipe,
            stdout=pipe,
            stderr=pipe,
            env={
                **{**os.environ, **settings, "PYTHONPATH": path, "TDINT_KERNELS": "compile"},
                "OPENBLAS_NUM_THREADS": "1",
                "PYTHONHASHSEED": "0",  # numba goes through sets of names
            },
        )
        self._beside = ThreadPoolExecutor(1)  # a temporary file would need a folder for it
        self._words = self._beside.submit(self._pipe(self._process.stderr).read)

    def compile(self, compilation: Compilation) -> list[bytes]:
        """The packed object for each target.

        Raises
        ------
        AnalysisError
            It cannot be compiled; the process has ended.
        """
        try:
            asked = self._pipe(self._process.stdin)
            asked.write(json.dumps(compilation.request).encode() + b"\n")
            asked.flush()
        except OSError:  # it has ended, and says why
            pass
        # What `build` writes, an object for each target, or as far as it comes.
        written = self._pipe(self._process.stdout)
        packed: list[bytes] = []
        while len(packed) < len(compilation.targets) and (size_of_object := written.readline()):
            packed.append(written.read(int(size_of_object)))
        if len(packed) == len(compilation.targets):
            return packed
        code = self._process.wait()
        text = self._words.result().decode(errors="replace").strip().splitlines()
        said = compilation.reason(text) or f"exit code {code}"
        whole = RuntimeError("\n".join(text))  # shown with --debug
        raise AnalysisError(f"{compilation.kernel.name} cannot be compiled: {said}") from whole

    def end(self) -> None:
        """End it, whatever it does."""
        self._process.kill()
        self._beside.shutdown()
        with (
            suppress(OSError),
            self._process,
        ):  # what was asked of an ended one cannot be handed over
            pass

    @staticmethod
    def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
        assert pipe is not None
        return pipe


def compilations(missing: Iterable[tuple[Compilable, Variant, str]]) -> list[Compilation]:
    """What is to be run for kernels and names of targets (`target.named`): those that are optimized
    alike together."""
    together: dict[Any, dict[str, Target]] = {}
    for kernel, variant, name in missing:
        target = named(name)
        # Without vectors all processors are one to the optimizer, but for this one, which numba
        # compiles for itself.
        alike = target.optimized_for if kernel.vectorized or target == native() else None
        together.setdefault((kernel, variant, alike), {})[name] = target
    return [
        Compilation(kernel, variant, targets) for (kernel, variant, _), targets in together.items()
    ]


def run_all(compilations: Sequence[Compilation]) -> Iterator[tuple[Compilation, list[bytes]]]:
    """Run as many processes side by side as there are processors; the objects of each kernel as it
    is done.

    Raises
    ------
    AnalysisError
        One cannot be compiled.
    """
    if compilations and importlib.util.find_spec("numba") is None:
        names = ", ".join(dict.fromkeys(compilation.kernel.name for compilation in compilations))
        raise AnalysisError(
            f"{names}: not among the compiled loops that came with tdint; to compile, install numba"
        )
    crew = _Crew(compilations)
    count = min(processors(), len(compilations))
    with ThreadPoolExecutor(max(count, 1)) as pool:
        try:
            for _ in range(count):
                pool.submit(crew.work)
            for _ in compilations:
                compilation, packed = crew.done.get()
                if isinstance(packed, BaseException):
                    raise packed
                yield compilation, packed
        finally:
            crew.stop()


class _Crew:
    """Processes that share what is to be compiled."""

    def __init__(self, compilations: Sequence[Compilation]) -> None:
        self.done: SimpleQueue[tuple[Compilation, list[bytes] | BaseException]] = SimpleQueue()
        self._lock = Lock()
        self._waiting = sorted(
            compilations, key=lambda compilation: size(compilation.kernel.name), reverse=True
        )
        self._in_work: list[str] = []
        self._processes: set[_Process] = set()

    def work(self) -> None:
        """Let one process after the other compile what waits, until nothing does."""
        process, last = None, None
        while last := self._next(last):
            try:
                if process is None or process.settings != last.settings:
                    self._end(process)
                    process = self._start(last)
                self.done.put((last, process.compile(last)))
            except BaseException as error:
                self.done.put((last, error))
                break
        self._end(process)

    def stop(self) -> None:
        """Start nothing more, and end what runs."""
        with self._lock:
            self._waiting.clear()
            running = set(self._processes)
        for process in running:
            self._end(process)

    def _next(self, last: Compilation | None) -> Compilation | None:
        """The longest one; rather one of the last one's module, or of its settings, and of no
        module in work."""
        with self._lock:
            if last:
                self._in_work.remove(last.module)
            alike = [
                waiting for waiting in self._waiting if last and waiting.settings == last.settings
            ]
            near = [waiting for waiting in alike if last and waiting.module == last.module]
            others = [
                waiting for waiting in alike or self._waiting if waiting.module not in self._in_work
            ]
            following = next(iter(near or others or self._waiting), None)
            if following:
                self._waiting.remove(following)
                self._in_work.append(following.module)
            return following

    def _start(self, compilation: Compilation) -> _Process:
        with self._lock:
            try:
                process = _Process(compilation.settings)
            except OSError as error:
                name = compilation.kernel.name
                raise AnalysisError(
                    f"{name} cannot be compiled: no process can be started ({error})"
                ) from None
            self._processes.add(process)
            return process

    def _end(self, process: _Process | None) -> None:
        with self._lock:
            running = process in self._processes
            self._processes.discard(process)
        if process and running:
            process.end()
