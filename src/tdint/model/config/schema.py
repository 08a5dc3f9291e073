"""The JSON schema of a model file, for editors: made of the declarations that its reader goes by."""

from __future__ import annotations

from tdint.model.config.read import model_keys
from tdint.model.keys.kinds import Schema


def model_schema() -> Schema:
    """The JSON schema (draft 7) of model files.

    What it refuses, the reader refuses, too. The reader refuses more: what several keys say together, such as a list
    with an entry for each story.
    """
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "tdint model",
        "description": "A shear building and its loads for tdint",
        **model_keys().schema(),
    }
