"""A twin from logs alone: nobody asks for a flight, and no controller is tuned."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from twinloop.campaign.campaign import Campaign
from twinloop.campaign.data.copies import copied
from twinloop.campaign.examination.unseen import TwinBefore, Unseen, unseen_flights
from twinloop.campaign.history import Progress, called
from twinloop.controllers import StateFeedback
from twinloop.errors import InvalidInput
from twinloop.law.twin import Twin
from twinloop.remarks import Remark, serious
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory, equal_runs


def identify(
    runs: Sequence[Trajectory],
    signals: Signals,
    *,
    seed: int = 0,
    options: Mapping[str, object] | None = None,
    threads: int | None = None,
    progress: Callable[[Progress], None] | bool | None = True,
) -> Twin:
    """Learns a twin from recorded runs of any length, under any commands.

    A campaign of the preset `default` learns the same from attached runs.

    Args:
        runs: at least one, at the signals' period; SI units, radians.
        signals: of the system.
        seed: of all random numbers; equal seeds give equal bits.
        options: other values for some of the preset's options, by name.
        threads: number of threads of the engine, by default all; no result depends on it.
        progress: as in `Campaign`.

    Returns:
        The twin, with its errors on each run, its committee and its remarks.

    Raises:
        InvalidInput: no runs, or a run that cannot be learnt.
    """
    return learnt_from_logs(runs, signals, seed=seed, options=options, threads=threads, progress=progress)[0]


def learnt_from_logs(
    runs: Sequence[Trajectory],
    signals: Signals,
    held_out: Sequence[Trajectory] = (),
    *,
    logs: Sequence[str] = (),
    seed: int = 0,
    options: Mapping[str, object] | None = None,
    threads: int | None = None,
    progress: Callable[[Progress], None] | bool | None = True,
) -> tuple[Twin, Campaign]:
    """The twin of `identify`, and the campaign behind it to be examined; what that says of a controller means nothing.

    A run that was held out and that the twin does not predict is a serious remark on it.

    Args:
        runs: at least one, at the signals' period; SI units, radians.
        signals: of the system.
        held_out: runs that are not learnt, to judge the twin on.
        logs: what each run is called, those that are held out behind the others; empty: by their numbers.
        seed: of all random numbers; equal seeds give equal bits.
        options: other values for some of the preset's options, by name.
        threads: how many the engine may use, by default all that there are.
        progress: as in `Campaign`.

    Raises:
        InvalidInput: no runs, a run that cannot be learnt, or one that is both learnt and held out.
    """
    found, apart = _listed(runs), _listed(held_out)
    if not found:
        raise _no_runs("an empty list; pass what is to be learnt")
    if any(equal_runs(run, other) for run in apart for other in found):
        raise InvalidInput(
            "identify: expected runs to hold out that are not learnt, found one that is, equal to the last digit; leave"
            " it out of one of the two."
        )
    if any(copied(run, other, signals) for run in apart for other in found):
        raise InvalidInput(
            "identify: expected runs to hold out that are not learnt, found a copy of one that is: their readings"
            " differ by far less than their noise, which no two flights share; leave it out of one of the two."
        )
    names = list(logs) or [""] * (len(found) + len(apart))
    if len(names) != len(found) + len(apart):
        raise InvalidInput(
            f"identify, logs: expected as many names as runs, {len(found) + len(apart)}, found {len(names)}; name"
            " those that are held out behind the others, or none."
        )
    # A campaign has a task and a controller; neither is used here, so both are what any system has.
    rest = [0.0 if state.envelope is None else sum(state.envelope) / 2.0 for state in signals.states]
    campaign = Campaign(
        signals,
        controller=StateFeedback(None, (-1.0, 1.0)),
        initial_state=rest,
        target_state=rest,
        duration=max(run.steps for run in found) * signals.dt,
        seed=seed,
        options=options,
        threads=threads,
        progress=progress,
    )
    for run, name in zip(found, names, strict=False):
        campaign.attach(run, name)
    twin = campaign.twin
    for run, name in zip(apart, names[len(found) :], strict=True):
        campaign.attach(run, name)
    campaign.interrupted = True  # what was learnt so far is enough
    unseen = unseen_flights(campaign.experiments, [TwinBefore(len(found), twin)], campaign.setup)
    return twin.remarked(_not_predicted(unseen, called(campaign.experiments))), campaign


def _not_predicted(unseen: Sequence[Unseen], names: Sequence[str]) -> list[Remark]:
    """A remark on each run that was held out and that the twin does not predict.

    Args:
        unseen: the runs that were held out.
        names: of all runs.
    """
    return [
        serious(
            "held-out",
            f"The twin does not predict {names[run.place]}, which was held out: {run.error_words} (0 is perfect, 1 a"
            " model that never moves). What it has learnt may hold for its own logs alone.",
        )
        for run in unseen
        if not run.predicted_well
    ]


def _listed(runs: object) -> list[Trajectory]:
    """Runs as a list, once they are."""
    if isinstance(runs, Trajectory):
        raise _no_runs("one without a list around it; write [run]")
    if not isinstance(runs, Iterable):
        raise _no_runs(f"{type(runs).__name__}; load the logs first")
    listed = list(runs)
    for each in listed:
        if not isinstance(each, Trajectory):
            raise _no_runs(f"{type(each).__name__} in it; load the logs first")
    return listed


def _no_runs(found: str) -> InvalidInput:
    return InvalidInput(
        f"identify: expected a list of at least one Trajectory, such as twinloop.load gives, found {found}."
    )
