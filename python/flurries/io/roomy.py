"""A file for another library's writer that has room to the end, so that we say what goes wrong.

Where a disk is full, libpng prints words of its own to the terminal and gives no reason. So where
there may be too little room it writes to memory first, and its bytes go to the disk from there.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# Others write to the same disk meanwhile: room for several such files must be there.
_OTHERS = 8
_SPARE = 1 << 26


@contextmanager
def roomy(file: Path, most: int) -> Iterator[str]:
    """Yield a name to write at most so many bytes to, which are then in a file; 0 for no matter."""
    if not (most and sys.platform.startswith("linux")) or _has_room(file, most):
        yield str(file)
        return
    memory = os.memfd_create("flurries")
    try:
        # Opened by its name, as any file, and gone with its descriptor.
        yield f"/proc/self/fd/{memory}"
        with Path(f"/proc/self/fd/{memory}").open("rb") as source, file.open("wb") as target:
            shutil.copyfileobj(source, target, 1 << 20)
    finally:
        os.close(memory)


def _has_room(file: Path, most: int) -> bool:
    return _OTHERS * most + _SPARE <= shutil.disk_usage(file.parent).free
