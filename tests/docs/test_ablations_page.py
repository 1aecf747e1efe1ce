"""The table of ablations of docs/options.md is that of the code, with what was measured."""

from pathlib import Path

import pytest

from twinloop_exam.ablations import ABLATIONS


@pytest.fixture
def ablations_page(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "scripts"))
    import ablations_page

    return ablations_page


def test_the_page_has_every_ablation_as_it_is_switched_off(ablations_page):
    written = ablations_page.PAGE.read_text(encoding="utf-8")
    assert written == ablations_page.page(), "run `python scripts/ablations_page.py`"
    for name, ablation in ABLATIONS.items():
        assert f"| `{name}` | {ablation.without} |" in written


def test_what_was_measured_stands_in_the_table(ablations_page):
    bought = {
        "ratio": 1.25,
        "better": 3,
        "worse": 1,
        "pairs": 4,
        "chance": 0.6,
        "verdict": "no difference seen",
    }
    row = {
        "ablation": "lags",
        "campaigns": 4,
        "flown": bought,
        "error": {**bought, "ratio": "inf"},
        "seconds": bought,
    }
    nothing = {**row, "ablation": "hidden", "campaigns": 0}
    found = {"plants": 2, "seeds": 2, "versions": ["0.1.0 at 1234567"], "ablations": [row, nothing]}
    shown = ablations_page.text(found)
    (lags,) = (line for line in shown.splitlines() if line.startswith("| `lags`"))
    assert "no difference seen: 1.25; 75 % better, 25 % worse" in lags and "inf; 75 %" in lags
    assert "4 campaigns (2 plants, 2 seeds) by 0.1.0 at 1234567" in shown
    assert len({line.count("|") for line in shown.splitlines() if line.startswith("|")}) == 1
