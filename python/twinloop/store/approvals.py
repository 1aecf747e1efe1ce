"""What people say of tests that a campaign has asked for: this one may be flown."""

from __future__ import annotations

from datetime import datetime, timezone

from twinloop.store.database import Store


def approve(store: Store, name: str, number: int) -> None:
    """Keeps that a test may be flown; once is enough.

    Args:
        store: open, to be written.
        name: of the campaign, which is there.
        number: of the test, which is there.

    Raises:
        StoreFailure: the database refuses.
    """
    from sqlalchemy import insert, select

    from twinloop.store.schema import approvals, campaigns

    with store.transaction() as connection:
        campaign = connection.execute(select(campaigns.c.id).where(campaigns.c.name == name)).scalar_one()
        of_test = (approvals.c.campaign == campaign) & (approvals.c.number == number)
        if connection.execute(select(approvals.c.number).where(of_test)).first() is None:
            when = datetime.now(timezone.utc).isoformat(timespec="seconds")
            connection.execute(insert(approvals).values(campaign=campaign, number=number, approved=when))


def approved(store: Store, name: str) -> dict[int, str]:
    """When each test was approved, in UTC, by its number.

    Args:
        store: open.
        name: of the campaign.
    """
    from sqlalchemy import select

    from twinloop.store.schema import approvals, campaigns

    with store.transaction() as connection:
        chosen = (
            select(approvals.c.number, approvals.c.approved).join(campaigns).where(campaigns.c.name == name)
        )
        return {number: when for number, when in connection.execute(chosen.order_by(approvals.c.number))}
