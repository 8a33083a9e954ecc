"""
What is known beforehand of the odometers that tell windows' distances.

The true distance between samples is a factor f of the nominal one, beforehand evenly likely; an
odometer says o times the nominal one, which is as probable under f as ``o / f`` is of an odometer's
scale. Scales are normal about 1, or a mixture of such: some odometers are exact, others are not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.numerics.odometer_prior import ERR, ERR_FAR, FAR_SD, SCALE_SD

PER_SD = 3  # factors to a standard deviation
REACH_SDS = 3.0


@dataclass(frozen=True, slots=True)
class Odometers:
    """
    A law of odometers' scales.

    Attributes:
        kinds: Standard deviation of each kind's scale about 1, and the kind's share; 0 = exact.
    """

    kinds: tuple[tuple[float, float], ...]

    @classmethod
    def alike(cls, sd: float) -> Odometers:
        """All of one kind."""
        return cls(((sd, 1.0),))

    def factors(
        self, said: Float[np.ndarray, " windows"]
    ) -> Iterator[tuple[float, Float[np.ndarray, " windows"]]]:
        """
        Factors of the nominal distance, with the log density of what each odometer said.

        An exact odometer's factor is the nearest of them, of which there is one every third of the
        least standard deviation; where all are exact there is but 1.

        Args:
            said: The distance that each window's odometer says, over the nominal one.
        """
        sds = [sd for sd, _ in self.kinds if sd > 0.0]
        if not sds:
            yield 1.0, np.zeros(len(said))
            return
        apart = min(sds) / PER_SD
        reach = round(REACH_SDS * max(sds) / apart)
        for factor in (1.0 + apart * np.arange(-reach, reach + 1)).tolist():
            density = np.zeros(len(said))
            for sd, share in self.kinds:
                if sd > 0.0:
                    z = (said / factor - 1.0) / sd
                    density += share * np.exp(-0.5 * z**2) / (sd * np.sqrt(2.0 * np.pi))
                else:
                    density += share / apart * (np.abs(said - factor) <= 0.5 * apart)
            with np.errstate(divide="ignore"):
                yield factor, np.log(density)


ANY = Odometers(((0.0, 1.0 - ERR - ERR_FAR), (SCALE_SD, ERR), (FAR_SD, ERR_FAR)))
"""What `app.numerics` takes odometers to be where a window does not tell."""
