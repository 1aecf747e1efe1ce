"""Identification: from recorded runs to a model of readable equations and a committee of plausible ones.

The steps, each of them an option: what outputs mean is decided; the noise is estimated; terms are selected up a ladder
of libraries, then evolved; offsets of sensors, lags and delays of the actuators are searched by description length;
constants are tuned on predictions; the whole is repeated on states that the model has smoothed.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.identification.fit.committee import committee
from twinloop.identification.fit.fitting import Fitting, Tuned, described
from twinloop.identification.fit.parts import parts
from twinloop.identification.forms import candidates, likeliest
from twinloop.identification.identified import Identified
from twinloop.identification.inputs.hidden import PRICE, enter_directions, filled, search_hidden
from twinloop.identification.inputs.lags import search_actuators
from twinloop.identification.records import Run, stages
from twinloop.identification.remarks import held_at_bounds, late_sensors, other_noise, remarks
from twinloop.identification.search.description import shorter, shortest
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.selection import Selection
from twinloop.identification.search.structure import Sum, total
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import exact, kinematic_noise
from twinloop.identification.sensors.offsets import moved, search_offsets
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.terms.directions import directions
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import Actuation
from twinloop.signals import Signals
from twinloop.streams import Unit

LAGS_AGAIN = 4
"""Runs up to which lags, delays and offsets are searched anew; from then on lags are only tuned and the others kept."""
ROUNDING = 2.0**-50
"""Share of a reading that rounding takes of it in a step or two: no model follows it more closely."""
SEATS = 4
"""Of so many members one is of a part of the only run."""
WHOLE = 0
"""Number of the unit of work that searches whole runs; those of parts follow."""
FORMS = 100
"""Number of the unit of work that tries the first form; those of others follow."""


def identify_runs(
    runs: Sequence[Run],
    signals: Signals,
    options: IdentificationOptions,
    *,
    rests: Sequence[Floats] = (),
    seed: int = 0,
    iteration: int = 0,
    known: Identified | None = None,
    workers: _core.Workers,
    watch: Callable[[str], None] = lambda step: None,
) -> Identified:
    """Learns a model and a committee.

    Args:
        runs: at least one.
        signals: of the system.
        options: of the identification.
        rests: commands whose effect may be there at the start of a run (n_u,).
        seed: of the campaign.
        iteration: of the campaign, which tells its random numbers from those of others.
        known: what was learnt from fewer runs; its terms are candidates again.
        workers: how the work is carried out.
        watch: called with the name of each step.

    Returns:
        What was learnt.
    """
    runs = [run.continued(signals) for run in runs]
    unit = Unit(seed, (iteration,))
    forms = candidates(options, signals, runs)
    if known is not None and len(runs) > LAGS_AGAIN and known.model.form in forms:
        forms = (known.model.form,)

    def length(form: str) -> float:
        place = FORMS + forms.index(form)
        brief = replace(options.brief(), form=form)
        pool = Pool(signals.n_x + signals.n_u, len(options.operators))
        selection = Selection(runs, signals, brief, pool, None, unit.part(place), workers)
        direct = stages(runs, signals, Actuation.direct(signals))
        problem = Problem(pool, runs, direct, signals.dt, workers, selection.told, as_integrated=True)
        return total(selection.undisturbed(problem, selection.alone(problem)))

    if len(forms) > 1:
        watch("form")
    form, said = likeliest(forms, length)
    learner = _Learner(
        runs, signals, replace(options, form=form), rests, seed, iteration, known, workers, watch
    )
    found = learner.learn()
    return replace(found, remarks=[*said, *found.remarks])


class _Learner:
    """One identification; its steps share the runs, the pool and the noise."""

    def __init__(
        self,
        runs: Sequence[Run],
        signals: Signals,
        options: IdentificationOptions,
        rests: Sequence[Floats],
        seed: int,
        iteration: int,
        known: Identified | None,
        workers: _core.Workers,
        watch: Callable[[str], None],
    ) -> None:
        self.signals = signals
        self.options = options
        self.rests = list(rests)
        self.unit = Unit(seed, (iteration,))
        self._looks = 0
        self.watch = watch
        self.known = known if known is not None and known.model.form == options.form else None
        if self.known is None:
            self.pool = Pool(signals.n_x + signals.n_u, len(options.operators))
        else:
            # A copy: what an interrupted attempt has entered must not change the next one.
            self.pool = copy.deepcopy(self.known.pool)
        self.selection = Selection(
            runs, signals, options, self.pool, self.known, self.unit.part(WHOLE), workers, watch
        )
        self.fitting = Fitting(runs, self.pool, signals, options, self.unit, workers, self.selection.told)

    def learn(self) -> Identified:
        self.watch("noise")
        offsets = self._offsets()
        runs = moved(self.fitting.runs, self.signals, offsets)
        given = [kinematic_noise(chain, runs, self.signals) for chain in self.selection.given]
        self.selection.given = given
        tuned = self._best(runs)
        others: list[_core.Model] = []
        if self.options.parts and len(self.fitting.runs) == 1:
            self.watch("parts")
            tuned, others = self._of_parts(tuned)
        problem = self._problem(self.fitting.actuation(tuned.model))
        model, sums, left, readings = tuned.model, tuned.sums, tuned.left, tuned.readings
        observer = self._rescaled(tuned.observer, left, readings)
        self.watch("committee")
        members = committee(problem, self.fitting, sums, observer, model, others)
        if offsets.any():
            # What flies them from here on is read as the runs were.
            members = [member.with_offsets(offsets.tolist()) for member in members]
            model = members[0]
        runs, driven = self.fitting.runs, [chain.states[0] for chain in self.selection.driven]
        bounds = self.selection.told.bounds
        return Identified(
            model=model,
            members=members,
            pool=self.pool,
            sums=sums,
            chains=observer,
            actuation=self.fitting.actuation(model),
            offsets=offsets,
            left=left,
            readings=readings,
            ignored=int(sum((run.weights == 0.0).sum() for run in runs)),
            energy=total(sums),
            of_parts=bool(others),
            remarks=[
                *remarks(runs, self.pool, self.signals, sums, left, readings),
                *late_sensors(offsets, driven, self.signals),
                *other_noise(tuned.observer, self.signals),
                *held_at_bounds(sums, bounds, self.pool, self.signals, self.fitting.form),
            ],
        )

    # Steps

    def _best(self, runs: Sequence[Run]) -> Tuned:
        """The shorter description of runs: found anew, or from what was known of fewer of them."""
        ways = [self._anew]
        if self.known is not None and self.known.actuation.hidden:
            # What is hidden shows when terms are nearly right, and these when it shows.
            ways.append(self._renewed)
        plain, found = self.selection.ladder, []
        for way in ways:
            self.fitting.runs, self.selection.ladder = list(runs), plain
            tuned = self._smoothed(way())
            found.append((described(tuned), tuned, self.fitting.runs, self.selection.ladder))
        _, tuned, self.fitting.runs, self.selection.ladder = shortest(found, lambda answer: answer[0])
        return tuned

    def _anew(self) -> Tuned:
        """Lags, hidden states, noise and terms are searched."""
        start = self.selection.ladder[0]
        nothing: list[Sum | None] = [None] * len(self.selection.driven)
        actuation, known = Actuation.direct(self.signals), nothing
        again = self.known is None or len(self.fitting.runs) <= LAGS_AGAIN
        if self.known is not None:
            actuation = self.known.actuation.bare()
            known = [self._without_hidden(found) for found in self.known.sums]
        shortest, above = self.selection.from_both_sides(self._problem(actuation), start, known)
        if self.options.lags and again:
            self.watch("actuators")
            before = actuation
            actuation, shortest = self._actuators(start, [found.chain for found in shortest])
            if actuation != before:
                # The noise was that of other actuators, and a disturbance may still stand in for terms.
                shortest, above = self.selection.from_both_sides(self._problem(actuation), start, shortest)
        if self._may_hide():
            self.watch("hidden")
            found, sums = self._hidden(actuation, shortest, shortest)
            if found.hidden:
                actuation = found
                shortest, above = self.selection.from_both_sides(
                    self._problem(actuation), self.selection.ladder[0], sums
                )
        return self._lasting(actuation, shortest, above)

    def _renewed(self) -> Tuned:
        """What was known, tuned on all runs."""
        assert self.known is not None
        self.selection.admit_hidden()
        sums = [replace(found, others=[]) for found in self.known.sums]
        return self.fitting.tuned(sums, self.selection.given, self.known.actuation)

    def _lasting(self, actuation: Actuation, shortest: list[Sum], above: list[Sum]) -> Tuned:
        """A tuned model of all rungs that lasts on its own runs, if there is one."""
        self.watch("terms")
        problem = self._problem(actuation)
        tuned = self.fitting.tuned(self.selection.climb(problem, shortest), self.selection.given, actuation)
        if not np.isfinite(tuned.left):
            # A short description that runs away is none: the one from above is more modest.
            other = self.fitting.tuned(self.selection.climb(problem, above), self.selection.given, actuation)
            tuned = other if np.isfinite(other.left) else tuned
        return tuned

    def _smoothed(self, tuned: Tuned) -> Tuned:
        """Terms are selected again on states that the model has smoothed, as long as they are described the shorter."""
        best, runs = tuned, self.fitting.runs
        for number in itertools.count(1):
            hidden = self.fitting.actuation(tuned.model).hidden
            if number >= self.options.passes * (2 if hidden else 1):
                break
            if not self.fitting.smooth(tuned.model, tuned.observer):
                break
            self.watch("smoothed")
            actuation = self.fitting.actuation(tuned.model)
            again = self.selection.climb(self._problem(actuation), tuned.sums, brief=True)
            if number == 1 and self._may_hide():
                actuation, again = self._hidden(actuation, tuned.sums, again)
            tuned = self.fitting.tuned(again, self.selection.given, actuation)
            # Descriptions of raw states and of smoothed ones do not compare.
            if (number == 1 and np.isfinite(tuned.left)) or shorter(described(tuned), described(best)):
                best, runs = tuned, self.fitting.runs
            if not np.isfinite(tuned.left):
                break
        self.fitting.runs = runs
        return best

    def _without_hidden(self, found: Sum) -> Sum | None:
        weights = {node: w for node, w in found.weights.items() if not self.pool.is_hidden(node)}
        return None if found.weights and not weights else replace(found, weights=weights, others=[])

    def _problem(self, actuation: Actuation) -> Problem:
        return self._problem_of(self.fitting.runs, actuation)

    def _problem_of(self, runs: Sequence[Run], actuation: Actuation) -> Problem:
        selection, inputs = self.selection, stages(runs, self.signals, actuation)
        return Problem(self.pool, runs, inputs, self.signals.dt, selection.workers, selection.told)

    def _offsets(self) -> Floats:
        """By how much later than those of the driven states each state's readings were taken from it (n_x,), s."""
        if not self.options.offsets:
            return np.zeros(self.signals.n_x)
        if self.known is not None and len(self.fitting.runs) > LAGS_AGAIN:
            return self.known.offsets
        every = [*self.selection.driven, *self.selection.given]
        return search_offsets(
            self.fitting.runs, self.signals, every, self.selection.scales, self.selection.workers
        )

    def _may_hide(self) -> bool:
        """Whether a hidden state is looked for: in one run it is a function of time, and that may be anything."""
        return self.options.hidden and len(self.fitting.runs) > 1

    def _hidden(
        self, actuation: Actuation, start: Sequence[Sum], plain: Sequence[Sum]
    ) -> tuple[Actuation, list[Sum]]:
        """With the best hidden state where that makes the description shorter, else as it was.

        Args:
            actuation: so far.
            start: sums to begin with. Those that were found without the state stand in for it already.
            plain: the best sums behind the actuation as it is.

        Returns:
            The actuation, and the sums behind it.
        """
        # Where nothing is hidden, what follows goes on as if nobody had looked: nodes are taken back.
        entered = len(self.pool)
        enter_directions(self.pool, directions(self._problem(actuation), start, self.signals))
        driven = [found.chain for found in start]
        own = [term for found in start for term in found.weights]
        few, many = ([*filled(self.pool), *terms] for terms in (own, self.selection.ladder[0]))
        self._looks += 1
        unit, tried = self.unit.part(self._looks), itertools.count(1)
        moves, starts = self.options.moves, max(1, self.options.starts // 2)

        def judge(behind: Actuation) -> list[Sum]:
            return self.selection.search(
                self._problem(behind), few, start, driven, moves // 10, 1,
                unit=unit.part(next(tried)), purpose="hidden_subsets",
            )  # fmt: skip

        before = actuation.hidden or (() if self.known is None else self.known.actuation.hidden)
        longest = self.signals.dt * max(len(run.commands) for run in self.fitting.runs)
        rests: Sequence[Floats | None] = self.rests or [None]
        found, sums = search_hidden(self.signals, actuation, before, rests, longest, judge)
        # Which one shows on the terms that there are; whether there is one, when all may change.
        best = self.selection.search(
            self._problem(found), many, sums, driven, moves, starts,
            unit=unit.part(0), purpose="hidden_subsets",
        )  # fmt: skip
        price = 0.0 if actuation.hidden else PRICE
        if not shorter(total(best) + price, total(plain)):
            self.pool.forget(entered)
            return actuation, list(plain)
        self.selection.admit_hidden()
        return found, best

    def _of_parts(self, tuned: Tuned) -> tuple[Tuned, list[_core.Model]]:
        """The shortest description of the only run that itself or its parts have led to, and what parts have led to."""
        actuation = self.fitting.actuation(tuned.model)
        whole, runs, found = self._problem(actuation), self.fitting.runs, []
        for number, (run, begun) in enumerate(parts(runs[0], self.signals, actuation), WHOLE + 1):
            part = self.selection.of_part(run, self.unit.part(number))
            own = part.alone(self._problem_of([run], begun))
            driven, terms = [sum_.chain for sum_ in own], [term for sum_ in own for term in sum_.weights]
            sums = self.selection.search(whole, terms, own, driven, part.options.moves // 4, 1)
            # What one of them takes for outliers is none for the others.
            self.fitting.runs = runs
            answer = self.fitting.tuned(sums, self.selection.given, actuation)
            if np.isfinite(answer.left):
                found.append(answer)
        of_each = zip(tuned.sums, *(answer.sums for answer in found), strict=True)
        best = [shortest(sums, lambda found: found.energy) for sums in of_each]
        self.fitting.runs = runs
        if best != tuned.sums:
            mixed = self.fitting.tuned(best, self.selection.given, actuation)
            if shorter(described(mixed), described(tuned)):
                tuned = mixed
            else:
                self.fitting.runs = runs
        return tuned, [answer.model for answer in found[: self.options.committee_size // SEATS]]

    def _actuators(self, terms: Sequence[int], driven: Sequence[Chain]) -> tuple[Actuation, list[Sum]]:
        def judge(actuation: Actuation) -> list[Sum]:
            problem = self._problem(actuation)
            return self.selection.search(
                problem, terms, [None] * len(driven), driven, self.options.moves // 4, 1
            )

        return search_actuators(self.signals, [None, *self.rests], judge, self.options.longest_delay)

    def _rescaled(self, observer: Sequence[Chain], left: float, readings: int) -> list[Chain]:
        """Noise that explains what is left on average, so that members are as uncertain as the runs say."""
        misfit = left / max(1, readings) if np.isfinite(left) else 1.0
        factor = misfit if exact(misfit) else max(misfit, 1.0)
        sizes = np.max([np.abs(run.states).max(axis=0) for run in self.fitting.runs], axis=0)
        scaled = []
        for chain in observer:
            least = np.square(ROUNDING * sizes[list(chain.states)])
            sensors = np.where(least > 0.0, np.maximum(chain.sensors * factor, least), chain.sensors)
            motion = (chain.motion[0] * factor, chain.motion[1] * factor, chain.motion[2])
            scaled.append(chain.with_noise(sensors, motion))
        return scaled
