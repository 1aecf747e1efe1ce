"""Options of the choice of tests and of the controller; each is one idea that can be switched off."""

from __future__ import annotations

from dataclasses import dataclass

TESTS = ("ask", "random", "chirp", "prbs")


@dataclass(frozen=True)
class PlanningOptions:
    """Options for the choice of tests and the tuning of controllers.

    Args:
        tests: "ask": the committee's disagreement; "random": random gains, gently excited; "chirp" and "prbs": the
            first controller with a chirp or a binary sequence of the largest excitation.
        excitation: amplitude at which the first test's excitation begins, at most, in units of each command's scale;
            0: none.
        excitation_unknown: largest amplitude to which it grows, from cycle to cycle and from test to test, until a law
            is known, of the commands that answer to a state until that one's is; only where it is held back.
        hold_back: whether such an excitation is held back during the flight as the states approach the ends of their
            envelopes.
        excitation_most: largest amplitude of a later test.
        fade: share of a flight, at its end, over which excitation fades out.
        initial_range: largest distance of a test's start from the campaign's initial state, in either direction
            (n_x,), in the states' units; none: every test starts there.
        target_range: the same for the target.
        candidates: number of flights that are compared for each proposal.
        backtracking: whether some candidates are on the way from the best gains flown to the tuned ones; not with the
            goal "model".
        within: whether gains are tuned once more, under the limits of the next flight, where those tuned lead too far.
        nearness: standard deviation of the candidates' gains around the tuned ones, in ranges of the gains.
        worth: whether the value of its information limits how much worse a test may be predicted; otherwise the
            share `worse` does.
        worse: largest share by which an informative test may be predicted worse than the tuned gains, and than the
            best flight so far.
        accuracy: requested relative accuracy of predicted qualities: the part of the members' spread above it counts
            as a loss of quality. Not with the goal "control".
        draws: of sensor noise under which a flight is judged.
        margin: share of the envelope that a proposal keeps free on every member of the committee.
        reach_first: usage of the envelope that a proposal may always have.
        reach_far: largest usage of flights for the model, whose gains may be far from any that were flown.
        reach_least: usage that such flights may always have, even if the first flight hardly moves.
        reach_rest: share of what flights have left unused, less the margin, by which a proposal may use more than they.
        reach_growth: largest ratio of the usage of a flight for the model to that of the first flight.
        reach_seen: how far beyond the states seen so far and those of the task a proposal may lead, in units of how far
            flights have moved them, until a prediction has come true; 0: anywhere.
        ends: whether new gains must keep the envelope also if what states do ends where flights and the task have been;
            after a single flight, as far again.
        evaluations: number of flights on which gains are tuned at most, for each draw; each draw is met by one member.
        tuning_starts: number of starts of the tuning.
        tuning_members: members of the committee on which gains are tuned; 1: the best model only.
        tuned_in_gusts: whether gains are tuned, and compared with flown ones, in the disturbances that flights met too.
        delay_margin: whether gains are tuned with, and must tolerate, one more period of delay; for each of the last
            predictions of new gains in a row that came true, or that the flight was better than, the delay that gains
            must tolerate is halved, and the one that they are tuned with is quartered.
        delay_least: periods of more delay that they are tuned with, and must tolerate, whatever came true, beside
            `delay_margin`: with 1 they have the margins that a certificate asks for, and cost some quality.
        confidence: share of members and draws that must find new gains better than the best flown ones, by half a
            percent or more, and by more than predictions have missed of late.
        track_record: whether new gains must also be better by the error of earlier predictions.
        alone: whether flown gains are compared without the effect of their excitation.
        exploit_last: whether the last experiment of a budget flies the tuned gains without excitation.
        quality_weights: of the states in the quality (n_x,); none: the default weights.
        effort: weight of the commands' squares in the quality.
        effort_rate: weight of their rates' squares.
    """

    tests: str = "ask"
    excitation: float = 0.02
    excitation_unknown: float = 0.3
    hold_back: bool = True
    excitation_most: float = 0.08
    fade: float = 0.25
    initial_range: tuple[float, ...] = ()
    target_range: tuple[float, ...] = ()
    candidates: int = 1024
    backtracking: bool = True
    within: bool = True
    nearness: float = 0.1
    worth: bool = True
    worse: float = 0.05
    accuracy: float = 0.01
    draws: int = 16
    margin: float = 0.1
    reach_first: float = 0.7
    reach_far: float = 0.6
    reach_least: float = 0.2
    reach_rest: float = 0.5
    reach_growth: float = 1.25
    reach_seen: float = 4.0
    ends: bool = True
    evaluations: int = 12_000
    tuning_starts: int = 3
    tuning_members: int = 4
    tuned_in_gusts: bool = True
    delay_margin: bool = True
    delay_least: float = 0.0
    confidence: float = 0.8
    track_record: bool = True
    alone: bool = True
    exploit_last: bool = True
    quality_weights: tuple[float, ...] = ()
    effort: float = 0.0
    effort_rate: float = 0.0
