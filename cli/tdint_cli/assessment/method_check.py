"""Checks of the methods and laws of plug-ins, for `tdint check --plugin`."""

from __future__ import annotations

from tdint.errors import AnalysisError, TdintError
from tdint_cli.terminal import Failures, note


def check_methods(plugins: tuple[str, ...]) -> None:
    """Compare the methods of plug-ins with their declared properties, and write the table. Failures
    is raised afterwards if a method contradicts its properties.
    """
    from tdint.assessment.order.order import check_method
    from tdint.assessment.tables import DECLARATION
    from tdint.methods.catalogue import load_plugin, parse
    from tdint.output.tables.table import Table
    from tdint_cli.drawing import emit_table

    # The result of `load_plugin` has two parts: the methods and the laws that a plug-in defines.
    definitions = [load_plugin(file) for file in plugins]
    checks = [check_method(parse(method.name)) for methods, _ in definitions for method in methods]
    # Report the errors after the table that shows them.
    if checks:
        emit_table(Table.of_results(DECLARATION, checks))
    for check in checks:
        note(*check.notes)
    if law_names := [law.name for _, laws in definitions for law in laws]:
        note(f"to check the laws ({', '.join(law_names)}), add a model file that uses them")
    if errors := [AnalysisError(fault) for check in checks for fault in check.faults]:
        raise Failures([*errors])


def law_errors(file: str, plugins: tuple[str, ...]) -> list[TdintError]:
    """Return the errors of the plug-in laws that a model uses.

    Each law with its parameters is tested one time, in the last story that has it. The list is
    empty without plug-ins, and for a model on standard input, which can be read only once.
    """
    if not plugins or file == "-":
        return []
    from tdint.assessment.order.order import check_law
    from tdint.methods.catalogue import load_plugin
    from tdint.model.config.model_file import load_model

    plugin_laws = {law.name for plugin in plugins for law in load_plugin(plugin)[1]}
    model = load_model(file)
    story_of_law = {
        tuple(spring.law for spring in story.springs): number
        for number, story in enumerate(model.stories, start=1)
        if any(spring.law.name in plugin_laws for spring in story.springs)
    }
    return [
        AnalysisError(f"{file}: {inconsistency}")
        for number in story_of_law.values()
        for inconsistency in check_law(model, number)
    ]
