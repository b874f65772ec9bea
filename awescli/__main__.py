"""`python -m awescli`: the `awes` command."""

from awescli.cli import main

if __name__ == "__main__":
    main()
