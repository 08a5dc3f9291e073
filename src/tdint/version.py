"""The version of tdint: for people, for packages, and for files that say what wrote them."""

__version__ = "0.2.0"
