"""`tdint compile`: compilation of kernels before their first use."""

from __future__ import annotations

from pathlib import Path

import click

from tdint.errors import UsageError
from tdint.files import check_outputs
from tdint.number_parsing import pluralize
from tdint_cli import options
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.options.option_types import ListOf
from tdint_cli.terminal import emit, progress_bar, say

_PROCESSORS = ("x86-64-v4", "x86-64-v3", "x86-64-v2", "x86-64", "aarch64")
_SYSTEMS = ("linux", "macos", "windows")
TARGETS = (
    "native",
    *_PROCESSORS,
    *(f"{system}-{processor}" for system in _SYSTEMS for processor in _PROCESSORS),
)[:-1]
"""Target processors. The last combination, windows-aarch64, is not supported."""

# The modes of the command (compilation, --show, and --clean without a compilation), each with the
# options that have an effect.


@options.request
class Request:
    """The command line of `tdint compile`."""

    models: tuple[str, ...] = options.argument("[MODEL.yaml]...", nargs=-1)
    everything: bool = options.option("--all")
    targets: tuple[str, ...] | None = options.option(
        "--target",
        type=ListOf(click.Choice(TARGETS)),
        help=f"Target processors: native (this machine, default); {', '.join(_PROCESSORS)}; for "
        f"another system with the prefix {', '.join(_SYSTEMS)}: macos-aarch64.",
    )
    method: str | None = options.analysis.method
    show: bool = options.option()
    clean: bool = options.option()
    output: str | None = options.output.output


@options.command
@options.analysis.plugin
@options.of(Request)
def command(request: Request) -> None:
    """Compile time loops ahead of their first use.

    By default, tdint compiles the time loops of a building at its first time integration, which
    takes 5 to 20 s. This command compiles them in advance: for container images, for clusters and
    laboratories where users have no write permission, and for other processors. It compiles the
    time loops and laws of each MODEL.yaml, or with --all those of all buildings, which takes a few
    minutes. Without -o the objects are stored in the cache of the user, never in the installed
    package; --clean removes them, for example before tdint is uninstalled.
    """
    # --clean is allowed without other options; with models, it is executed before the compilation.
    is_requested = bool(request.models or request.everything)
    if is_requested:
        refuse_idle("show" if request.show else "compile")
    elif request.clean:
        refuse_idle("clean")
    if request.clean:
        from tdint.kernels.building import store

        say(f"{pluralize(store.clean(), 'compiled time loop')} removed.")
        if not is_requested:
            return
    if not is_requested:
        raise UsageError(
            "no model file is specified; specify the models to compile for (tdint compile "
            "MODEL.yaml), or compile for all buildings (tdint compile --all)"
        )
    from tdint.kernels.building.load_or_compile import compile_ahead, list_objects
    from tdint.methods.catalogue import method_of, parse
    from tdint.model.config.model_file import load_model
    from tdint.response.runs.analysis_kernels import all_kernels, kernels_of_model

    if request.output:
        check_outputs([Path(request.output) / "objects"], overwrite=True)
    # Collect the kernels of each model, in addition to the kernels for any building with --all.
    # Kernels that are compiled already are skipped.
    kernels = all_kernels() if request.everything else []
    for file in request.models:
        model = load_model(file)
        kernels += kernels_of_model(model, parse(method_of(model, request.method)))
    if request.show:
        from tdint.output.tables.table import csv_bytes

        emit(csv_bytes([("loop", "form", "object", "origin"), *list_objects(kernels)]))
        return
    with progress_bar(to_terminal=False) as progress:
        folder = Path(request.output) if request.output else None
        compiled_files = compile_ahead(
            kernels,
            request.targets or ("native",),
            folder,
            lambda fraction: progress("compiling", fraction),
        )
    if not compiled_files:
        say("All time loops are compiled already.")
    else:
        say(
            f"{pluralize(len(compiled_files), 'time loop')} compiled, in {compiled_files[0].parent}"
        )
