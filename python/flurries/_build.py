"""Refuse a Python that the extension does not load in, before it fails with words of its own."""

import sys

if "t" in getattr(sys, "abiflags", ""):
    raise ImportError(
        "flurries does not run on a free-threaded Python: its extension is built for the stable "
        "interface, which such a Python lacks; take the usual build, python3 and not python3t"
    )
