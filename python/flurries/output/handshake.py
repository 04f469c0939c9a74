"""What a worker must have as the client has it: if not, it refuses and says what, before a file."""

from __future__ import annotations

import hashlib
import importlib
import socket
from typing import Any

import numpy as np

from flurries import __version__
from flurries._kept import kept
from flurries._threads import scope
from flurries.io.colorspace import config_hash
from flurries.io.oiio import openimageio
from flurries.scene import fingerprint
from flurries.spectral import field


def terms_of(plain: bool) -> tuple[tuple[str, str], ...]:
    """Return what the bits of files depend on, beside what travels with a task, in a mode."""
    with scope(threads=None, reproducible=plain):
        wave = field((64, 64), drift=(1.3, 0.7), seed=1).tobytes()
    return (
        ("flurries", f"{__version__} (bits {fingerprint.BITS})"),
        ("NumPy", np.__version__),
        ("OpenImageIO", openimageio().VERSION_STRING),
        ("vector instructions", hashlib.sha256(wave).hexdigest()[:8]),
        ("$OCIO", config_hash()[:8]),
    )


def agreed(
    terms: tuple[tuple[str, str], ...], plain: bool, packed: bytes, task: Any, *arguments: Any
) -> Any:
    """Do a task with what is packed, if this process meets the client's terms."""
    return task(_unpacked(terms, plain, packed), *arguments)


@kept(4)
def _unpacked(terms: tuple[tuple[str, str], ...], plain: bool, packed: bytes) -> Any:
    own = dict(terms_of(plain))
    wrong = [f"{name} {own[name]} and not {said}" for name, said in terms if own[name] != said]
    if wrong:
        raise RuntimeError(
            f"a worker on {socket.gethostname()} has {' and '.join(wrong)}, so its frames would "
            "differ; it needs the same software, and for vector instructions reproducible=True"
        )
    loads: Any = importlib.import_module("distributed.protocol.pickle").loads
    # Unpacked once a run: what a store knows of its folders grows old.
    return loads(packed)[1]
