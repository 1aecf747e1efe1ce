"""Options of the choice of tests and of the controller; each is one idea that can be switched off."""

from __future__ import annotations

from dataclasses import dataclass

TESTS = ("ask", "random", "chirp", "prbs")


@dataclass(frozen=True)
class PlanningOptions:
    """How tests are chosen and controllers tuned.

    Args:
        tests: "ask": where the committee disagrees; "random": random gains, gently excited; "chirp" and "prbs": the
            first controller with a chirp or a binary sequence of the largest excitation.
        excitation: amplitude of the first test's excitation, in units of each command's scale; 0: none.
        hold_back: whether the first test's excitation is held back while it flies, the more the nearer the states
            come to the ends of their envelopes.
        excitation_most: largest amplitude of a later test.
        fade: share of a flight, at its end, over which excitation fades out.
        initial_range: how far from the campaign's initial state a test may start, either way (n_x,), in the states'
            units; none: every test starts there.
        target_range: how far from the campaign's target a test may lead, likewise.
        candidates: flights that are compared for each proposal.
        nearness: standard deviation of the candidates' gains around the tuned ones, in ranges of the gains.
        worse: share by which a test may be predicted to be worse than the tuned gains, and than the best flight so
            far, to be told more.
        accuracy: share of a quality to which the twin is asked to know it: as far as members are further apart about
            flights, being told more is worth as much of the quality. Not with the goal "control".
        draws: of sensor noise under which a flight is judged.
        margin: share of the envelope that a proposal keeps free on every member of the committee.
        reach_first: usage of the envelope that a proposal may always have.
        reach_far: usage at most where flights are for the model, whose gains may be far from any that were flown.
        reach_least: usage that such flights may always have, or a first one that hardly moves would end them.
        reach_growth: factor by which its usage may exceed the largest one flown or, where flights are for the model,
            that of the first flight.
        evaluations: flights on which gains are tuned, for each member and draw.
        tuning_starts: of the tuning of gains.
        tuning_members: of the committee on which gains are tuned; 1: the best model only.
        confidence: share of members and draws that must find new gains better than the best flown ones.
        exploit_last: whether the last experiment of a budget flies the tuned gains as they are.
        quality_weights: of the states in the quality (n_x,); none: those of its kind.
        effort: weight of the commands' squares in the quality.
        effort_rate: weight of their rates' squares.
    """

    tests: str = "ask"
    excitation: float = 0.02
    hold_back: bool = True
    excitation_most: float = 0.08
    fade: float = 0.25
    initial_range: tuple[float, ...] = ()
    target_range: tuple[float, ...] = ()
    candidates: int = 1024
    nearness: float = 0.1
    worse: float = 0.05
    accuracy: float = 0.01
    draws: int = 16
    margin: float = 0.1
    reach_first: float = 0.7
    reach_far: float = 0.6
    reach_least: float = 0.2
    reach_growth: float = 1.25
    evaluations: int = 12_000
    tuning_starts: int = 3
    tuning_members: int = 4
    confidence: float = 0.8
    exploit_last: bool = True
    quality_weights: tuple[float, ...] = ()
    effort: float = 0.0
    effort_rate: float = 0.0
