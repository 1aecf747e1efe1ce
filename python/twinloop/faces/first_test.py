"""The first test of a campaign file: its gains of `[first]`, which must not have failed before."""

from __future__ import annotations

from twinloop.campaign import Campaign
from twinloop.campaign.campaign_file import CampaignFile
from twinloop.errors import InvalidInput, at
from twinloop.faces.answering import next_command
from twinloop.test import Test


def first_test(campaign: Campaign, file: CampaignFile) -> Test:
    """Makes a test of the controller that is trusted, also after an earlier one that failed or was abandoned.

    Args:
        campaign: without a flight of its own tests.
        file: with the gains.

    Raises:
        InvalidInput: gains that the controller has not, or those of a test that failed.
        StoreFailure: the store cannot be written.
    """
    first = file.first_genes(campaign.family)
    with at(f"Campaign file {file.path}, [first]"):
        for failure in campaign.failures:
            if failure.test.genes.tobytes() == first.tobytes():
                back = next_command(campaign, "withdraw", failure.test.number, "--reason", "WHY")
                raise InvalidInput(
                    f"expected gains that have not failed, found those of test {failure.test.number}"
                    f" ({failure.reason}); write those of another controller that you trust, or, if the gains were not"
                    f" the cause, withdraw the failure: {back}."
                )
        return campaign.test(first)
