"""A process of its own for libraries that do not survive what they are given."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import traceback
import weakref
from contextlib import suppress
from multiprocessing.spawn import get_executable
from pathlib import Path
from typing import Any, ClassVar

_SPARE = 2  # Processes that wait for another film, at most: to start one takes .3 s.

_SERVE = "import sys; sys.path[:] = sys.argv[1:]; import flurries.io.films.process as p; p.serve()"


class Remote:
    """An object in another process; its methods are called by their names, one after the other."""

    def __init__(self, path: Path, verb: str, kind: type, *arguments: Any) -> None:
        self._what = f"{path}: the {getattr(kind, 'NOUN', 'video')} cannot be {verb}"
        self._process = _Process.take()
        self.close = weakref.finalize(self, self._process.release)
        self._post("", kind, Path.cwd(), *arguments)

    @property
    def ended(self) -> bool:
        return not self.close.alive or self._process.owner != os.getpid()

    def call(self, method: str, *arguments: Any) -> Any:
        """Return what a method returns, or raise what it raises there."""
        self._post(method, *arguments)
        return self._answers()

    def begin(self, method: str, *arguments: Any) -> None:
        """Call a method and go on; what it raises, the next call raises."""
        self._answers()
        self._post(method, *arguments)

    def _answers(self) -> Any:
        result: Any = None
        answers = [self._transfer(_receive) for _ in range(self._process.unanswered)]
        self._process.unanswered = 0
        for failed, result in answers:
            if failed:
                raise result
        return result

    def _post(self, *message: Any) -> None:
        self._process.unanswered += 1
        self._transfer(_send, message)

    def _transfer(self, how: Any, *message: Any) -> Any:
        """Send or receive; half a message would not be understood, nor what follows it."""
        process = self._process
        try:
            return how(process.stdin if message else process.stdout, *message)
        except (BrokenPipeError, EOFError):
            code = process.wait()
            self.close()
            end = signal.Signals(-code).name if code < 0 else f"code {code}"
            raise OSError(f"{self._what}: its library ended by {end}") from None
        except BaseException:
            self.close()
            raise


class _Process(subprocess.Popen[bytes]):
    """A child that serves one object at a time."""

    spare: ClassVar[list[_Process]] = []

    def __init__(self) -> None:
        self.owner, self.unanswered = os.getpid(), 0
        # In a session of its own: Ctrl-C is the parent's, who says what becomes of the film.
        super().__init__(
            [get_executable(), "-c", _SERVE, *map(str, sys.path)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
        )  # fmt: skip

    @classmethod
    def take(cls) -> _Process:
        while cls.spare:
            one = cls.spare.pop()
            if one.owner == os.getpid() and one.poll() is None:
                return one
            one.end()
        return cls()

    def release(self) -> None:
        """Let the object go, and keep the process for another if it is at rest."""
        if not self.unanswered and len(self.spare) < _SPARE and self.owner == os.getpid():
            with suppress(OSError):
                _send(self.stdin, ("", None))
                self.spare.append(self)
                return
        self.end()

    def end(self) -> None:
        if self.owner != os.getpid():
            self.returncode = 0  # The copy of a fork: the process is the parent's.
        self.kill()
        for stream in (self.stdin, self.stdout):
            stream.raw.close()  # type: ignore[union-attr]
        self.wait()


def serve() -> None:
    """Do what is asked for on stdin until it is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    source, sink = (os.fdopen(os.dup(n), mode) for n, mode in ((0, "rb"), (1, "wb")))
    # Libraries tell the terminal of damage, which is told by the parent.
    nowhere = os.open(os.devnull, os.O_RDWR)
    for standard in range(3):
        os.dup2(nowhere, standard)
    thing: Any = None
    with suppress(EOFError, BrokenPipeError):
        while True:
            method, *arguments = _receive(source)
            if not method:
                thing, kind = None, arguments[0]
                if kind is None:
                    continue
            answer: tuple[bool, Any] = False, None
            try:
                if method:
                    answer = False, getattr(thing, method)(*arguments)
                else:
                    # Paths are the parent's, who may have moved since this began.
                    os.chdir(arguments[1])
                    thing = kind(*arguments[2:])
            except Exception as error:
                own = type(error).__module__ == "builtins"
                # Some errors cannot say what they are.
                said = traceback.format_exception_only(error)[-1].strip()
                answer = True, error if own else RuntimeError(said)
            _send(sink, answer)


def _send(stream: Any, message: Any) -> None:
    pickle.dump(message, stream, 5)
    stream.flush()


def _receive(stream: Any) -> Any:
    try:
        return pickle.load(stream)
    except pickle.UnpicklingError:
        raise EOFError from None  # Half a message.
