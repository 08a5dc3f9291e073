"""The version of tdint: for people, for packages, and for files that say what wrote them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

__version__ = "0.2.0"


@cache
def version_of_sources() -> tuple[str, str]:
    """The version, with the sources' hash behind it unless they are those that the installed package came with
    (`0.2.0+sources.1a2b3c4d`), and that hash, 16 hexadecimal digits.

    Nothing tells a checkout that was changed from one that was not: none calls itself a release.
    """
    from base64 import urlsafe_b64encode
    from hashlib import sha256
    from importlib.metadata import PackageNotFoundError, distribution

    folder = Path(__file__).parent
    digests = {file.relative_to(folder).as_posix(): sha256(file.read_bytes()) for file in folder.rglob("*.py")}
    of_all = sha256("".join(f"{name} {digests[name].hexdigest()}\n" for name in sorted(digests)).encode()).hexdigest()
    try:
        files = distribution("tdint").files or ()
    except PackageNotFoundError:  # Imported from a folder, not installed.
        files = ()
    packed = {file.as_posix(): file.hash.value for file in files if file.hash}
    released = all(
        packed.get(f"{folder.name}/{name}") == urlsafe_b64encode(found.digest()).rstrip(b"=").decode()
        for name, found in digests.items()
    )
    return (__version__ if released else f"{__version__}+sources.{of_all[:8]}"), of_all[:16]
