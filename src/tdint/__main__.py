"""`python -m tdint`: the command `tdint`, which is a package of its own beside this one."""

from importlib import import_module

if __name__ == "__main__":
    import_module("tdint_cli.main").main()
