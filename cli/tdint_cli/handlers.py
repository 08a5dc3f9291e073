"""Parts of commands that belong to studies and to the laboratory of methods.

The commands of the engine do not import these modules: they call a handler by its name. A module is
imported when its handler is called for the first time.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

HANDLERS = {
    "several runs": "tdint_cli.studies.many_runs:run_many",
    "models of a campaign": "tdint_cli.studies.campaign_check:models_in",
    "schema of campaigns": "tdint.studies.campaign.reader:campaign_schema",
    "methods of plug-ins": "tdint_cli.assessment.method_check:check_methods",
    "laws of plug-ins": "tdint_cli.assessment.method_check:law_errors",
}
"""The handlers by name: module and function."""


def call(name: str, *arguments: Any) -> Any:
    """Call a handler."""
    module, _, function = HANDLERS[name].partition(":")
    return getattr(import_module(module), function)(*arguments)
