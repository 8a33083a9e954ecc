"""Collecting what is wrong with an input: many faults in one answer, but never thousands."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from app.errors import Fault, InvalidInput

MAX_FAULTS = 20  # enough to see the pattern; a broken matrix has a fault in every number
MAX_SHOWN_CHARACTERS = 60

# pydantic names the branch of a union in the location; a pointer must not.
UNION_BRANCHES = {"float", "list[float]", "constrained-float", "constrained-list"}


class Faults:
    """The faults of one input so far: the first `MAX_FAULTS` kept, all counted."""

    def __init__(self) -> None:
        self.kept: list[Fault] = []
        self.count = 0

    def add(self, pointer: str, detail: str) -> None:
        """One more thing wrong at a JSON pointer."""
        self.count += 1
        if len(self.kept) < MAX_FAULTS:
            self.kept.append(Fault(pointer, detail))

    def add_many(self, faults: Iterable[Fault], count: int) -> None:
        """``count`` things wrong, of which only as many are spelled out as still fit."""
        self.count += count
        room = MAX_FAULTS - len(self.kept)
        self.kept.extend(fault for fault, _ in zip(faults, range(room), strict=False))

    def error(self) -> InvalidInput:
        """All of it as one error; what was left out is counted at the end."""
        left_out = self.count - len(self.kept)
        more = [Fault("", f"and {left_out} more faults")] if left_out else []
        return InvalidInput([*self.kept, *more])

    def raise_if_any(self) -> None:
        """
        Ends the collecting.

        Raises:
            InvalidInput: Something was added.
        """
        if self.count:
            raise self.error()


def pointer_of(location: Sequence[int | str]) -> str:
    """RFC 6901 pointer of a pydantic location."""
    steps = (str(step) for step in location if step not in UNION_BRANCHES)
    return "".join("/" + step.replace("~", "~0").replace("/", "~1") for step in steps)


def shown(value: object) -> str:
    """A value as an error shows it: short, and never a whole list."""
    if isinstance(value, Mapping):
        return "an object"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    text = repr(value)
    return text if len(text) <= MAX_SHOWN_CHARACTERS else text[:MAX_SHOWN_CHARACTERS] + "..."


def _detail(error: ErrorDetails) -> str:
    name = error["loc"][-1] if error["loc"] else ""
    if error["type"] == "extra_forbidden":
        return f"unknown field {shown(name)}"
    if error["type"] == "missing" and not error["loc"]:
        return "a JSON body is missing"
    if error["type"] == "missing":
        return f"the field {shown(name)} is missing"
    if error["type"] == "json_invalid":
        return error["msg"]
    return f"{error['msg']}, got {shown(error['input'])}"


def invalid_input(error: ValidationError, prefix: str = "") -> InvalidInput:
    """Pydantic's errors as ours, one a pointer, pointers under ``prefix``."""
    return faults_of(error.errors(include_url=False, include_context=False), prefix).error()


def faults_of(errors: Iterable[Any], prefix: str = "") -> Faults:
    """Faults of pydantic's error dictionaries; a union reports only its first complaint."""
    faults, seen = Faults(), set[str]()
    for error in errors:
        pointer = prefix + pointer_of(error["loc"])
        if not pointer or pointer not in seen:
            seen.add(pointer)
            faults.add(pointer, _detail(error))
    return faults
