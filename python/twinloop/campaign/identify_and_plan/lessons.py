"""Lessons: the record of an identification, with what speaks against its data or its twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.data.begun import from_other_starts
from twinloop.campaign.data.gains import from_other_gains
from twinloop.campaign.data.levels import levels_said
from twinloop.campaign.data.odd_one_out import Odd
from twinloop.campaign.data.rows import from_late_commands, in_other_rows
from twinloop.campaign.data.sent import change_that_rights, other_commands
from twinloop.campaign.history import Experiment, Lesson
from twinloop.campaign.identify_and_plan.answer import Answer
from twinloop.campaign.identify_and_plan.diagnostics import Findings, diagnostics_of
from twinloop.campaign.identify_and_plan.elsewhere import elsewhere
from twinloop.campaign.identify_and_plan.inside import said_inside
from twinloop.campaign.identify_and_plan.outputs_alone import outputs_alone
from twinloop.campaign.identify_and_plan.selection import Selected, shortened
from twinloop.campaign.identify_and_plan.stand_ins import claimed, stand_ins
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.twin_errors import free_errors


def lesson_of(
    answer: Answer,
    rough: bool,
    book: Logbook,
    flights: Sequence[Experiment],
    selected: Sequence[Selected],
    before: _core.Model | None,
    odd: Odd | None,
    workers: _core.Workers,
) -> Lesson:
    """The record of what was learnt.

    Args:
        answer: what was identified, beside the flights.
        rough: whether it is a law of linear terms beside one that does not explain the flights.
        book: of the campaign.
        flights: of the book, as far as they were learnt, without single readings that are wrong.
        selected: what was learnt from.
        before: the law that was known before the last of the flights; None: none was.
        odd: the log that contradicts the others, though a law made for it explains them; None: none does.
        workers: how the work is carried out.
    """
    identified, signals = answer.identified, book.setup.signals
    free = free_errors(identified.members[0], book, workers, identified.noise(signals))
    pieces = [each.length for each in free]
    found = replace(findings(answer, book, flights, pieces, before, workers), odd=odd)
    explained = answer.follows and not found.misses and not rough
    actuators = claimed(identified.actuation, signals, explained)
    return Lesson(
        iteration=len(book.experiments),
        tests=tuple(run.number for run in book.experiments),
        form=identified.model.form,
        terms=identified.terms,
        misfit=identified.misfit,
        readings=identified.readings,
        ignored=identified.outliers,
        sensors=tuple(identified.sensors(signals.n_x).tolist()),
        lags=tuple(actuator.lag for actuator in actuators),
        delays=tuple(actuator.delay for actuator in actuators),
        rates=tuple(
            actuator.rate(command.size) for actuator, command in zip(actuators, signals.commands, strict=True)
        ),
        hidden=identified.actuation.hidden,
        offsets=tuple(identified.late(signals).tolist()),
        closed_loop=tuple(each.error for each in free),
        normalised=tuple(each.normalised for each in free),
        follows=answer.follows,
        remarks=(
            # What is wrong with a log may be the reason for all others.
            *from_late_commands(found.late),
            *identified.remarks,
            *said_inside(book.experiments, flights, signals.dt),
            *shortened(selected, signals.dt),
            *stand_ins(identified.actuation, signals, explained),
            *outputs_alone(
                identified.actuation, [run.trajectory for run in book.experiments], signals, explained
            ),
            *levels_said(identified.model, signals),
            *from_other_gains(book.experiments),
            *from_other_starts(book.experiments),
            *diagnostics_of(book.experiments, signals, book.setup.steps, found),
        ),
        recurring=found.recurring,
        undecided=tuple(signals.state_names[i] for i, cause in answer.causes.items() if cause == "undecided"),
    )


def _others(answer: Answer, experiments: Sequence[Experiment]) -> list[int]:
    """Numbers of the tests whose recorded commands are none that their controllers give.

    Where the twin follows the flights, a rig may well answer otherwise than its controller, as a relay does. Then only
    those count whose commands are the controller's once a column is put right.
    """
    found = other_commands(experiments)
    if not answer.follows:
        return found
    return [run.number for run in experiments if run.number in found and change_that_rights(run)]


def findings(
    answer: Answer,
    book: Logbook,
    flights: Sequence[Experiment],
    pieces: Sequence[int],
    before: _core.Model | None,
    workers: _core.Workers,
) -> Findings:
    """What an answer is beside the flights that it was learnt from.

    Args:
        answer: to be looked at.
        book: of the campaign.
        flights: of the book, as far as they were learnt, without single readings that are wrong.
        pieces: steps of those in which each experiment is followed.
        before: the law that was known before the last of the flights; None: none was.
        workers: how the work is carried out.
    """
    identified, setup = answer.identified, book.setup
    names = setup.signals.state_names
    lost = [book.experiments[place] for place in answer.lost]
    gusts = () if answer.missed else identified.noise(setup.signals).correlated
    return Findings(
        # Of a model that diverges it is said already.
        follows=answer.follows or not np.isfinite(identified.chi_squared),
        misses=answer.misses(flights, setup, workers),
        others=_others(answer, book.experiments),
        late=in_other_rows(book.experiments),
        recurring=tuple(names[state] for state, cause in answer.causes.items() if cause == "law"),
        unanswered=any(each.serious and each.code == "never-moved" for each in identified.remarks),
        unmoved=[names[state] for state in answer.unmoved],
        without_test=bool(lost) and all(run.test is None for run in lost),
        pieces=pieces,
        disturbed=[names[gust.states[0]] for gust in gusts],
        elsewhere=elsewhere(answer.believed, before, setup, Unit(setup.seed).part(len(flights), 4), workers),
        explained=answer.explained,
    )
