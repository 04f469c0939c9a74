"""Where something stands in a scene file: errors name its line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flurries._contract import suggestion


class SceneText:
    """The text of a scene file. Places in it are given by the keys that lead there from the top."""

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self._lines = _key_lines(text)

    def where(self, *keys: str | int) -> str:
        """Return the file, and the line of the last of the keys that has one."""
        for end in range(len(keys), 0, -1):
            line = self._lines.get(keys[:end])
            if line is not None:
                return f"{self.path}, line {line}"
        return str(self.path)

    def table(
        self, value: Any, known: tuple[str, ...], name: str, *keys: str | int
    ) -> dict[str, Any]:
        """Return a copy of a table whose keys are all known, or refuse it."""
        if not isinstance(value, dict):
            raise TypeError(f"{self.where(*keys)}: {keys[0]} must be a table")
        for key in value:
            if key not in known:
                hint = suggestion(key, known) or f"; known are {', '.join(known)}"
                place = self.where(*keys, key)
                raise ValueError(f"{place}: unknown key {key[:60]!r} in {name}{hint}")
        return dict(value)

    @contextmanager
    def errors(self, known: Iterable[str], *keys: str | int) -> Iterator[None]:
        """Give an argument's error the line of the argument that its message names."""
        try:
            yield
        except (ValueError, TypeError) as error:
            text = str(error)
            if text.startswith(str(self.path)) or type(error) not in (ValueError, TypeError):
                raise
            named = [key for key in known if re.search(rf"\b{re.escape(key)}\b", text)]
            # The first word that is a key of this table: messages begin with the argument's name.
            named.sort(key=text.find)
            raise type(error)(f"{self.where(*keys, *named[:1])}: {text}") from None


_HEADER = re.compile(r"\s*\[(\[)?([^\]]+)\]")
_KEY = re.compile(r"\s*(?:\"([^\"]*)\"|'([^']*)'|([A-Za-z0-9_-]+))\s*(?=[=.])")


def _key_lines(text: str) -> dict[tuple[str | int, ...], int]:
    """Return the lines of keys and tables of a scene file by their way from the top."""
    lines: dict[tuple[str | int, ...], int] = {}
    table: tuple[str | int, ...] = ()
    counts: dict[str, int] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            name = header[2].strip().strip("\"'")
            table = (name,)
            if header[1]:
                counts[name] = counts.get(name, -1) + 1
                table = (name, counts[name])
            lines.setdefault((name,), number)
            lines[table] = number
        elif key := _KEY.match(line):
            lines.setdefault((*table, key[1] or key[2] or key[3]), number)
    return lines


# The parser's time and memory grow with the square of a key's parts.
MOST_DOTS = 32

# A string to its end, or to that of its line or the file; a comment; the rest of a key; a dot.
_TOKEN = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*(?:""")?|\'\'\'(?:[^\']|\'(?!\'\'))*(?:\'\'\')?'
    r'|"(?:[^"\\\n]|\\.)*"?|\'[^\'\n]*\'?|(#[^\n]*)|[A-Za-z0-9_+ \t-]+|(\.)|([^.])',
    re.DOTALL,
)


def require_short_keys(file: Path, text: str) -> None:
    """Refuse keys of very many parts before they are parsed."""
    dots = 0
    for token in _TOKEN.finditer(text):
        comment, dot, other = token.groups()
        if dot:
            dots += 1
        elif comment or other:
            dots = 0
        if dots > MOST_DOTS:
            line = text.count("\n", 0, token.start()) + 1
            raise ValueError(
                f"{file}, line {line}: a key has at most {MOST_DOTS} dots, got {dots} or more"
            )
