"""What becomes of a file that is written a little otherwise."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

from app.formats.account import WrongFile
from app.formats.options import Options

from . import samples
from .conftest import Read, read_text

READ = "read"  # a fifth sample, nothing dropped
SAME = "same"  # the four samples, nothing dropped


def check(text: str | bytes, expected: str) -> Read | None:
    """The plain reader and the fast one say what is expected; what the fast one read."""
    _check(text, expected, Options())
    return _check(text, expected, Options(fast=True))


def _check(text: str | bytes, expected: str, options: Options) -> Read | None:
    """
    Read a file of four samples, to which a fifth record may have been added.

    Expected is `READ`, `SAME`, a reason for which the fifth is dropped, or ``refused: `` and a
    pattern of the complaint.
    """
    if expected.startswith("refused: "):
        with pytest.raises(WrongFile) as refused:
            read_text(text, options)
        assert re.search(expected.removeprefix("refused: "), str(refused.value)), refused.value
        return None
    found = read_text(text, options)
    assert found.account.samples == (5 if expected == READ else 4), found.account
    assert len(found.drives) == 1
    trace = found.drives[0].trace
    assert trace.recorded_at is not None
    assert trace.recorded_at.timestamp() == samples.START_S
    np.testing.assert_allclose(trace.lon, samples.LON)
    np.testing.assert_allclose(trace.lat[:4], [samples.place(i)[1] for i in range(4)])
    if expected in {READ, SAME}:
        assert not found.account.dropped
    else:
        assert found.account.dropped == {expected: 1}
    return found


def cases(of: Callable[..., str], *told: tuple[dict[str, object], str]) -> list[object]:
    """A case a change of the fifth record."""
    return [
        pytest.param(of(**change), expected, id=f"{of.__name__} {change}"[:70])
        for change, expected in told
    ]
