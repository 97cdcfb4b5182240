"""`python -m gvgbot`."""

import sys

from gvgbot.cli import main

if __name__ == "__main__":
    sys.exit(main())
