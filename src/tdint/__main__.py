"""Run the command `tdint` with `python -m tdint`. The command is in the package `tdint_cli`."""

import runpy

if __name__ == "__main__":
    runpy.run_module("tdint_cli", run_name="__main__", alter_sys=True)
