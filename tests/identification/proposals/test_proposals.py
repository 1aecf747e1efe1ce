"""A proposal is a function of what it is given: it changes nothing, and gives the same again."""

from dataclasses import replace

import numpy as np
import pytest

from sameness import copied, same, through_json
from small_plants import fans, gravity, pendulum_like, swung
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.identify import concluded, identify_runs
from twinloop.identification.proposals import terms as terms_file
from twinloop.identification.proposals.hidden import hidden
from twinloop.identification.proposals.lags import lags
from twinloop.identification.proposals.parts import parts
from twinloop.identification.proposals.second_look import second_look
from twinloop.identification.proposals.terms import terms
from twinloop.identification.search.selection import climbed, from_both_sides
from twinloop.identification.searches import PROPOSALS, Found, decided
from twinloop.identification.starts import RENEWED, starts

WORKERS = _core.Workers(1)
QUICK = {"moves": 2000, "starts": 2, "generations": 2, "population": 30, "committee_size": 4, "passes": 3}
NAMES = [proposal.__name__ for proposal in PROPOSALS]


def context_of(signals, runs, rests=(), earlier=None, watch=None, **changes):
    options = options_of("default", {**QUICK, **changes})
    said = [] if watch is None else watch
    return Context(
        runs,
        signals,
        options,
        Unit(3, (len(runs),)),
        WORKERS,
        rests=rests,
        earlier=earlier,
        watch=said.append,
    )


def pendulum(count=1, **changes):
    runs = [swung(gravity, seed, noise=1e-3) for seed in range(count)]
    return context_of(pendulum_like(), runs, **changes)


def two_fans(count=3, fading=3.0, **changes):
    signals, runs = fans(count, fading=fading)
    return context_of(signals, runs, rests=[np.ones(2)], **changes)


def start_of(context):
    return starts(context, "acceleration")[0]()


def end_of(context, start, proposals=PROPOSALS):
    """What a search from a start leaves."""
    found = Found(start)
    for propose in proposals:
        found = decided(found, propose(context, found.best))
    return found


@pytest.mark.parametrize("context", [pendulum(1), pendulum(2), two_fans(3)], ids=["one", "two", "fans"])
def test_no_proposal_changes_what_it_is_given_and_each_gives_the_same_again(context):
    found, proposed = Found(start_of(context)), []
    for propose in PROPOSALS:
        before = copied(found)
        once, again = (list(propose(context, found.best)) for _ in range(2))
        assert same(found, before) and same(once, again)
        proposed += [propose.__name__] * bool(once)
        found = decided(found, once)
    assert found.best.evidence.stage == (True, True, False)
    assert proposed == (["terms", "undisturbed", "second_look"] + ["parts"] * (len(context.runs) == 1)) or (
        proposed[:2] == ["hidden", "terms"] and found.best.actuation.hidden
    )


@pytest.mark.parametrize("step", [start_of, lambda context: fitted(context, start_of(context))])
def test_steps_of_a_search_change_nothing_either(step):
    context = pendulum(2)
    hypothesis = step(context)
    before = copied(hypothesis)
    for work in (from_both_sides, climbed, fitted):
        once, again = work(context, hypothesis), work(context, hypothesis)
        assert same(hypothesis, before) and same(once, again)


def test_what_finds_nothing_changes_nothing_wherever_it_is_proposed():
    context = pendulum(2)
    start = start_of(context)

    def silent(context, hypothesis):
        return []

    def longer(context, hypothesis):
        more = (
            replace(found, description_length=found.description_length + 1.0) for found in hypothesis.sums
        )
        return [hypothesis, replace(hypothesis, sums=tuple(more))]

    # Of what was found a proposal sees the best alone, so one place at a time says it of all that follow.
    found = Found(start)
    for propose in PROPOSALS:
        for idle in (silent, longer):
            assert same(decided(found, idle(context, found.best)).best, found.best)
        found = decided(found, propose(context, found.best))
    idle_everywhere = [each for propose in PROPOSALS for each in (silent, longer, propose)]
    assert same(end_of(context, start, [*idle_everywhere, silent, longer]).best, found.best)


def test_where_nothing_is_hidden_it_does_not_matter_when_that_is_looked_for():
    context = two_fans(2, fading=0.0)
    start = start_of(context)
    orders = [(lags, hidden, terms), (hidden, lags, terms), (lags, hidden, hidden, terms), (lags, terms)]
    plain, *others = (end_of(context, start, order).best for order in orders)
    assert plain.actuation.hidden == () and all(same(other, plain) for other in others)


def test_a_lag_search_that_finds_no_lag_proposes_nothing_and_moves_nothing():
    context = pendulum(2)
    start = start_of(context)
    assert list(lags(context, start)) == []
    with_lags, without = (end_of(context, start, order).best for order in (PROPOSALS, PROPOSALS[1:]))
    assert PROPOSALS[0] is lags and same(with_lags, without)


@pytest.fixture(scope="module")
def under_way():
    """A search of two fans: its context, and what it had found before each proposal."""
    context = two_fans(2)
    found = [Found(start_of(context))]
    for propose in PROPOSALS[:-1]:
        found.append(decided(found[-1], propose(context, found[-1].best)))
    return context, found


@pytest.mark.parametrize("after", range(len(PROPOSALS)))
def test_a_search_that_is_read_back_from_its_record_goes_on_with_the_same_bits(under_way, after):
    context, found = under_way[0], under_way[1][after]
    again = Found.from_record(through_json(found.to_record()), context.signals)
    assert same(found, again)
    propose = PROPOSALS[after]
    one, other = (decided(known, propose(context, known.best)) for known in (found, again))
    assert same(one, other)


def test_what_an_option_switches_off_or_is_done_already_is_not_proposed():
    context = pendulum(2, lags=False, hidden=False, parts=False, passes=1)
    start = start_of(context)
    assert not any(list(propose(context, start)) for propose in (lags, hidden))
    model = end_of(context, start).best
    assert model.fit is not None and not model.smoothed
    again = [name for name, propose in zip(NAMES, PROPOSALS, strict=True) if list(propose(context, model))]
    # A law that leaves more than noise may be looked at again as if nothing disturbed.
    assert again in ([], ["undisturbed"])
    assert list(parts(pendulum(2), model)) == [] and list(second_look(pendulum(2), start)) == []


def test_where_the_shortest_runs_away_the_modest_one_is_proposed_too(monkeypatch):
    context, tried = pendulum(2), []
    start = start_of(context)

    def runs_away_once(context, hypothesis):
        found = fitted(context, hypothesis)
        tried.append(hypothesis)
        return replace(found, fit=replace(found.fit, chi_squared=np.inf)) if len(tried) == 1 else found

    monkeypatch.setattr(terms_file, "fitted", runs_away_once)
    found = decided(Found(start), terms(context, start))
    assert len(tried) == 2 and found.best.evidence.stable and found.rivals == ()
    assert same(found.best, fitted(context, climbed(context, replace(start, sums=start.from_above))))


def test_what_was_known_is_a_start_of_its_own_that_changes_no_other():
    signals, runs = fans(3, fading=3.0)
    options = options_of("default", QUICK)
    known = identify_runs(
        runs[:2], signals, options, rests=[np.ones(2)], seed=3, iteration=2, workers=WORKERS
    )
    assert known.model.form == "acceleration" and known.actuation.hidden
    context = context_of(signals, runs, rests=[np.ones(2)], earlier=known)
    before = copied(known)
    one, two = (start() for start in starts(context, "acceleration"))
    assert same(known, before)
    assert one.fit is None and one.actuation.hidden == () and two.start == RENEWED
    assert two.evidence.stable and two.actuation.hidden
    assert len(starts(replace(context, earlier=None), "acceleration")) == 1
    # The order in which they are searched does not matter, for they share nothing that changes.
    late = end_of(context, two)
    assert same(end_of(context, one).best, end_of(context, one).best)
    assert same(late.best, end_of(context, two).best)


def test_a_newcomer_is_a_function_and_a_line():
    """Here one that believes in a term of its own, entered after parts have entered theirs."""
    context, entered = pendulum(1), []

    def believer(context, hypothesis):
        grown = replace(hypothesis, candidates=hypothesis.candidates.growing())
        entered.append(grown.pool.add("tanh", grown.pool.add("*", 0, 0.123)))
        first, *others = grown.sums
        first = replace(first, weights={**first.weights, entered[0]: 0.5})
        found = fitted(context, replace(grown, sums=(first, *others), fit=None))
        return [replace(found, fit=replace(found.fit, length=found.fit.length - 1e3))]

    found = end_of(context, start_of(context), (*PROPOSALS, believer))
    learnt = concluded(context, found, [])
    assert learnt.of_parts and learnt.pool.text(entered[0], ["angle", "rate", "torque"]).startswith("tanh")
    assert all(node < len(learnt.pool) for found in learnt.sums for node in found.weights)
    assert (
        type(learnt).from_record(learnt.to_record(), context.signals).description_length
        == learnt.description_length
    )
