"""What is made once and kept by its key: without a lock, which a fork could leave closed."""

from collections import OrderedDict
from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any, ParamSpec, TypeVar

from flurries import _core

_P = ParamSpec("_P")
_Made = TypeVar("_Made")

# What is kept, by the name of the function that made it, or of the module.
ALL: dict[str, Any] = {}


class Kept:
    """Results by their keys, the last `most`; `trim` keeps `most_bytes` of those that have such."""

    def __init__(self, most: int = 1 << 30, most_bytes: int = 0) -> None:
        self._made: OrderedDict[Any, Any] = OrderedDict()
        self._most, self._most_bytes = most, most_bytes

    def once(self, key: Any, make: Callable[[], _Made]) -> _Made:
        """Return the object made for a key, now or before; it is shared, and so read-only."""
        # Out and in again: the order is that of use.
        found = self._made.pop(key, None)
        if found is None:
            found = make()
        self._made[key] = found
        while len(self._made) > self._most:
            self._made.popitem(last=False)
        made: _Made = found
        return made

    def each(self, keys: list[Any], make: Callable[[list[Any]], list[_Made]]) -> list[_Made]:
        """Return the objects made for keys; those that are not there yet are made together."""
        missing = [key for key in keys if key not in self._made]
        made = dict(zip(missing, make(missing) if missing else [], strict=True))
        return [self.once(key, lambda key=key: made[key]) for key in keys]  # type: ignore[misc]

    @property
    def bytes(self) -> int:
        """What is kept now."""
        return sum(one.bytes for one in list(self._made.values()))

    def trim(self, used: int = 1) -> None:
        """Drop what has not been asked for longest, but for the last so many."""
        size = self.bytes
        while size > self._most_bytes and len(self._made) > used:
            size -= self._made.popitem(last=False)[1].bytes

    def clear(self) -> None:
        self._made.clear()


def kept(
    most: int, *, by_mode: bool = False
) -> Callable[[Callable[_P, _Made]], Callable[_P, _Made]]:
    """Keep the last results of a function; `by_mode` if it calls kernels."""

    def keeping(make: Callable[_P, _Made]) -> Callable[_P, _Made]:
        name = f"{make.__module__}.{make.__qualname__}"
        if not by_mode:
            plain: Any = lru_cache(maxsize=most)(make)
            ALL[name] = plain
            return plain  # type: ignore[no-any-return]

        @lru_cache(maxsize=most)
        def kept_one(_: bool, *args: _P.args, **kwargs: _P.kwargs) -> _Made:
            return make(*args, **kwargs)

        @wraps(make)
        def found(*args: _P.args, **kwargs: _P.kwargs) -> _Made:
            return kept_one(_core.reproducible(), *args, **kwargs)  # type: ignore[arg-type]

        ALL[name] = kept_one
        return found

    return keeping
