"""
Shapes are checked here and free in production.

Every function and dataclass of the numeric rooms that names array shapes is checked by beartype while
the tests run; the import hook must stand before the first import of those rooms.
"""

from __future__ import annotations

from jaxtyping import install_import_hook

install_import_hook(["app.numerics", "app.evaluation"], "beartype.beartype")
