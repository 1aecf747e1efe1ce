"""Which commands are alike: alike commands share an actuator, and fill hidden states together."""

from __future__ import annotations

from twinloop.signals import Signals


def groups(signals: Signals) -> tuple[tuple[int, ...], ...]:
    """Commands that are alike, by unit and bounds."""
    found: dict[tuple[object, ...], list[int]] = {}
    for i, command in enumerate(signals.commands):
        found.setdefault((command.unit, command.bounds, command.size), []).append(i)
    return tuple(tuple(group) for group in found.values())
