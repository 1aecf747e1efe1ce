"""The one list of ablations: each idea of the preset `default` that can be switched off, and by what options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from twinloop.errors import unknown
from twinloop.identification.terms.libraries import LIBRARIES


@dataclass(frozen=True)
class Ablation:
    """One idea switched off.

    Args:
        without: what is switched off, for a table.
        options: of the preset that do it.
    """

    without: str
    options: Mapping[str, object]

    @property
    def settings(self) -> tuple[str, ...]:
        """The options as they are written on the command line, name=value each."""
        return assignments(self.options)


def assignments(options: Mapping[str, object]) -> tuple[str, ...]:
    """Options as they are written on the command line, name=value each.

    Args:
        options: by name.
    """
    return tuple(f"{name}={_written(value)}" for name, value in options.items())


def _written(value: object) -> str:
    match value:
        case bool():
            return str(value).lower()
        case float():
            return f"{value:g}"
        case tuple():
            return ",".join(map(str, value))
    return str(value)


TEST_KINDS = ("random", "chirp", "prbs")
"""Same learner, other flights: values of the option `tests` beside "ask"."""

ABLATIONS: dict[str, Ablation] = {
    # How a twin is learnt
    "kinematics": Ablation("derivatives and rigid bodies, even if declared", {"form": "increment"}),
    "forms": Ablation("steps of Euler and increments beside derivatives", {"form": "acceleration"}),
    "cleaning": Ablation("single wrong readings ignored before anything is learnt", {"cleaning": False}),
    "outliers": Ablation("readings ignored that are far from their predictions", {"outliers": False}),
    "offsets": Ablation("offsets of late or early sensors", {"offsets": False}),
    "reports": Ablation("slow sensors, and rates computed of readings", {"reports": False}),
    "noise-from-above": Ablation("the search of the noise from above as well", {"noise_from_above": False}),
    "gusts": Ablation("correlated disturbances, such as gusts", {"gusts": False}),
    "disturbance-price": Ablation("a price on correlated disturbances", {"price_disturbances": False}),
    "moderation": Ablation("a price on terms that are large and cancel", {"moderation": False}),
    "undisturbed": Ablation("terms also searched as if there were no disturbance", {"undisturbed": False}),
    "annealing": Ablation(
        "long walks over subsets of terms, and several of them", {"moves": 100, "starts": 1}
    ),
    "libraries": Ablation("libraries: evolved programs only", {"libraries": ()}),
    "ladder": Ablation(
        "the upper rungs of the ladder of libraries", {"libraries": ("linear", "quadratic", "damping")}
    ),
    "attitude": Ablation(
        "thrust, weight and velocity of a rigid body, turned by its pose, as one term each",
        {"libraries": tuple(name for name in LIBRARIES if name != "attitude")},
    ),
    "directions": Ablation("directions of alike commands, as one term", {"directions": False}),
    "mixer": Ablation("axes of the controller's mixer, as one term", {"mixer": False}),
    "evolution": Ablation("evolved terms", {"generations": 0}),
    "implicit": Ablation(
        "quotients with a denominator of their own, joints that share masses", {"implicit": False}
    ),
    "exponentials": Ablation("terms that grow by a factor", {"exponentials": False}),
    "contacts": Ablation("stops, backlash and other terms that begin at a place", {"contacts": False}),
    "friction": Ablation("dry friction", {"friction": False}),
    "lags": Ablation("lags and delays", {"lags": False}),
    "ramps": Ablation("limited rates of actuators", {"ramps": False}),
    "apart": Ablation("separate lags of alike commands", {"apart": False}),
    "delays": Ablation("delays moved once terms are known", {"delays": False}),
    "at-once": Ablation("lags dropped that are tuned to nearly 0", {"at_once": False}),
    "hidden": Ablation("a hidden state that commands drive", {"hidden": False}),
    "storage": Ablation("hidden states that measured states drive", {"storage": False}),
    "tuning": Ablation("constants tuned on predictions", {"tuning": False}),
    "pruning": Ablation("terms dropped whose constants are too uncertain to pay", {"pruning": False}),
    "support": Ablation("terms dropped that share too few readings", {"support": False}),
    "second-pass": Ablation("a second selection on smoothed states", {"passes": 1}),
    "parts": Ablation("models of parts of a single flight", {"parts": False}),
    "committee": Ablation("a committee: the best model only", {"committee_size": 1, "tuning_members": 1}),
    "anew": Ablation("laws searched with each flight, not only with the first", {"anew": False}),
    "steady": Ablation(
        "a lead that a law found anew needs over the one known before for each term more", {"steady": False}
    ),
    "lasts": Ablation(
        "of laws that the readings hardly tell apart, the one that lasts under most controllers",
        {"lasts": False},
    ),
    "earlier-twin": Ablation(
        "the earlier twin kept where the new one explains less", {"earlier_twin": False}
    ),
    "inside": Ablation(
        "flights learnt only as far as they were inside, where no law explains all of them", {"inside": False}
    ),
    "tame": Ablation("the law known before, tuned again, kept where the new one is wilder", {"tame": False}),
    "rough": Ablation("a linear law beside one that does not explain the flights", {"rough": False}),
    "causes": Ablation("disturbances separated from model errors", {"causes": False}),
    "exactness": Ablation("the inaccuracy of a law separated from disturbances", {"exactness": False}),
    # How tests are chosen and gains tuned
    "excitation": Ablation(
        "excitation of the first flight and of all others", {"excitation": 0.0, "excitation_most": 0.0}
    ),
    "hold-back": Ablation("holding an excitation back in flight", {"hold_back": False}),
    **{
        f"{kind}-tests": Ablation(f"a committee that chooses the flights: {what} instead", {"tests": kind})
        for kind, what in zip(TEST_KINDS, ("random gains", "chirps", "binary sequences"), strict=True)
    },
    "worth": Ablation("a limit on the cost of information", {"worth": False}),
    "backtracking": Ablation("candidates on the way to the tuned gains", {"backtracking": False}),
    "within": Ablation("gains tuned under the limits of the next flight", {"within": False}),
    "noise-draws": Ablation("sensor noise while gains are tuned", {"draws": 1}),
    "gusts-draws": Ablation("disturbances that flights met while gains are tuned", {"tuned_in_gusts": False}),
    "members": Ablation("gains tuned on several members", {"tuning_members": 1}),
    "starts": Ablation("several starts of the tuning of gains", {"tuning_starts": 1}),
    "delay-margin": Ablation(
        "more delay, the less of it the more predictions have come true", {"delay_margin": False}
    ),
    "track-record": Ablation(
        "earlier predictions counted where a controller is chosen", {"track_record": False}
    ),
    "alone": Ablation("flown gains compared without their excitation", {"alone": False}),
    "exploit-last": Ablation("a last flight that only exploits", {"exploit_last": False}),
    "margin": Ablation("the margin of the envelope", {"margin": 0.0}),
    "ends": Ablation("flights that keep the envelope if the law ends where flights were", {"ends": False}),
    "seen": Ablation("flights near the states seen until a prediction came true", {"reach_seen": 0.0}),
    "reach": Ablation("flights that stay near those flown before", {"reach_first": 1.0}),
}
"""By name."""


def ablation(name: str) -> Ablation:
    """One idea switched off.

    Args:
        name: of it.

    Raises:
        InvalidInput: an unknown name.
    """
    if name not in ABLATIONS:
        raise unknown("ablation", name, ABLATIONS)
    return ABLATIONS[name]


NO_PRIOR: Mapping[str, object] = {**ABLATIONS["kinematics"].options, **ABLATIONS["libraries"].options}
"""Nothing is known of derivatives, and terms are evolved only, so that no mixer names any."""

SMOKE_OPTIONS: dict[str, Mapping[str, object]] = {
    "paper": {
        "model_population": 20,
        "model_generations": 10,
        "test_population": 10,
        "test_generations": 4,
        "committee_size": 6,
        "mutants": 3,
    },
    "default": {
        "libraries": ("linear", "quadratic"),
        "generations": 1,
        "population": 70,
        "moves": 500,
        "starts": 1,
        "contacts": False,
        "exponentials": False,
        "friction": False,
        "lags": False,
        "hidden": False,
        "storage": False,
        "parts": False,
        "passes": 1,
        "committee_size": 3,
        "candidates": 16,
        "draws": 2,
        "evaluations": 128,
        "tuning_starts": 1,
    },
}
"""Options that make a preset fast and useless, for `--smoke`, by preset."""
