"""The exceptions of this package."""

from __future__ import annotations

from typing import Any

# Names and numbers of Nav2's planner errors.
_NAV2 = {
    "START_OUTSIDE_MAP": 203,
    "GOAL_OUTSIDE_MAP": 204,
    "START_OCCUPIED": 205,
    "GOAL_OCCUPIED": 206,
    "TIMEOUT": 207,
    "NO_VALID_PATH": 208,
}


class SharpError(Exception):
    """Broken input: `code` is a word for programs, as in GOAL_OCCUPIED, the text says what would be right."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        #: Nav2's number for the code, where it has one.
        self.nav2: int | None = _NAV2.get(code)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.code, str(self))


class NoPlanError(SharpError):
    """There is no plan, or none was found in time; the text says why. `report` is what `sharp solve --json` prints."""

    def __init__(self, code: str, message: str, report: dict[str, Any] | None = None) -> None:
        super().__init__(code, message)
        self.report: dict[str, Any] = report or {}

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.code, str(self), self.report)


def make(code: str, message: str) -> SharpError:
    """The exception that the native half raises."""
    return SharpError(code, message)
