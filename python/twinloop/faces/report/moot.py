"""What of a report would mislead: numbers of a twin that does not follow, or of loops that are not stable."""

from __future__ import annotations

from collections.abc import Mapping

from twinloop.campaign.examination.examination import Examination

LINEAR = ("margins", "closed-poles", "sliding-closed-poles", "nyquist", "sensitivities", "closed")
"""Tables and figures of the loops around the target."""
FLOWN_ON_TWIN = ("effort", "envelope", "gains", "coverage")
"""Those that rest on the planned flight alone: the step is shown, with what was flown."""


def moot(found: Examination) -> Mapping[str, str]:
    """Names of tables and figures that say nothing, each with the reason, in place of which they stand.

    Args:
        found: an examination.
    """
    if not found.twin.follows:
        reason = "Not shown: the twin does not follow the flights that it was learnt from."
        return dict.fromkeys((*LINEAR, *FLOWN_ON_TWIN, "bode", "poles", "sliding-poles"), reason)
    reasons: dict[str, str] = {}
    if found.best is not None and found.planned is not None and found.planned.steps < found.best.steps:
        after = found.planned.t[-1] - found.planned.t[0]
        reasons |= dict.fromkeys(
            FLOWN_ON_TWIN, f"Not shown: on the twin the flight diverges after {after:.3g} s."
        )
    if found.margins is not None and not all(loop.stable for loop in found.margins.nominal):
        # The poles say how unstable.
        loops = [name for name in LINEAR if not name.endswith("poles")]
        reasons |= dict.fromkeys(loops, "Not shown: around the target the loops are unstable on the twin.")
    return reasons
