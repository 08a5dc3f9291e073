"""`python -m tdint`: the command `tdint`, which is a package of its own beside this one."""

import runpy

if __name__ == "__main__":
    runpy.run_module("tdint_cli", run_name="__main__", alter_sys=True)
