"""A campaign file that names a system: `twinloop run rig.toml`, and `resume` of what it left."""

from __future__ import annotations

from pathlib import Path

from twinloop.campaign import Campaign
from twinloop.campaign.campaign_file import CampaignFile, read_file
from twinloop.errors import InvalidInput
from twinloop.faces.console import Watch
from twinloop.faces.first_test import first_test
from twinloop.faces.working import Answers, check_experiments, work
from twinloop.store import is_address


def run_file(
    file: CampaignFile,
    store: str | Path,
    name: str,
    experiments: int,
    threads: int | None,
    answers: Answers,
    timeout: float | None = None,
    max_risk: float | None = None,
) -> int:
    """Flies the system of a campaign file.

    Args:
        file: that names it.
        store: where the campaign is kept; what is there goes on.
        name: of the campaign in its store.
        experiments: runs in all.
        threads: of the engine; None: all.
        answers: where the result goes.
        timeout: seconds that a run may take; None: what the file says.
        max_risk: probability of leaving the envelope above which a test is not flown; None: any.

    Returns:
        The exit code.

    Raises:
        InvalidInput: a file, a system or a number that cannot be used.
        NotAvailable: the file names no system, or a package is missing.
    """
    check_experiments(experiments)
    answers.check()
    rig = file.system()
    assert file.flies is not None  # there would be no system
    campaign = file.campaign(store=store, name=name, threads=threads)
    watch = Watch(campaign.options, experiments, file.flies.use)
    campaign.progress = watch
    try:
        _first(campaign, file)
    except InvalidInput:
        campaign.close()
        raise
    seconds = file.flies.timeout if timeout is None else timeout
    return work(campaign, rig, watch, experiments, answers, file.flies.use, seconds, max_risk)


def _first(campaign: Campaign, file: CampaignFile) -> None:
    """Makes the first test of a file's gains: before there is any test, and where none that was made is to be flown."""
    gone = all(campaign.status(test) in ("failed", "abandoned") for test in campaign.tests)
    if campaign.tests and (campaign.experiments or not gone):
        return
    first_test(campaign, file)


def file_beside(store: str) -> Path | None:
    """The place of the campaign file beside a store, whether one is there or not; None beside a server.

    Args:
        store: a file, or the address of a server.
    """
    return None if is_address(store) else Path(store).with_suffix(".toml")


def beside(store: str) -> CampaignFile | None:
    """The campaign file beside a store, if there is one that names a system.

    Args:
        store: a file, or the address of a server.
    """
    path = file_beside(store)
    if path is None or not path.is_file():
        return None
    file = read_file(path)
    return None if file.flies is None else file
