"""Identification: from recorded runs to a model of readable equations and a committee of plausible ones.

It is one search over hypotheses, and a second one where sensors may be late. What outputs mean is decided first.
Sensors are aligned; the noise is estimated from below and from above, and with it first terms. Then hypotheses are
proposed, and evidence decides: lags and delays, a hidden state, terms of all rungs and evolved ones with constants that
are tuned on predictions, the same on states that the model has smoothed, and what parts of the only run have taught.
What the search leaves is the committee.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.steps import Watch, unwatched
from twinloop._ground.streams import Unit
from twinloop.identification.ages import aged
from twinloop.identification.alike import CountLasting, longer_lasting
from twinloop.identification.context import Context
from twinloop.identification.fit.committee import Committee
from twinloop.identification.forms import likeliest
from twinloop.identification.identified import Identified
from twinloop.identification.late import Ages, known_late, late
from twinloop.identification.outliers import cleaned
from twinloop.identification.records import Run
from twinloop.identification.remarks import held_at_bounds, late_sensors, other_noise, remarks
from twinloop.identification.searches import Found, Reading, Searches, explored, likelier
from twinloop.identification.sensors.reported import as_sensed, with_their_noise
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.starts import starts
from twinloop.identification.terms.directions import Direction
from twinloop.law.levels import Levels
from twinloop.law.reports import Held, Reports, late_in, old, unread, with_late
from twinloop.records import Recorded
from twinloop.remarks import Remark
from twinloop.signals import Signals

LATER = 2**30
"""By how much the number of an iteration is more, in the unit of work in which its readings are taken to be older."""


@dataclass(frozen=True, eq=False)
class UnderWay(Recorded, kind="identification"):
    """An identification between two proposals; what is left of it is a function of this and of its context.

    Args:
        runs: as they are read if none is late, without single readings that are wrong.
        form: what outputs mean.
        said: remarks on that.
        searches: one for each start that was made, in their order.
        ages: of readings of slow sensors when they are given (n_x), in periods; none where all are given as they are.
        late: by how many periods others may be late (n_x), once where that is known; the runs are learnt with each and
            then compared. None where none may be late.
    """

    runs: tuple[Run, ...]
    form: str
    said: tuple[Remark, ...]
    searches: Searches = ()
    ages: tuple[int, ...] = ()
    late: tuple[Ages, ...] = ()


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
    logged, reports = (
        [run.continued(signals) for run in runs],
        reports if options.reports else unread(reports, signals),
    )
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
        under_way = first_step(context, logged)
        keep(under_way)
    # An earlier version, which began without, knew no ages.
    reports = old(reports, under_way.ages) if under_way.ages else ()
    in_time = replace(context, runs=under_way.runs, reports=reports).under(under_way.form)
    readings = [read_late(in_time, ages, number) for number, ages in enumerate(under_way.late)] or [in_time]
    several: list[Reading] = []
    for reading in readings:
        before = tuple(found for one in several for found in one.searches)
        own = under_way.searches[len(before) :]

        def kept(found: Sequence[Found], so_far: UnderWay = under_way, before: Searches = before) -> None:
            keep(replace(so_far, searches=(*before, *found)))

        # What was known before is no law of readings of other ages: from these nothing but a search anew begins.
        every = starts(reading, under_way.form)[: 1 if several else None]
        as_known = several[0].searches[0] if several else None
        several.append(Reading(reading, explored(reading, every, own, kept, as_known)))
    best = likelier(several)
    context, found = best.context, best.found
    context.watch("committee")
    if lasting is not None and options.lasts:
        longest = longer_lasting(context, found.best, found.rivals, best.owed, lasting)
        found = found if longest is None else replace(found, best=longest)
    return concluded(context, found, under_way.said)


def first_step(context: Context, logged: Sequence[Run]) -> UnderWay:
    """What an identification begins with: how readings are given, without single ones that are wrong, and the form."""
    context = replace(context, reports=aged(context, logged))
    found, known = late(context, logged), known_late(context)
    context = replace(context, runs=[as_sensed(run, context.reports, context.signals) for run in logged])
    context = cleaned(context) if context.options.cleaning else context
    form, said = likeliest(read_late(context, known))
    ages = tuple(report.age if isinstance(report, Held) else 0 for report in context.reports)
    # What more runs say again is believed; what is new is held against what was known, or against readings in time.
    several = tuple(dict.fromkeys((known, found))) if any((*known, *found)) else ()
    return UnderWay(tuple(context.runs), form, tuple(said), ages=ages, late=several)


def read_late(context: Context, ages: Ages, number: int = 0) -> Context:
    """The same with readings that are late by so many periods (n_x).

    Args:
        context: with runs as if all were read in time.
        ages: of the readings.
        number: of these ages, by which what is drawn under them is told from what is drawn under others.
    """
    iteration, *within = context.unit.path
    return replace(
        context,
        runs=[as_sensed(run, with_late((), ages), context.signals) for run in context.runs],
        reports=with_late(context.reports, ages),
        unit=Unit(context.unit.seed, (iteration + LATER * number, *within)),
    )


def concluded(context: Context, found: Found, said: Sequence[Remark]) -> Identified:
    """What is believed with its committee, and what a person should know of it beside what was said before."""
    best, signals = found.best, context.signals
    fit, sums = best.fit, list(best.sums)
    assert fit is not None  # `terms` and the starts see to it
    seated = Committee(context, best, fit, found.rivals)
    # What parts have entered stays known.
    of_rivals = (rival.pool for rival in found.rivals if rival.of_part)
    pool = max((best.pool, *(pool for pool in of_rivals if pool.extends(best.pool))), key=len)
    # Where a report stands for readings, rows without one are no outliers.
    read = [i for i, report in enumerate(context.reports or (None,) * signals.n_x) if report is None]
    outliers = int(sum((run.weights[:, read] == 0.0).sum() for run in best.runs))
    driven, ages = [chain.states[0] for chain in best.driven], late_in(context.reports, signals.n_x)
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
        outliers=outliers,
        description_length=fit.length,
        of_parts=seated.of_parts,
        remarks=[
            *said,
            *remarks(best.runs, pool, signals, sums, fit.chi_squared, fit.readings, outliers),
            *late_sensors(best.offsets + signals.dt * np.array(ages), driven, signals),
            *other_noise(fit.observer, signals),
            *held_at_bounds(sums, best.candidates.priors.bounds, pool, signals, best.form),
        ],
    )
