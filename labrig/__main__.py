"""The command `labrig`."""

import sys


def main() -> None:
    """Run the command line; every ending has its exit code and at most one line of complaint."""
    from labrig.cli.ending import guarded

    sys.exit(guarded(sys.argv[1:]))


if __name__ == "__main__":
    main()
