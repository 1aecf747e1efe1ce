"""Reasons: why a test is proposed, in sentences for a person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from twinloop._ground.elementary import log
from twinloop._ground.texts import enumerated, two_digits
from twinloop.planning.proposal import Fared
from twinloop.signals import Signals


@dataclass(frozen=True)
class Why:
    """What there is to say of a proposal.

    Args:
        trusted: whether the committee follows the flights so far.
        gains_count: whether gains make a difference on it.
        flies: whether the best gains flown are known to fly.
        fared: how their flights have ended.
        stronger: whether they fly with a stronger excitation than before.
        exploits: whether the tuned gains are flown as they are.
        plain: whether the test that promises most was wanted.
        repeats: whether it flies the best gains flown again.
        excited: whether it has an excitation.
        varied: whether its gains are others than the best ones flown, however close.
        safe: whether every member keeps the envelope with its margin, and under noise.
        disagreement: of the committee, in nats.
        step: at which two members are the furthest apart.
        state: in which they are.
        members: numbers of the two.
        lawless: names of states of which no law is known.
        untunable: names of the gains that cannot be tuned for that.
        halfway: whether some candidates lead too far towards gains of flights that the twin is wrong about.
        held: whether clearly better ones are held back, since they would leave the envelope if what states do ended.
    """

    trusted: bool
    gains_count: bool
    flies: bool
    fared: Fared
    stronger: bool
    exploits: bool
    plain: bool
    repeats: bool
    excited: bool
    varied: bool
    safe: bool
    disagreement: float
    step: int
    state: int
    members: tuple[int, int]
    lawless: tuple[str, ...] = ()
    untunable: tuple[str, ...] = ()
    halfway: bool = False
    held: bool = False


def reason(why: Why, signals: Signals) -> str:
    """Why this test.

    Args:
        why: what there is to say.
        signals: of the system.
    """
    sentences = [_what_flies(why), _what_it_tells(why, signals)]
    if why.trusted and why.gains_count and why.lawless:
        sentences.append(what_stays(why.lawless, () if why.repeats else why.untunable))
    if why.halfway and not why.repeats:
        sentences.append(
            "An earlier flight was clearly worse than the twin predicts it even now, or left its envelope: these gains"
            " go at most halfway from the best ones flown to those of that flight."
        )
    if why.held:
        sentences.append(
            "Gains that promise more are held back: they lead further than flights have, and out of the envelope if"
            " what holds the states back ends where flights have been."
        )
    if not why.safe:
        sentences.append(
            "On some model this flight leaves the envelope or its margin under sensor noise, and none that stays inside"
            " on all of them may be flown now: this is the safest known. Fly it with a hand on the switch, or not at"
            " all."
        )
    return " ".join(sentence for sentence in sentences if sentence)


def _what_flies(why: Why) -> str:
    """That the best gains flown fly again; nothing where others do."""
    known = ": they are known to fly" * why.flies
    if why.fared.left:
        known = f", though {why.fared} did not keep the envelope to the end"
    if not why.repeats:
        return ""
    if why.excited:
        excitation = "a stronger excitation" if why.stronger else "another excitation"
        return f"The best gains flown, again, with {excitation}{known}."
    variation = ", with a small variation" if why.varied else ""
    return f"The best gains flown, again{variation}{known}."


def _what_it_tells(why: Why, signals: Signals) -> str:
    """What is expected of the flight."""
    high, low = why.members
    if not why.trusted:
        return "The twin does not follow the flights so far: it cannot say what this one will show."
    if not why.gains_count and why.lawless:
        return (
            f"{what_stays(why.lawless)[:-1]}, and gains that do not answer to {them(why.lawless)} make no difference on"
            " the twin: all stay as flown."
        )
    if not why.gains_count:
        return "The twin does not know yet what the commands do to the task: it flies alike with any gains."
    if why.exploits:
        return "The best gains found on the twin, without excitation."
    if why.plain:
        promise = "The most promising gains that may be flown, without excitation."
        return "" if why.repeats else promise
    if why.disagreement > 0.0 and high != low:
        return (
            f"Models {high} and {low} disagree most on {signals.state_names[why.state]},"
            f" {two_digits(why.step * signals.dt)} s after the start; information:"
            f" {why.disagreement / float(log(2.0)):.3g} bits."
        )
    return "The models agree on it: the flight tests what they have in common."


def them(names: Sequence[str]) -> str:
    """The pronoun for some names."""
    return "them" if len(names) > 1 else "it"


def what_stays(lawless: Sequence[str], untunable: Sequence[str] = ()) -> str:
    """Of what the twin knows no law, and which gains stay as flown for that.

    Args:
        lawless: names of the states, at least one.
        untunable: names of the gains; none: nothing is said of them.
    """
    unknown = f"The twin knows no law of {enumerated(lawless)} yet"
    if not untunable:
        return f"{unknown}."
    return f"{unknown}: {enumerated(untunable)} stay{'s' * (len(untunable) == 1)} as flown."
