"""Kernels as object files: compiled by processes of their own, kept, found again and loaded."""
