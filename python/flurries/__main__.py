"""``python -m flurries``: the command line."""

import sys

from flurries.cli.main import main

sys.exit(main())
