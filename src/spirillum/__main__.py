"""The command `spirillum`, and `python -m spirillum`."""

import sys


def main() -> None:
    """Run the command line; an interrupt before it is loaded ends as one after it, without a traceback."""
    try:
        from spirillum.cli import main as command_line
    except KeyboardInterrupt:
        sys.stderr.write("spirillum: interrupted; finished files are kept\n")
        sys.exit(130)
    command_line()


if __name__ == "__main__":
    main()
