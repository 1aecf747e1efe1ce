"""Taking away: the twin and the controller of a campaign for use elsewhere, checked before they leave."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from twinloop.errors import NotTrusted
from twinloop.law.exports.export import asked, by_force, delivered, exported_controller
from twinloop.law.exports.gymnasium_source import Episode
from twinloop.test import Test

if TYPE_CHECKING:
    from twinloop.campaign.campaign import Campaign


def taken_twin(
    campaign: Campaign, to: str | Path, kind: str | None, precision: str, force: bool
) -> str | tuple[Path, ...]:
    """The twin as `Campaign.export_twin` describes it, with the campaign's task as the episode of an environment."""
    asked(to, kind)  # refused before checks, which take their time
    failed = [] if force else [check for check in campaign.checks().failed if check.subject == "twin"]
    if failed:
        raise NotTrusted(
            f"Export: expected a twin that holds its checks, found: {' '.join(map(str, failed))} Learn from more"
            " tests, or pass --force (force=True in Python)."
        )
    setup = campaign.setup
    episode = Episode(setup.initial_state, setup.final_target, setup.steps, setup.limits)
    return campaign.twin.export(to, kind=kind, precision=precision, force=force, episode=episode)


def taken_controller(
    campaign: Campaign,
    to: str | Path,
    kind: str | None,
    parameters: Mapping[str, float] | ArrayLike | None,
    precision: str,
    force: bool,
) -> str | tuple[Path, ...]:
    """A controller as `Campaign.export_controller` describes it, compared on the flights of the campaign."""
    kind, path = asked(to, kind)
    genes = campaign.best_test.genes if parameters is None else campaign.family.genes(parameters)
    name = "controller" if path is None else path.stem
    flights = [] if force else [run.trajectory for run in campaign.experiments]
    setup = campaign.setup
    texts = exported_controller(
        setup.controller, setup.family, genes, kind, name, precision, flights, setup.target_state
    )
    if parameters is None and not force:
        _refuse_unproven(campaign)
    return delivered(by_force(texts) if force else texts, name, path)


def _refuse_unproven(campaign: Campaign) -> None:
    """Refuses gains of the twin's choice that have neither flown inside the envelope nor would be certified."""
    genes = campaign.best_test.genes.tobytes()
    flown = [run.kept_envelope for run in campaign.experiments if _flies(run.test, genes)]
    failed = any(_flies(failure.test, genes) for failure in campaign.failures)
    if flown and all(flown) and not failed:
        return
    refusals = campaign.certificate().refusals
    if refusals:
        raise NotTrusted(
            "Export: expected a controller that has flown inside the envelope, or would be certified, found:"
            f" {' '.join(refusals)} Learn from more tests, name the gains, or pass --force (force=True in Python)."
        )


def _flies(test: Test | None, genes: bytes) -> bool:
    return test is not None and test.genes.tobytes() == genes
