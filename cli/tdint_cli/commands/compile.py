"""`tdint compile`: kernels ahead of their first use."""

from __future__ import annotations

from pathlib import Path

import click

from tdint.errors import UsageError
from tdint.written_numbers import how_many
from tdint_cli import options
from tdint_cli.terminal import emit, progress_bar, say

_HERE = ("x86-64-v4", "x86-64-v3", "x86-64-v2", "x86-64", "aarch64")
_SYSTEMS = ("linux", "macos", "windows")
TARGETS = ("native", *_HERE, *(f"{system}-{one}" for system in _SYSTEMS for one in _HERE))[:-1]  # Windows: x86-64 only


@options.command("compile")
@options.analysis.plugin
@click.argument("models", metavar="[MODEL.yaml]...", nargs=-1)
@options.headings.option("--all", "everything", is_flag=True, help="Compile all that there is, for any building.")
@options.headings.option(
    "--target",
    "targets",
    many=True,
    type=click.Choice(TARGETS),
    metavar="NAME,...",
    help=f"Processors to compile for: native, this machine's, by default; {', '.join(_HERE)}; those of another system "
    f"behind {', '.join(_SYSTEMS)}: macos-aarch64.",
)
@options.analysis.method_of("MODEL.yaml")
@options.headings.option("--show", is_flag=True, help="Tell for each loop which object is used; compile nothing.")
@options.headings.option("--clean", is_flag=True, help="Remove all compiled loops from the user's cache.")
@options.output.output("DIR", "Write to this folder, which TDINT_KERNELS_DIR then names.")
def command(
    models: tuple[str, ...],
    everything: bool,
    targets: tuple[str, ...] | None,
    method: str | None,
    show: bool,
    clean: bool,
    output: str | None,
) -> None:
    """Compile time loops ahead of their first use.

    tdint compiles what a building needs when it is first integrated: 5 to 20 s once. This does it before: for images,
    clusters and laboratories where users cannot write, and for other processors. For each MODEL.yaml what its run
    needs, with --all one variant of everything that serves any building, in a few minutes. Without -o the objects
    lie in the user's cache, never in the installed package; --clean removes them, before tdint is uninstalled, say.
    """
    if clean:
        from tdint.kernels.building import store

        say(f"{how_many(store.clean(), 'compiled time loop')} removed.")
        if not (models or everything):
            return
    if not models and not everything:
        raise UsageError("nothing to compile: give a MODEL.yaml, or --all")
    from tdint.analysis.run.compilation import of_everything, of_model
    from tdint.kernels.building.obtaining import compile_ahead, shown
    from tdint.methods.catalogue import DEFAULT_METHOD, parse
    from tdint.model.config.model_file import load_model

    wanted = of_everything() if everything else []
    for file in models:
        model = load_model(file)
        wanted += of_model(model, parse(method or model.analysis.method or DEFAULT_METHOD))
    if show:
        emit("".join(",".join(row) + "\n" for row in [("loop", "variant", "object"), *shown(wanted)]).encode())
        return
    with progress_bar(to_terminal=False) as progress:
        folder = Path(output) if output else None
        written = compile_ahead(wanted, targets or ("native",), folder, lambda part: progress("compiling", part))
    if not written:
        say("All of it is compiled already.")
    else:
        say(f"{how_many(len(written), 'time loop')} compiled, in {written[0].parent}")
