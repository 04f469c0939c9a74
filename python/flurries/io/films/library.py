"""The library that reads and writes films, which is an extra: pictures do without it."""

from __future__ import annotations


def require_library() -> None:
    """Refuse to go on without PyAV."""
    try:
        import av  # noqa: F401
    except ImportError as error:
        raise ImportError(
            "films need PyAV, which flurries' extra [video] brings: pip install 'flurries[video]', "
            f"or pip install av ({error})"
        ) from None
