"""Files that another library's writer fills through a pipe, so that what goes wrong is told by us.

Where a disk is full, libpng prints words of its own to the terminal and gives no reason. So it
never meets a full disk: it writes into a pipe, from which a thread carries its bytes into the file.
"""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_BLOCK = 1 << 20

# A child that another thread forks holds the pipe open: then it is empty, but does not end.
_PAUSE = 0.05


@contextmanager
def carried(file: Path) -> Iterator[str]:
    """Yield a name to write to from the first byte to the last; the bytes go into a file.

    Raises
    ------
    OSError
        At the end, if the file could not be written.
    """
    if not sys.platform.startswith("linux"):
        yield str(file)
        return
    source, sink = os.pipe()
    written, failed = threading.Event(), []

    def blocks() -> Iterator[bytes]:
        while True:
            # Asked before: what comes between the two questions is not lost.
            over = written.is_set()
            if select.select([source], [], [], _PAUSE)[0]:
                block = os.read(source, _BLOCK)
                if not block:
                    return
                yield block
            elif over:
                return

    def carry() -> None:
        try:
            with file.open("wb") as output:
                output.writelines(blocks())
        except OSError as error:
            failed.append(error)
            # Whoever writes must come to the end.
            for _ in blocks():
                pass

    thread = threading.Thread(target=carry, daemon=True)
    thread.start()
    try:
        yield f"/proc/self/fd/{sink}"
    finally:
        written.set()
        os.close(sink)
        thread.join()
        os.close(source)
    if failed:
        raise failed[0]
