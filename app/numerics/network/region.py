"""The neighbourhood that new drives touch: what else has to be looked at, and what stays."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from app.numerics.geodesy import Floats
from app.numerics.network.runs import stretches
from app.numerics.network.steps import Piece

TILE_M = 250.0  # farther from a new drive nothing it says moves a road
Tile = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Region:
    """Square tiles of `TILE_M`."""

    tiles: frozenset[Tile]

    @classmethod
    def about(cls, pieces: Iterable[Piece]) -> Region:
        """The tiles that pieces go through, and those beside them."""
        through = {tile for piece in pieces for tile in _tiles(piece.xy_m)}
        return cls(frozenset(through)).widened()

    def widened(self) -> Region:
        """One tile more on every side."""
        beside = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        return Region(frozenset((x + i, y + j) for x, y in self.tiles for i, j in beside))

    def holds(self, xy_m: Float[np.ndarray, "points 2"]) -> Bool[np.ndarray, " points"]:
        """Which points lie in the region."""
        return np.array([tile in self.tiles for tile in _tiles(xy_m)], dtype=bool)

    def parts_inside(self, pieces: Sequence[Piece]) -> list[Piece]:
        """The stretches of pieces within the region."""
        return [cut_piece(piece, part) for piece in pieces
                for part in stretches(self.holds(piece.xy_m))]  # fmt: skip

    def parts_outside(self, xy_m: Float[np.ndarray, "steps 2"]) -> Iterator[Floats]:
        """The stretches of a line in even steps that leave the region."""
        for part in stretches(~self.holds(xy_m)):
            if part.stop - part.start > 1:
                yield xy_m[part]


def cut_piece(piece: Piece, part: slice) -> Piece:
    """A stretch of a piece."""
    return replace(piece, xy_m=piece.xy_m[part], sample=piece.sample[part])


def _tiles(xy_m: Floats) -> list[Tile]:
    numbers = np.floor(xy_m / TILE_M).astype(int).tolist()
    return [(x, y) for x, y in numbers]
