"""USD's own library, which need not be there."""

from __future__ import annotations

from typing import Any


def require_usd() -> tuple[Any, Any, Any, Any, Any]:
    """Return usd-core's modules Gf, Sdf, Usd, UsdGeom and Vt."""
    try:
        from pxr import Gf, Sdf, Usd, UsdGeom, Vt
    except ImportError:
        raise ImportError(
            "USD files need usd-core: pip install 'flurries[usd]'", name="pxr"
        ) from None
    return Gf, Sdf, Usd, UsdGeom, Vt
