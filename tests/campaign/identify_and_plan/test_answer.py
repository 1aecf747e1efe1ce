"""Which flights tell whether a law is followed."""

from types import SimpleNamespace

import pytest

from twinloop.campaign.identify_and_plan.answer import _can_tell


@pytest.mark.parametrize(
    ("tests", "disturbed", "telling"),
    [
        ([None, None, "test"], True, {2}),
        ([None, None, "test"], False, {0, 1, 2}),
        ([None, None], True, {0, 1}),
        (["test", None, "test"], True, {0, 2}),
    ],
)
def test_in_disturbances_that_last_replays_without_a_controller_tell_nothing_beside_a_test(
    tests, disturbed, telling
):
    assert _can_tell([SimpleNamespace(test=test) for test in tests], disturbed) == telling
