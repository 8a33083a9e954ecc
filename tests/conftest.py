"""
Shapes are checked here and free in production.

Every function and dataclass of the numeric rooms that names array shapes is checked by beartype
while the tests run; the import hook must stand before their first import.
"""

from __future__ import annotations

from jaxtyping import install_import_hook

# An int serves where a float is asked for, as Python's own numeric tower has it.
CHECKER = "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))"

install_import_hook(["app.numerics", "app.evaluation"], CHECKER)

pytest_plugins = ["tests.databases"]  # loaded after the hook stands
