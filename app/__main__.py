"""``python -m app``: the command line; ``--help`` lists the commands."""

import sys

from app.cli.entry import main

if __name__ == "__main__":
    sys.exit(main())
