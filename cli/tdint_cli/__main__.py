"""`python -m tdint_cli`: the command `tdint`."""

from tdint_cli import start

if __name__ == "__main__":
    start()
