"""One thing that is checked, with its number and its limit; and all of them together."""

from __future__ import annotations

from dataclasses import dataclass

from twinloop.errors import unknown

SUBJECTS = ("twin", "controller")


@dataclass(frozen=True)
class Check:
    """One thing that was checked.

    Args:
        name: of the check, in a word or two that do not change, such as "unseen-flight".
        subject: "twin" or "controller": what does not hold where it fails.
        value: what was found; None where it could not be.
        limit: what it is compared with.
        passed: whether it holds; what could not be found does not.
        binding: whether a result that fails it is not to be used; otherwise it is worth a look.
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
        """Passed, failed, or, where it does not bind, look."""
        return "passed" if self.passed else "failed" if self.binding else "look"

    def __str__(self) -> str:
        return self.sentence


class Checks(tuple[Check, ...]):
    """All checks of a campaign; printable."""

    @property
    def twin_passed(self) -> bool:
        """Whether the twin holds: no check of it that binds fails."""
        return not any(check.binding and not check.passed for check in self if check.subject == "twin")

    @property
    def passed(self) -> bool:
        """Whether twin and controller hold: without that there is no certificate."""
        return not self.failed

    @property
    def failed(self) -> tuple[Check, ...]:
        """Those that bind and fail."""
        return tuple(check for check in self if check.binding and not check.passed)

    def __str__(self) -> str:
        """A line a check."""
        width = max((len(check.name) for check in self), default=0)
        return "\n".join(f"{check.verdict:>6}  {check.name:<{width}}  {check.sentence}" for check in self)
