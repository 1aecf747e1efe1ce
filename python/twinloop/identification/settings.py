"""Options of the identification; each is one idea that can be switched off."""

from __future__ import annotations

from dataclasses import dataclass, replace

from twinloop._experiment.limits import DIVERGENCE_FACTOR
from twinloop.identification.terms.libraries import LIBRARIES
from twinloop.law import forms as law_forms
from twinloop.signals import Signals

FORMS = ("auto", *law_forms.FORMS)
LEAST_MOVES = 100
"""Of a walk; a shorter one hardly leaves its start."""


@dataclass(frozen=True)
class IdentificationOptions:
    """Options of the identification.

    Args:
        form: meaning of a program's outputs, "acceleration" (derivatives of the driven states, integrated finely),
            "explicit-euler" or "semi-implicit-euler" (derivatives, in one step of Euler a period, in which a state
            is advanced by its derivative at the start or at the end), "increment" (change over a period) or "absolute"
            (the next state); "auto": derivatives, unless a step describes the readings more briefly: one of Euler where
            they show that a state with a declared derivative takes one, increments where none is declared. With fixed
            or bounded terms, whose constants are meant for one of the two, derivatives are not compared with
            increments: derivatives if any are declared, else increments.
        libraries: sources of terms, any of "linear", "quadratic", "damping", "roots", "attitude", "friction",
            "trigonometric", "quotients", "cubic"; none: evolved programs only.
        seed_terms: formulas of states and commands that may be in the law, such as "rate * abs(rate)"; they are on
            the first rung of the ladder.
        fixed_terms: known terms of the law, such as "rate: -9.81 * sin(angle)": a driven state, and a formula with
            its constants, which stay as they are.
        bounded_terms: bounds on constants, such as "rate: sin(angle) in -20 .. -5": the coefficient of a term in the
            equation of a state is between two numbers, either of which may be left out; bounds that exclude 0 mean
            that the term is in the law.
        most_readings: largest number of readings that a twin is learnt from, with all states at one time counted
            once; if there are more, flights are left out, old ones that the twin predicted well, and of long logs
            without a test the liveliest parts are learnt.
        operators: that evolved programs may use.
        generations: of evolved features; 0: none.
        restarts: of the evolution.
        population: features that are judged at once.
        longest: description length of an evolved expression at most, nats.
        directions: whether directions of alike commands, read off the best model so far, are terms, also in squares
            and times states.
        mixer: whether the axes of the controller's mixer are such directions from the beginning, also in squares.
        moves: of a walk over subsets of terms.
        starts: number of walks for each output.
        largest: number of terms of an output.
        most_terms: largest number of terms of a rung; a library that would exceed it is left out.
        noise_from_above: whether the noise is also searched from its largest value, so that the strongest terms come
            first, and not only from the residuals of all terms.
        gusts: whether disturbances may be correlated, as gusts are, and not only white.
        price_disturbances: whether correlated disturbances that explain less than they cost are dropped in the end.
        moderation: whether terms have a price for being much larger than the total drive of a state, as terms
            that nearly cancel are.
        undisturbed: whether terms are also searched as if there were no disturbance, if one was estimated.
        implicit: whether quotients with a denominator of their own are searched, and equations of joints that share
            masses.
        contacts: whether terms that begin at a place are searched, such as the force of a stop or of a gear with
            backlash, or the limit of how fast a servo turns.
        exponentials: whether terms that grow by a factor are searched, such as a reaction with its temperature.
        friction: whether dry friction is searched.
        lags: whether lags and delays of the actuators are searched.
        ramps: whether actuators may move at a limited rate.
        delays: whether, once terms are known, periods of a delay take the place of a part of a lag, or the other way
            about.
        at_once: whether a lag that is tuned to nearly 0, or a limit of a rate that nothing meets, is dropped.
        apart: whether commands of the same unit and bounds may have different lags.
        longest_delay: of an actuator, periods, that is tried in any case; longer ones are tried if a lag may have
            replaced them.
        hidden: whether a hidden state is searched that commands drive and that decays, such as a climb or heat.
        storage: whether hidden states are searched that measured states drive, such as the twist of a joint, or that
            swing while commands drive them, such as a servo.
        offsets: whether sensors may be late or early against those of the driven states, and these late
            against one another.
        reports: whether sensors may be slow, and declared derivatives computed of readings.
        cleaning: whether single wrong readings are ignored before anything is learnt.
        outliers: whether readings far from the predictions of a tuned model are ignored.
        tuning: whether constants are tuned on predictions.
        tuning_steps: largest number of steps of the tuning.
        pruning: whether terms are dropped whose tuned constants are too uncertain.
        support: whether terms are dropped that share too few readings with others.
        passes: number of selections of terms; from the second on with states that the model has smoothed.
        committee_size: models that judge tests, the best included.
        parts: whether, as long as there is one run, models of its parts are members too.
        anew: whether laws are searched with each flight; otherwise the constants of the one that was learnt first are
            tuned again.
        steady: whether a law found anew must be ahead of the one known before, tuned on all flights, by a margin
            for each term that it has more.
        lasts: whether of laws that the readings hardly tell apart the one is believed that lasts under most controllers
            drawn from the box of gains.
        earlier_twin: whether the earlier twin, as it was or tuned on all flights, is kept if it explains all flights
            and the new one does not, or follows them far better.
        inside: whether flights that left their envelope for good are learnt as far as they were inside, where no law
            explains all of them.
        tame: whether the law known before, tuned on all flights, is kept if the new one diverges under more controllers
            drawn from the box of gains and follows the flights hardly better.
        rough: whether a linear law is learnt beside one that does not explain the flights.
        causes: whether slow disturbances are separated into external ones and model errors; otherwise
            all count as external.
        exactness: whether a disturbance within the inaccuracy of the law may be a model error.
        divergence_factor: multiple of a state's scale beyond which a run counts as diverged.
    """

    form: str = "auto"
    libraries: tuple[str, ...] = LIBRARIES
    seed_terms: tuple[str, ...] = ()
    fixed_terms: tuple[str, ...] = ()
    bounded_terms: tuple[str, ...] = ()
    most_readings: int = 12_000
    operators: tuple[str, ...] = ("+", "-", "*", "/", "abs", "sqrt", "sin", "cos", "min", "max")
    generations: int = 6
    restarts: int = 1
    population: int = 120
    longest: float = 20.0
    directions: bool = True
    mixer: bool = True
    moves: int = 50_000
    starts: int = 4
    largest: int = 16
    most_terms: int = 450
    noise_from_above: bool = True
    gusts: bool = True
    price_disturbances: bool = True
    moderation: bool = True
    undisturbed: bool = True
    implicit: bool = True
    contacts: bool = True
    exponentials: bool = True
    friction: bool = True
    lags: bool = True
    ramps: bool = True
    delays: bool = True
    at_once: bool = True
    apart: bool = True
    longest_delay: int = 2
    hidden: bool = True
    storage: bool = True
    offsets: bool = True
    reports: bool = True
    cleaning: bool = True
    outliers: bool = True
    tuning: bool = True
    tuning_steps: int = 20
    pruning: bool = True
    support: bool = True
    passes: int = 2
    committee_size: int = 8
    parts: bool = True
    anew: bool = True
    steady: bool = True
    lasts: bool = True
    earlier_twin: bool = True
    inside: bool = True
    tame: bool = True
    rough: bool = True
    causes: bool = True
    exactness: bool = True
    divergence_factor: float = DIVERGENCE_FACTOR

    def form_for(self, signals: Signals) -> str:
        """What formulas of a user are taken for where the form is "auto": it is not searched under them."""
        if self.form != "auto":
            return self.form
        return "acceleration" if len(signals.driven) < signals.n_x else "increment"

    @property
    def plain(self) -> IdentificationOptions:
        """The same for a law with linear terms only; itself where such a one is not wanted, or cannot be."""
        if not self.rough or "linear" not in self.libraries:
            return self
        return replace(
            self,
            libraries=("linear",),
            generations=0,
            implicit=False,
            contacts=False,
            exponentials=False,
            friction=False,
            hidden=False,
            storage=False,
            parts=False,
            directions=False,
            mixer=False,
        )

    @property
    def as_known(self) -> IdentificationOptions:
        """The same for the law that was known before: its constants are tuned, and nothing is searched."""
        return replace(self, anew=False)

    def brief(self) -> IdentificationOptions:
        """The same for a short look: a fourth of the moves, and terms of libraries only, where there are any."""
        generations = 0 if self.libraries else self.generations
        return replace(self, generations=generations, moves=max(LEAST_MOVES, self.moves // 4))
