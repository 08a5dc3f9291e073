"""Methods of plug-ins that are not available."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tdint.errors import UsageError


@dataclass(frozen=True)
class UnavailableMethod:
    """Method of a plug-in that is not available: each access to an attribute raises UsageError.

    An error during unpickling would make a process pool wait forever. The error is therefore
    raised later, when the method is used.

    Attributes
    ----------
    message : str
        Reason why the plug-in could not be loaded, or why its version in this process differs.
    """

    message: str

    def __getattr__(self, name: str) -> Any:
        """Raise the stored error for an attribute that this object does not have.

        Attributes with names such as `__len__` are missing, as for any object.
        """
        # `pickle` and `copy` use only such names before they restore the fields. `message` is
        # therefore always set below.
        if name.startswith("__"):
            raise AttributeError(name)
        raise UsageError(self.message)
