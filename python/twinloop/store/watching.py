"""What is to be seen of a campaign without reading it: whether anything has changed, and what its writer is doing."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timezone

from twinloop.store.columns import moment_in, progress_in
from twinloop.store.database import Store


@dataclass(frozen=True)
class Doing:
    """What the writer of a campaign has said last that it does.

    Args:
        phase: of its work, as in `Progress`.
        generation: or step of the phase.
        generations: or steps that it has.
        told: number of experiments so far.
        experiments: that there will be.
        left: remaining seconds; None as long as they are unknown.
        silent: seconds since then, by the clocks of both; a writer that was killed stays silent for good.
    """

    phase: str
    generation: int
    generations: int
    told: int
    experiments: int
    left: float | None
    silent: float


def state(store: Store, name: str) -> str:
    """A text that is another one whenever anything of a campaign was kept since; it reads no record.

    That somebody has opened the campaign to write changes nothing of it.

    Args:
        store: open.
        name: of the campaign.
    """
    from sqlalchemy import func, select

    from twinloop.store.schema import ENTRIES, approvals, campaigns, checkpoints

    of_this = select(campaigns.c.id).where(campaigns.c.name == name).scalar_subquery()
    counts = [
        select(func.count()).select_from(table).where(table.c.campaign == of_this).scalar_subquery()
        for table in (*ENTRIES.values(), approvals)
    ]
    budget = select(campaigns.c.experiments).where(campaigns.c.name == name).scalar_subquery()
    saved = select(checkpoints.c.saved).where(checkpoints.c.campaign == of_this).scalar_subquery()
    with store.transaction() as connection:
        return " ".join(str(value) for value in connection.execute(select(*counts, budget, saved)).one())


def doing(store: Store, name: str) -> Doing | None:
    """What the writer of a campaign is doing, in whatever process.

    Args:
        store: open.
        name: of the campaign.

    Returns:
        None where nobody works on it.

    Raises:
        InvalidInput: a row that is not what was written.
    """
    from sqlalchemy import select

    from twinloop.store.schema import campaigns, progress

    wanted = select(progress.c.said, progress.c.record).join(campaigns).where(campaigns.c.name == name)
    with store.transaction() as connection:
        row = connection.execute(wanted).one_or_none()
    if row is None:
        return None
    what = f"Store {store.name}, campaign {name}"
    said = datetime.fromisoformat(moment_in("progress.said", row.said, what))
    silent = (datetime.now(timezone.utc) - said).total_seconds()
    return Doing(**progress_in("progress.record", row.record, what), silent=max(0.0, silent))
