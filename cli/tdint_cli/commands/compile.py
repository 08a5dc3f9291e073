"""`tdint compile`: kernels ahead of their first use."""

from __future__ import annotations

from pathlib import Path

import click

from tdint.errors import UsageError
from tdint.files import check_outputs
from tdint.written_numbers import how_many
from tdint_cli import options
from tdint_cli.options.grammar import ListOf, Mode, refuse_idle
from tdint_cli.terminal import emit, progress_bar, say

_HERE = ("x86-64-v4", "x86-64-v3", "x86-64-v2", "x86-64", "aarch64")
_SYSTEMS = ("linux", "macos", "windows")
TARGETS = ("native", *_HERE, *(f"{system}-{one}" for system in _SYSTEMS for one in _HERE))[
    :-1
]  # Windows: x86-64 only


_COMPILE, _SHOW = (
    Mode("", frozenset(("targets", "output"))),
    Mode("with --show", frozenset({"show"})),
)
_CLEAN = Mode("with --clean alone")
MODES = (_COMPILE, _SHOW, _CLEAN)


@options.request
class Request:
    """The command line of `tdint compile`."""

    models: tuple[str, ...] = options.argument("[MODEL.yaml]...", nargs=-1)
    everything: bool = options.option("--all", help="Compile all that there is, for any building.")
    targets: tuple[str, ...] | None = options.option(
        "--target",
        type=ListOf(click.Choice(TARGETS)),
        metavar="NAME,...",
        help=f"Processors to compile for: native, this machine's, by default; {', '.join(_HERE)}; "
        f"those of another system behind {', '.join(_SYSTEMS)}: macos-aarch64.",
    )
    method: str | None = options.analysis.method_of("MODEL.yaml")
    show: bool = options.option(
        help="Tell for each loop which object is used and whether it came in a wheel; compile "
        "nothing."
    )
    clean: bool = options.option(help="Remove all compiled loops from the user's cache.")
    output: str | None = options.output.output(
        "DIR", "Write to this folder, which TDINT_KERNELS_DIR then names.", tables=False
    )


@options.command(
    "compile",
    "tdint compile office.yaml",
    "tdint compile office.yaml --show",
)
@options.analysis.plugin
@options.of(Request)
def command(request: Request) -> None:
    """Compile time loops ahead of their first use.

    tdint compiles what a building needs when it is first integrated, 5 to 20 s once; this does it
    before. It is for images, clusters and laboratories where users cannot write, and for other
    processors. For each MODEL.yaml what its run needs, with --all one variant of everything that
    serves any building, in a few minutes. Without -o the objects lie in the user's cache, never in
    the installed package; --clean removes them, before tdint is uninstalled, say.
    """
    # --clean alone is an order by itself; with models it comes before they are compiled.
    asked = bool(request.models or request.everything)
    if asked or request.clean:
        refuse_idle((_SHOW if request.show else _COMPILE) if asked else _CLEAN, MODES)
    if request.clean:
        from tdint.kernels.building import store

        say(f"{how_many(store.clean(), 'compiled time loop')} removed.")
        if not asked:
            return
    if not asked:
        raise UsageError("nothing to compile: give a MODEL.yaml, or --all")
    from tdint.analysis.run.prepared import of_everything, of_model
    from tdint.kernels.building.load_or_compile import compile_ahead, list_objects
    from tdint.methods.catalogue import DEFAULT_METHOD, parse
    from tdint.model.config.model_file import load_model

    if request.output:
        check_outputs([Path(request.output) / "objects"], overwrite=True)
    # What each model needs, beside what serves any building; what is compiled already is passed
    # over.
    kernels = of_everything() if request.everything else []
    for file in request.models:
        model = load_model(file)
        kernels += of_model(model, parse(request.method or model.analysis.method or DEFAULT_METHOD))
    if request.show:
        emit(
            "".join(
                ",".join(row) + "\n"
                for row in [("loop", "variant", "object", "origin"), *list_objects(kernels)]
            ).encode()
        )
        return
    with progress_bar(to_terminal=False) as progress:
        folder = Path(request.output) if request.output else None
        written = compile_ahead(
            kernels,
            request.targets or ("native",),
            folder,
            lambda part: progress("compiling", part),
        )
    if not written:
        say("All of it is compiled already.")
    else:
        say(f"{how_many(len(written), 'time loop')} compiled, in {written[0].parent}")
