"""What a picture says about how it was made: small strings under ``flurries:`` in its header.

EXR and PNG hold any named string. TIFF and JPEG hold one description, which takes all of them as
JSON. Radiance HDR holds none.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any

from flurries._contract import mapping

PREFIX = "flurries:"

# OpenImageIO stamps the present moment into every header, and then no two runs make the same
# bytes. A moment that never changes says as much as a clock that nobody asked about.
FIXED_MOMENT = "2000:01:01 00:00:00"

_KEY = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,59}")
_MOMENT = re.compile(r"[0-9]{4}:[0-9]{2}:[0-9]{2} [0-9]{2}:[0-9]{2}:[0-9]{2}")


def checked(metadata: Mapping[str, object] | None) -> dict[str, str]:
    """Return the metadata as strings, keys without the prefix, ``DateTime`` always among them."""
    strings = {"DateTime": FIXED_MOMENT}
    for given, value in mapping("metadata", {} if metadata is None else metadata).items():
        if not isinstance(given, str):
            raise TypeError(f"metadata keys must be strings, got {given!r}")
        key = given.removeprefix(PREFIX)
        if not _KEY.fullmatch(key):
            raise ValueError(
                f"metadata key {given!r} must be at most 60 letters, digits, '_', '.' or '-'"
            )
        text = _text(key, value)
        if "\0" in text:
            raise ValueError(f"metadata {key!r} must not hold a NUL byte")
        if key == "DateTime" and not _MOMENT.fullmatch(text):
            raise ValueError(f"metadata 'DateTime' must read YYYY:MM:DD HH:MM:SS, got {text!r}")
        strings[key] = text
    return strings


def _text(key: str, value: object) -> str:
    if isinstance(value, str):
        return value
    # NumPy's numbers are among these; their own repr names the type too.
    if isinstance(value, Integral):
        return str(value)
    if isinstance(value, Real):
        return repr(float(value))
    raise TypeError(f"metadata {key!r} must be a string or a number, got {value!r}")


def description(strings: Mapping[str, str]) -> str:
    """Return checked metadata as the one text of formats that hold no more; empty if none."""
    own = {PREFIX + key: text for key, text in strings.items() if key != "DateTime"}
    return json.dumps(own, sort_keys=True) if own else ""


def put_strings(specification: Any, strings: Mapping[str, str], format_name: str) -> None:
    specification.attribute("DateTime", strings["DateTime"])
    specification.attribute("Software", "flurries")
    if format_name in ("openexr", "png"):
        # Numbers travel as strings too: OpenImageIO would round integers to 32 bits and floats to
        # single precision.
        for key, text in strings.items():
            if key != "DateTime":
                specification.attribute(PREFIX + key, text)
    elif text := description(strings):
        specification.attribute("ImageDescription", text)
