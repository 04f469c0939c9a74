"""``python -m flurries``: the command line."""

import sys

from flurries.cli import main

sys.exit(main())
