"""Pictures of a campaign: real runs against the twin, errors by iteration; needs matplotlib."""

from __future__ import annotations

import importlib
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.writing import write_whole
from twinloop.campaign import Campaign, assessment, controller_to_fly
from twinloop.campaign.examination.beside import Beside
from twinloop.errors import NotAvailable
from twinloop.signals import State
from twinloop.test import Test
from twinloop.trajectory import Trajectory

SUFFIXES = (".svg", ".png")
INK, FAINT, TWIN, TARGET = "#22272e", "#c9ced6", "#d1495b", "#6b7280"
CYCLE = ("#22577a", "#d1495b", "#2a9d8f", "#e09f3e", "#7b4b94", "#6b7280", "#8ab17d", "#b5651d")
BAND: dict[str, Any] = {"color": TWIN, "alpha": 0.22, "linewidth": 0.0}
STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.size": 9.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "axes.titlesize": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#eceef1",
    "grid.linewidth": 0.8,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "twinloop",  # equal pictures are equal files
}


def require() -> Any:
    """Matplotlib itself.

    Raises:
        NotAvailable: it is not installed.
    """
    try:
        return importlib.import_module("matplotlib")
    except ImportError as missing:
        raise NotAvailable(
            "Pictures need matplotlib, which is not installed: pip install 'twinloop[plot]'."
        ) from missing


def campaign_picture(campaign: Campaign, path: Path, quality: str = "quality") -> None:
    """Every state of every test, flown and predicted, above the errors by experiment.

    Where a committee stands behind the twin, its 90 % band is drawn too, and the predicted beside the flown quality.

    Args:
        campaign: with at least one run.
        path: where to write; its suffix is .svg or .png.
        quality: what is minimised, with its unit, for a person.

    Raises:
        NotAvailable: matplotlib is missing, or nothing was told.
        OSError: the file cannot be written.
    """
    with require().rc_context(STYLE):
        identified = campaign.options.identifies
        columns, rows = len(campaign.experiments), campaign.signals.n_x + identified
        figure = _figure(max(8.4 if identified else 6.4, 1.2 + 2.2 * columns), 1.15 * rows + 3.4)
        above, below = figure.subfigures(2, 1, height_ratios=[1.15 * rows + 0.6, 2.8])
        _runs(above, campaign)
        if identified:
            left, right = below.subplots(1, 2)
            _errors_by_experiment(left, campaign)
            _qualities(right, campaign, quality)
        else:
            axes = below.subplots(1, 1)
            _error_lines(axes, _normalised(campaign), "normalised closed-loop error")
            axes.axhline(1.0, color=TARGET, linewidth=0.8, linestyle=":")
            axes.set_title(
                "Error of the best trade-off by iteration (1: a model that never moves)", loc="left"
            )
        _save(figure, path)


def _legend_below(axes: Any) -> None:
    """Where it lies on no line, however the lines go."""
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), fontsize=8.0, ncols=3)


def _normalised(campaign: Campaign) -> dict[int, list[tuple[float, float]]]:
    """(iteration, normalised closed-loop error) of each test."""
    return {
        test: [
            (float(record.iteration), record.normalised[record.tests.index(test)])
            for record in campaign.history
            if test in record.tests
        ]
        for test in dict.fromkeys(run.test.number for run in campaign.experiments if run.test is not None)
    }


def _errors_by_experiment(axes: Any, campaign: Campaign) -> None:
    _error_lines(axes, _normalised(campaign), "normalised error of whole flights")
    learnt: dict[int, float] = {}
    for record in campaign.history:
        for test in record.tests:
            if test is not None:
                learnt.setdefault(test, float(record.iteration))
    label = "before it was learnt"
    for i, run in enumerate(campaign.experiments):
        before = run.normalised_before
        if before is None or not before > 0.0 or run.test is None or run.test.number not in learnt:
            continue
        axes.plot(
            learnt[run.test.number] - 1.0, before,
            color=CYCLE[i % len(CYCLE)], marker="o", markersize=6.0, markerfacecolor="none", linestyle="none",
            label=label,
        )  # fmt: skip
        label = "_again"
    axes.set_xlabel("experiments learnt")
    axes.set_title("Error of the twin (1: a model that never moves)", loc="left")
    _legend_below(axes)
    axes.margins(0.08, 0.15)


def _qualities(axes: Any, campaign: Campaign, label: str) -> None:
    flown = [(run.number, run.quality) for run in campaign.experiments if run.quality is not None]
    tests = [run.test for run in campaign.experiments if run.test is not None]
    foretold = [
        (test.number, test.predicted, test.spread or 0.0)
        for test in tests
        if test.predicted is not None and math.isfinite(test.predicted)
    ]
    numbers = [number for number, _, _ in foretold]
    axes.plot(
        *zip(*flown, strict=True) if flown else ([], []), color=INK, marker="o", markersize=5.0, label="flown"
    )
    axes.errorbar(
        [number + 0.12 for number in numbers],
        [value for _, value, _ in foretold],
        yerr=[spread for _, _, spread in foretold],
        color=TWIN, marker="D", markersize=4.5, linestyle="none", capsize=3.0, label="predicted ± spread",
    )  # fmt: skip
    best = controller_to_fly(campaign)[0]
    expected = None if best is None else assessment.predicted_quality(best, campaign.experiments)[0]
    if expected is not None and math.isfinite(expected):
        axes.axhline(expected, color=TWIN, linewidth=0.8, linestyle=":", label="controller to fly, predicted")
    axes.set_xlabel("test")
    axes.set_ylabel(label)
    axes.set_ylim(bottom=0.0)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.margins(x=0.1)
    axes.set_title("Quality of the flights (lower is better)", loc="left")
    _legend_below(axes)


def iterations_picture(errors: Mapping[int, Sequence[tuple[float, float]]], title: str, path: Path) -> None:
    """One line for each selected test: its closed-loop error under the successive best trade-offs.

    Args:
        errors: (iteration, error) pairs by number of the test, SI units squared.
        title: of the picture.
        path: where to write; its suffix is .svg or .png.

    Raises:
        NotAvailable: matplotlib is missing.
        OSError: the file cannot be written.
    """
    with require().rc_context(STYLE):
        figure = _figure(6.8, 4.2)
        axes = figure.subplots(1, 1)
        _error_lines(axes, errors, "closed-loop error (mean square; rad, rad/s)")
        axes.set_title(title, loc="left")
        _save(figure, path)


def _figure(width: float, height: float) -> Any:
    return importlib.import_module("matplotlib.figure").Figure(figsize=(width, height), layout="constrained")


def _save(figure: Any, path: Path) -> None:
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    # The layout's solver differs in the last bits from run to run.
    for part in figure.subfigs:
        part.bbox_relative.set_points(np.round(part.bbox_relative.get_points(), 4))
    for axes in figure.get_axes():
        axes.set_position([round(float(edge), 4) for edge in axes.get_position().bounds])
    metadata = {"Date": None} if path.suffix == ".svg" else {"Software": None}
    contents = io.BytesIO()
    figure.savefig(contents, format=path.suffix.lower()[1:], dpi=150, metadata=metadata)
    write_whole(path, contents.getvalue())


def _runs(figure: Any, campaign: Campaign) -> None:
    states, runs, found = campaign.signals.states, campaign.experiments, campaign.examine()
    banded = found.twin.noise is not None
    rows = len(states) + banded
    grid = figure.subplots(rows, len(runs), sharex=True, sharey="row", squeeze=False)
    best = found.best
    for column, (name, each) in enumerate(zip(found.names, found.beside, strict=True)):
        run, predicted = each.run, each.simulated
        start = run.trajectory.t[0]
        title = name
        if run.test is not None and best is not None and run.test.number == best.number:
            title += " (best)"
        grid[0, column].set_title(title, loc="left")
        for row, state in enumerate(states):
            axes, flown = grid[row, column], run.trajectory.states[:, row]
            if run.test is not None:
                _draw_target(axes, run.test, row, run.trajectory)
            if predicted.band is not None:
                low, high = predicted.band[:, :, row]
                axes.fill_between(predicted.t, low, high, label="90 % band of the twin", **BAND)
            axes.plot(
                run.trajectory.t - start, flown, color=INK, linewidth=2.4 if banded else 1.6, label="system"
            )
            axes.plot(
                predicted.t,
                predicted.states[:, row],
                color=TWIN,
                linewidth=1.1,
                linestyle=(0, (4, 2)) if banded else "-",
                label="twin",
            )
            if column == 0:
                axes.set_ylabel(f"{state.name.replace('_', ' ')}\n({state.unit or '1'})")
        if banded:
            _inside_the_band(grid[-1, column], each, first=column == 0)
        grid[-1, column].set_xlabel("time (s)")
    for row in range(len(states)):
        curves = [run.trajectory.states[:, row] for run in runs]
        curves += [_target(run.test, row, run.trajectory)[1] for run in runs if run.test is not None]
        grid[row, 0].set_ylim(*_extent(curves))
    figure.align_ylabels(grid[:, 0])
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))


def _inside_the_band(axes: Any, found: Beside, first: bool) -> None:
    """Every state's distance to the middle of the band, in half-widths: 1 is its edge."""
    assert found.places is not None
    times = found.simulated.t[: len(found.places)]
    axes.fill_between(times, -1.0, 1.0, **BAND)
    axes.plot(times, found.places, color=INK, linewidth=0.5, alpha=0.8)
    if found.inside is not None:
        axes.set_title(
            f"{100.0 * found.inside:.0f} % of the readings inside the band", loc="left", fontsize=8.0
        )
    axes.set_ylim(-3.5, 3.5)
    if first:
        axes.set_ylabel("all states,\nin the band")


def _draw_target(axes: Any, test: Test, row: int, flown: Trajectory) -> None:
    """The target of a state: a line, or a curve where it varies with time."""
    style: dict[str, Any] = {"color": TARGET, "linewidth": 0.8, "linestyle": ":", "label": "target"}
    t, target = _target(test, row, flown)
    if len(target) == 1:
        axes.axhline(target[0], **style)
    else:
        axes.plot(t, target, **style)


def _target(test: Test, row: int, flown: Trajectory) -> tuple[Floats, Floats]:
    """Times and values of the target of a state, next to what was flown; one value where it stays."""
    signals = test.family.signals
    if test.target_state.ndim == 1:
        value = _near(test.target_state[row], flown.states[-1, row], signals.states[row])
        return np.zeros(1), np.array([value])
    curve = signals.continued(test.target_state, flown.states[0])[:, row]
    t = np.asarray(signals.dt * np.arange(len(curve)), dtype=np.float64)
    return t, np.asarray(curve, dtype=np.float64)


def _near(value: float, reading: float, state: State) -> float:
    """A value, shifted by whole periods next to a reading where the state is periodic."""
    turns = 0.0 if state.period is None else np.rint((reading - value) / state.period) * state.period
    return float(value + turns)


def _extent(curves: Sequence[Any]) -> tuple[float, float]:
    """Limits that show the real runs and their targets; a twin that diverges must not flatten them."""
    values = np.concatenate(curves)
    low, high = float(values.min()), float(values.max())
    margin = 0.25 * max(high - low, 1e-3)
    return low - margin, high + margin


def _error_lines(axes: Any, errors: Mapping[int, Sequence[tuple[float, float]]], label: str) -> None:
    for i, (test, points) in enumerate(errors.items()):
        shown = [(x, y) for x, y in points if math.isfinite(y) and y > 0.0]
        colour = CYCLE[i % len(CYCLE)]
        axes.plot(
            [x for x, _ in shown], [y for _, y in shown],
            color=colour, marker="o", markersize=4.0, linewidth=1.5, label=f"test {test}",
        )  # fmt: skip
    axes.set_yscale("log")
    axes.set_xlabel("iteration")
    axes.set_ylabel(label)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
