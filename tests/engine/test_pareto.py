"""Ranking, crowding, trade-offs and the archive, against moocore and against the definitions."""

import moocore
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from oracles import crowding, non_dominated, same_bits
from strategies import objectives
from twinloop import InvalidInput, _core, pareto


def ranks_by_moocore(rows):
    """Its fronts of the distinct rows: it breaks ties between equal ones, NSGA-II does not."""
    distinct, place = np.unique(rows, axis=0, return_inverse=True)
    return moocore.pareto_rank(distinct)[place.ravel()]


@given(objectives())
def test_ranks_are_moocores(rows):
    assert pareto.ranks(rows).tolist() == ranks_by_moocore(rows).tolist()


@given(objectives())
def test_the_first_front_is_what_moocore_finds_non_dominated(rows):
    first = pareto.ranks(rows) == 0
    assert first.tolist() == moocore.is_nondominated(rows, keep_weakly=True).tolist()


def test_ranks_of_a_large_population_with_many_objectives_are_moocores():
    stream = np.random.default_rng(0)
    for columns in (2, 3, 14):
        rows = stream.normal(size=(600, columns))
        rows[::7] = rows[3]
        assert pareto.ranks(rows).tolist() == ranks_by_moocore(rows).tolist()


@given(objectives())
def test_crowding_is_the_definition_in_every_front(rows):
    ranks = pareto.ranks(rows)
    found = pareto.crowding_distances(rows, ranks)
    for rank in set(ranks.tolist()):
        front = ranks == rank
        np.testing.assert_allclose(found[front], crowding(rows[front]), rtol=1e-12)


def test_the_edges_of_a_front_are_infinitely_far():
    rows = np.array([[0.0, 4.0], [1.0, 2.0], [3.0, 1.0], [4.0, 0.0]])
    found = pareto.crowding_distances(rows, pareto.ranks(rows))
    np.testing.assert_allclose(found, [np.inf, 3 / 4 + 3 / 4, 3 / 4 + 2 / 4, np.inf])


@given(objectives(), st.integers(0, 70))
def test_selection_is_by_rank_then_crowding_then_place(rows, count):
    ranks = pareto.ranks(rows)
    room = pareto.crowding_distances(rows, ranks)
    expected = sorted(range(len(rows)), key=lambda i: (ranks[i], -room[i], i))[:count]
    assert pareto.select(rows, count).tolist() == expected


@given(objectives())
def test_the_ideal_point_is_the_least_of_each_objective(rows):
    assert pareto.ideal_point(rows).tolist() == rows.min(axis=0).tolist()


@given(objectives(), st.booleans())
def test_the_best_trade_off_is_the_row_nearest_to_the_ideal_point(rows, normalised):
    gaps = rows - rows.min(axis=0)
    if normalised:
        extent = np.ptp(rows, axis=0)
        gaps = gaps / np.where(extent == 0.0, 1.0, extent)
    distances = np.linalg.norm(gaps, axis=1)
    best = pareto.best_tradeoff(rows, normalised)
    assert distances[best] <= distances.min() * (1.0 + 1e-12)
    twins = [i for i, row in enumerate(rows) if (row == rows[best]).all()]
    assert best == twins[0]


def test_normalising_changes_which_trade_off_is_best():
    rows = [[0.0, 1000.0], [1.0, 0.0], [0.1, 300.0]]
    assert pareto.best_tradeoff(rows) == 1
    assert pareto.best_tradeoff(rows, normalised=True) == 2


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_cannot_be_ordered_are_refused(value):
    rows = [[0.0, 1.0], [1.0, value]]
    archive = _core.Archive(2)
    for call in (
        lambda: pareto.ranks(rows),
        lambda: pareto.crowding_distances(rows, [0, 0]),
        lambda: pareto.select(rows, 1),
        lambda: pareto.ideal_point(rows),
        lambda: pareto.best_tradeoff(rows),
        lambda: _core.ranks(rows),
        lambda: _core.select(rows, 1),
        lambda: _core.ideal_point(rows),
        lambda: _core.best_tradeoff(rows),
        lambda: archive.offer(rows),
    ):
        with pytest.raises(InvalidInput, match="expected finite numbers"):
            call()
    assert len(archive) == 0


def test_what_is_no_matrix_is_refused():
    for call in (pareto.ranks, pareto.ideal_point, pareto.best_tradeoff):
        with pytest.raises(InvalidInput, match="expected the shape"):
            call([1.0, 2.0])
    with pytest.raises(InvalidInput, match="at least one row"):
        pareto.ideal_point(np.zeros((0, 2)))
    with pytest.raises(InvalidInput, match="at least one row"):
        pareto.best_tradeoff(np.zeros((0, 2)))
    with pytest.raises(InvalidInput, match="expected a front"):
        pareto.crowding_distances([[1.0], [2.0]], [0])
    with pytest.raises(InvalidInput, match="expected a 1-dimensional array"):
        pareto.crowding_distances([[1.0], [2.0]], [[0, 0]])
    with pytest.raises(InvalidInput, match="expected a whole number"):
        pareto.select([[1.0]], -1)


# The archive


@given(objectives(), st.integers(1, 7))
def test_the_archive_is_the_non_dominated_subset_of_all_that_was_offered(rows, chunk):
    archive = _core.Archive(rows.shape[1])
    for start in range(0, len(rows), chunk):
        archive.offer(rows[start : start + chunk])
    assert archive.members.tolist() == non_dominated(rows)
    assert same_bits(archive.objectives, rows[archive.members])
    kept = moocore.is_nondominated(rows, keep_weakly=True)
    assert np.array_equal(np.unique(archive.objectives, axis=0), np.unique(rows[kept], axis=0))


@given(objectives(most=40), st.randoms(use_true_random=False))
def test_the_points_of_the_archive_do_not_depend_on_the_order(rows, random):
    order = list(range(len(rows)))
    random.shuffle(order)
    one, two = _core.Archive(rows.shape[1]), _core.Archive(rows.shape[1])
    one.offer(rows)
    two.offer(rows[order])
    assert np.array_equal(np.unique(one.objectives, axis=0), np.unique(two.objectives, axis=0))


@pytest.mark.parametrize("width", _core.vector_widths())
def test_a_large_archive_is_moocores_in_every_vector_width(width):
    stream = np.random.default_rng(1)
    for columns in (1, 2, 3, 8, 14):
        rows = stream.normal(size=(800, columns)).round(1)
        archive = _core.Archive(columns, width=width)
        archive.offer(rows)
        assert archive.members.tolist() == np.flatnonzero(moocore.is_nondominated(rows)).tolist()


def test_of_equal_points_the_first_stays():
    archive = _core.Archive(2)
    assert archive.offer([[1.0, 1.0], [1.0, 1.0], [0.0, 2.0], [1.0, 1.0]]).tolist() == [0, 2]


@given(objectives(most=80), st.integers(1, 20))
def test_pruning_keeps_the_best_trade_offs_and_the_minima(rows, cap):
    archive = _core.Archive(rows.shape[1])
    archive.offer(rows)
    before, points = archive.members.tolist(), archive.objectives
    protected = {int(column.argmin()) for column in points.T}
    protected |= {pareto.best_tradeoff(points), pareto.best_tradeoff(points, True)}
    assert archive.prune(cap) == (max(cap, len(protected)) < len(before))
    after = archive.members.tolist()
    assert len(after) == min(len(before), max(cap, len(protected)))
    assert {before[i] for i in protected} <= set(after)
    assert after == [member for member in before if member in after]


def test_pruning_drops_the_most_crowded():
    archive = _core.Archive(2)
    archive.offer([[x, 10.0 - x] for x in (0.0, 4.0, 4.5, 5.0, 10.0)])
    archive.prune(4)
    assert 2 not in archive.members.tolist() or 5.0 not in archive.objectives[:, 0]
    assert len(archive) == 4


def test_an_archive_refuses_rows_of_another_width():
    with pytest.raises(InvalidInput, match="expected 2 objectives, found 3"):
        _core.Archive(2).offer([[1.0, 2.0, 3.0]])
    with pytest.raises(InvalidInput, match="1 to 1000000 columns"):
        _core.Archive(0)


def test_an_archive_refuses_what_is_no_count_and_no_matrix():
    archive = pareto.Archive(2)
    for call in (
        lambda: pareto.Archive(-1),
        lambda: pareto.Archive("two"),
        lambda: pareto.Archive(2, "no such width"),
        lambda: archive.prune(-1),
        lambda: archive.prune(2**64),
        lambda: archive.offer([1.0, 2.0]),
        lambda: archive.offer("ab"),
    ):
        with pytest.raises(InvalidInput) as refusal:
            call()
        assert refusal.value.args[0].endswith(".")
    assert len(archive) == 0
