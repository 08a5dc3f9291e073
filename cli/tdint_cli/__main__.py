"""`python -m tdint_cli`: the command `tdint`."""

from tdint_cli.main import main

if __name__ == "__main__":
    main()
