"""One thing that is checked, with its number and its limit; and all of them together."""

from __future__ import annotations

from dataclasses import dataclass

from twinloop.errors import unknown

SUBJECTS = ("twin", "controller")


@dataclass(frozen=True)
class Check:
    """One check of the twin or the controller.

    Args:
        name: of the check, a fixed word or two, such as "unseen-flight".
        subject: "twin" or "controller".
        value: the measured value; None if it could not be measured.
        limit: for the value.
        passed: whether the check passes; without a value it does not.
        binding: whether a result that fails must not be used; otherwise a failure is a warning.
        sentence: the same for a person, with its numbers.
    """

    name: str
    subject: str
    value: float | None
    limit: float | None
    passed: bool
    binding: bool
    sentence: str

    def __post_init__(self) -> None:
        if self.subject not in SUBJECTS:
            raise unknown("subject of a check", self.subject, SUBJECTS)

    @property
    def verdict(self) -> str:
        """Passed, failed, or look: a failure that is not binding."""
        return "passed" if self.passed else "failed" if self.binding else "look"

    def __str__(self) -> str:
        return self.sentence


class Checks(tuple[Check, ...]):
    """All checks of a campaign; printable."""

    @property
    def twin_passed(self) -> bool:
        """Whether no binding check of the twin fails."""
        return not any(check.binding and not check.passed for check in self if check.subject == "twin")

    @property
    def passed(self) -> bool:
        """Whether no binding check fails; otherwise there is no certificate."""
        return not self.failed

    @property
    def failed(self) -> tuple[Check, ...]:
        """Binding checks that fail."""
        return tuple(check for check in self if check.binding and not check.passed)

    def __str__(self) -> str:
        """A line a check."""
        width = max((len(check.name) for check in self), default=0)
        return "\n".join(f"{check.verdict:>6}  {check.name:<{width}}  {check.sentence}" for check in self)
