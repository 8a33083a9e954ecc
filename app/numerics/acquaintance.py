"""Which tapes know a window's cells: where on a large map it is worth looking for it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from app.numerics.tapes import Tape

NO_TAPE = np.zeros(0, dtype=np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class Acquaintance:
    """
    The tapes that know each cell, and those where it is salient.

    Attributes:
        tapes: How many there are.
    """

    tapes: int
    known: dict[str, Int[np.ndarray, " knowing"]]
    salient: dict[str, Int[np.ndarray, " salient"]]

    @classmethod
    def of_all(cls, tapes: Sequence[Tape]) -> Acquaintance:
        """Of a map's tapes."""
        known = _listed([tape.heard for tape in tapes])
        return cls(len(tapes), known, _listed([tape.salient for tape in tapes]))

    def of(
        self, cells: Sequence[str]
    ) -> tuple[Int[np.ndarray, " tapes"], Int[np.ndarray, " tapes"]]:
        """How many of these cells, all on the map, each tape knows, and are salient there."""
        known = [NO_TAPE, *(self.known[cell] for cell in cells)]
        salient = [NO_TAPE, *(self.salient.get(cell, NO_TAPE) for cell in cells)]
        return (
            np.bincount(np.concatenate(known), minlength=self.tapes),
            np.bincount(np.concatenate(salient), minlength=self.tapes),
        )


def _listed(every: Sequence[Iterable[str]]) -> dict[str, Int[np.ndarray, " tapes"]]:
    found: dict[str, list[int]] = {}
    for number, cells in enumerate(every):
        for cell in cells:
            found.setdefault(cell, []).append(number)
    return {cell: np.array(numbers, dtype=np.intp) for cell, numbers in found.items()}
