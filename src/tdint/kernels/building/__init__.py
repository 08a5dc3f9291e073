"""Kernels as object files: compilation in separate processes, storage, retrieval and loading."""
