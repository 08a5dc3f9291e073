"""Reading of record files: formats, units, selected components and suites of ground motions."""
