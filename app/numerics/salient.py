"""The salience masks of a road in memory: they explain an answer, and match nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from app.domain import FEATURE_KINDS, RoadModel


@dataclass(frozen=True, slots=True, eq=False)
class Salient:
    """
    Which features tell a road, and each of its sub-segments, from the others.

    Attributes:
        masks: The road's, then each sub-segment's, see `app.domain.Salience`.
        reference: Column of the cell that mean differences are from.
    """

    masks: Bool[np.ndarray, "scales kinds cells"]
    reference: int

    @classmethod
    def of(cls, model: RoadModel) -> Salient:
        """A model's; its reference is the cell whose mean difference from it is nothing."""
        masks = [model.salience.mask, *(segment.salience.mask for segment in model.segments)]
        difference_db = model.features[FEATURE_KINDS.index("mean_difference")]
        known_db = np.nan_to_num(np.abs(difference_db), nan=np.inf)
        return cls(np.stack(masks), int(known_db.argmin()))

    @property
    def road(self) -> Bool[np.ndarray, "kinds cells"]:
        """The road's mask."""
        return np.asarray(self.masks[0])

    def segment(self, index: int) -> Bool[np.ndarray, "kinds cells"]:
        """A sub-segment's mask."""
        return np.asarray(self.masks[index + 1])
