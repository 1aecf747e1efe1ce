"""Identification: from recorded runs to a model of readable equations and a committee of plausible ones.

It is one search over hypotheses. What outputs mean is decided first. Sensors are aligned; the noise is estimated from
below and from above, and with it first terms. Then hypotheses are proposed, and evidence decides: lags and delays, a
hidden state, terms of all rungs and evolved ones with constants that are tuned on predictions, the same on states that
the model has smoothed, and what parts of the only run have taught. What the search leaves is the committee.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.steps import Watch, unwatched
from twinloop._ground.streams import Unit
from twinloop.identification.ages import aged
from twinloop.identification.alike import CountLasting, longer_lasting
from twinloop.identification.context import Context
from twinloop.identification.evidence import ANEW, by_evidence
from twinloop.identification.fit.committee import Committee
from twinloop.identification.forms import likeliest
from twinloop.identification.hypothesis import Hypothesis
from twinloop.identification.identified import Identified
from twinloop.identification.outliers import cleaned
from twinloop.identification.proposals.apart import apart
from twinloop.identification.proposals.at_once import at_once
from twinloop.identification.proposals.bare import bare
from twinloop.identification.proposals.contacts import contacts
from twinloop.identification.proposals.friction import friction
from twinloop.identification.proposals.hidden import hidden
from twinloop.identification.proposals.lags import lags
from twinloop.identification.proposals.parts import parts
from twinloop.identification.proposals.second_look import second_look
from twinloop.identification.proposals.storage import storage
from twinloop.identification.proposals.terms import terms
from twinloop.identification.proposals.undisturbed import undisturbed
from twinloop.identification.records import Run
from twinloop.identification.remarks import held_at_bounds, late_sensors, other_noise, remarks
from twinloop.identification.sensors.reported import as_sensed, with_their_noise
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.starts import starts
from twinloop.identification.terms.directions import Direction
from twinloop.law.levels import Levels
from twinloop.law.reports import Held, Reports, old
from twinloop.records import Recorded
from twinloop.remarks import Remark
from twinloop.signals import Signals

Proposal = Callable[[Context, Hypothesis], Iterable[Hypothesis]]
"""Takes a hypothesis and gives changed ones, or none."""
PROPOSALS: tuple[Proposal, ...] = (
    lags, hidden, terms, undisturbed, apart, storage, friction, contacts, second_look, parts, bare, at_once,
)  # fmt: skip
"""In the order in which they are made."""


@dataclass(frozen=True, eq=False)
class Found(Recorded, kind="found"):
    """What a search has found so far.

    Args:
        best: what is believed.
        rivals: what else was proposed on the way and lasts on the runs, in order; from other starts, too.
        made: how many proposals were made.
    """

    best: Hypothesis
    rivals: tuple[Hypothesis, ...] = ()
    made: int = 0


@dataclass(frozen=True, eq=False)
class UnderWay(Recorded, kind="identification"):
    """An identification between two proposals; what is left of it is a function of this and of its context.

    Args:
        runs: as they are read, without single readings that are wrong.
        form: what outputs mean.
        said: remarks on that.
        searches: one for each start that was made, in their order.
        ages: of readings when they are given (n_x), in periods; none where all are given as they are.
    """

    runs: tuple[Run, ...]
    form: str
    said: tuple[Remark, ...]
    searches: tuple[Found, ...] = ()
    ages: tuple[int, ...] = ()


def identify_runs(
    runs: Sequence[Run],
    signals: Signals,
    options: IdentificationOptions,
    *,
    rests: Sequence[Floats] = (),
    axes: Sequence[Direction] = (),
    levels: Levels = (),
    reports: Reports = (),
    seed: int = 0,
    iteration: int = 0,
    earlier: Identified | None = None,
    workers: _core.Workers,
    watch: Watch = unwatched,
    under_way: UnderWay | None = None,
    keep: Callable[[UnderWay], None] = lambda under_way: None,
    lasting: CountLasting | None = None,
) -> Identified:
    """Learns a model and a committee.

    Args:
        runs: at least one.
        signals: of the system.
        options: of the identification.
        rests: commands whose effect may be there at the start of a run (n_u,).
        axes: directions in which the controller moves alike commands.
        levels: in which commands of controllers are sent (n_u,); none where all are sent as they are.
        reports: what is given of readings (n_x,); none where all are given as they are.
        seed: of the campaign.
        iteration: of the campaign, which tells its random numbers from those of others.
        earlier: what was learnt from fewer runs; its terms are candidates again.
        workers: how the work is carried out.
        watch: called with each step that begins.
        under_way: what was kept of the same identification, from where it goes on; None: it begins.
        keep: called with what there is once the form is known, and after each start and each proposal.
        lasting: under how many controllers models last; None where nobody can tell.

    Returns:
        What was learnt, the same bits wherever it went on from.
    """
    logged, reports = [run.continued(signals) for run in runs], reports if options.reports else ()
    context = Context(
        [as_sensed(run, reports, signals) for run in logged],
        signals,
        options,
        Unit(seed, (iteration,)),
        workers,
        rests=rests,
        axes=axes,
        levels=levels,
        reports=reports,
        earlier=earlier,
        watch=watch,
    )
    if under_way is None:
        reports = aged(context, logged)
        context = replace(context, runs=[as_sensed(run, reports, signals) for run in logged])
        context = cleaned(context) if options.cleaning else context
        form, said = likeliest(context)
        ages = tuple(report.age if isinstance(report, Held) else 0 for report in reports)
        under_way = UnderWay(tuple(context.runs), form, tuple(said), ages=ages)
        keep(under_way)
    # An earlier version, which began without, knew no ages.
    reports = old(reports, under_way.ages) if under_way.ages else ()
    context = replace(context, runs=under_way.runs, reports=reports).under(under_way.form)
    searches = list(under_way.searches)
    for number, start in enumerate(starts(context, under_way.form)):
        if number == len(searches):
            context.watch("noise")
            searches.append(Found(start()))
            keep(replace(under_way, searches=tuple(searches)))
        for propose in PROPOSALS[searches[number].made :] if goes_on(context, searches, number) else ():
            searches[number] = decided(searches[number], propose(context, searches[number].best))
            keep(replace(under_way, searches=tuple(searches)))
    first, *others = searches
    known = [found for other in others for found in (other.best, *other.rivals)]

    def owed(one: Hypothesis) -> float:
        anew = options.steady and not any(one is each for each in known)
        return lead(one, known) if anew else 0.0

    found = decided(first, known, ahead=owed(first.best))
    context.watch("committee")
    if lasting is not None and options.lasts:
        longest = longer_lasting(context, found.best, found.rivals, owed, lasting)
        found = found if longest is None else replace(found, best=longest)
    return concluded(context, found, under_way.said)


def goes_on(context: Context, searches: Sequence[Found], number: int) -> bool:
    """Whether proposals are made from a start: not from a law known before that those found anew are ahead of.

    What is hidden they may have missed, so from such a law they are made in any case. None where only what is known is
    tuned.
    """
    if context.earlier is not None and not context.options.anew:
        return False
    own = searches[number].best
    known = own.fit is not None and not own.actuation.hidden
    return not (known and any(other.best.evidence > own.evidence for other in searches[:number]))


def lead(anew: Hypothesis, known: Sequence[Hypothesis]) -> float:
    """What a law that was found anew has to be ahead of the one known before by, in units of χ².

    Args:
        anew: the law.
        known: what was made of the one known before; none where nothing was known.
    """
    if not known:
        return 0.0
    return ANEW * max(0, anew.terms - max(known, key=by_evidence).terms)


def decided(found: Found, proposed: Iterable[Hypothesis], ahead: float = 0.0) -> Found:
    """What is believed after one more proposal, and its rivals: those that last and are not believed.

    Args:
        found: before it.
        proposed: the hypotheses that it gives.
        ahead: what the believed one has to be ahead of all of them by, in units of χ².
    """
    before, several = found.best, [found.best, *proposed]
    best = max(several, key=lambda one: one.evidence.less(ahead) if one is before else one.evidence)
    others = (other for other in several[1:] if other is not best and other.evidence.stable)
    # What is drawn from here on is nothing that one of those that are not believed has drawn.
    drawn = max(other.searches for other in several if other.start == best.start)
    rivals = (*found.rivals, *others)
    return replace(found, best=replace(best, searches=drawn), rivals=rivals, made=found.made + 1)


def concluded(context: Context, found: Found, said: Sequence[Remark]) -> Identified:
    """What is believed with its committee, and what a person should know of it beside what was said before."""
    best, signals = found.best, context.signals
    fit, sums = best.fit, list(best.sums)
    assert fit is not None  # `terms` and the starts see to it
    seated = Committee(context, best, fit, found.rivals)
    # What parts have entered stays known.
    of_rivals = (rival.pool for rival in found.rivals if rival.of_part)
    pool = max((best.pool, *(pool for pool in of_rivals if pool.extends(best.pool))), key=len)
    driven = [chain.states[0] for chain in best.driven]
    return Identified(
        model=seated.members[0],
        members=seated.members,
        pool=pool,
        sums=sums,
        chains=with_their_noise(seated.observer, context.reports),
        actuation=best.actuation,
        offsets=best.offsets,
        chi_squared=fit.chi_squared,
        readings=fit.readings,
        outliers=int(sum((run.weights == 0.0).sum() for run in best.runs)),
        description_length=fit.length,
        of_parts=seated.of_parts,
        remarks=[
            *said,
            *remarks(best.runs, pool, signals, sums, fit.chi_squared, fit.readings),
            *late_sensors(best.offsets, driven, signals),
            *other_noise(fit.observer, signals),
            *held_at_bounds(sums, best.candidates.priors.bounds, pool, signals, best.form),
        ],
    )
