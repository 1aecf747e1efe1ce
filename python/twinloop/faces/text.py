"""Results as text for a terminal: equations, gains, errors, and the best controller beside the first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

A_DAY = 86_400.0
"""Seconds: what takes longer to fade does not fade within a flight."""


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Columns of text, the first to the left, the others to the right.

    Args:
        head: title of each column.
        rows: cells; a float gets four digits, None a dash.

    Returns:
        Lines of equal width.
    """
    cells = [list(head), *[[cell(value) for value in row] for row in rows]]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head))]
    lines = [
        "  ".join(
            text.ljust(width) if i == 0 else text.rjust(width)
            for i, (text, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in cells
    ]
    lines.insert(1, "  ".join("─" * width for width in widths))
    return "\n".join(line.rstrip() for line in lines)


def cell(value: object) -> str:
    """A value as it appears in a table."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def render(result: Mapping[str, Any], state: str | None = None) -> str:
    """The result of a campaign, for a person.

    Args:
        result: a `twinloop.faces.result.summary`.
        state: words before the number of its experiments; None: that it was interrupted, or has finished.

    Returns:
        Text.
    """
    if "advice" in result:
        parts = [
            _title(result, state),
            verdict(result),
            _twin(result),
            _states(result),
            _identified_errors(result),
            _flights(result),
            _controller_to_fly(result),
            _advice(result),
            _time(result),
        ]
    else:
        parts = [
            _title(result, state),
            verdict(result),
            _twin(result),
            _errors(result),
            _controller(result),
            _remarks(result),
        ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _title(result: Mapping[str, Any], state: str | None) -> str:
    runs = len(result["experiments"])
    if state is None:
        state = "interrupted, best so far after" if result["interrupted"] else "finished after"
    flown = f"{runs} experiment{'s' if runs != 1 else ''}"
    return f"{result['system']['name']}, preset {result['preset']}, seed {result['seed']}: {state} {flown}"


def verdict(result: Mapping[str, Any]) -> str:
    """A campaign in three lines: its twin, its controller, what next.

    Args:
        result: a `twinloop.faces.result.summary`.

    Returns:
        Text.
    """
    return f"Twin: {_verdict_on_twin(result)}\nController: {_verdict_on_controller(result)}\nNext: {_next(result)}"


def _verdict_on_twin(result: Mapping[str, Any]) -> str:
    remarks = result["twin"].get("remarks", ())
    grave = [
        remark["sentence"]
        for remark in remarks
        if isinstance(remark, dict) and remark["severity"] == "serious"
    ]
    if grave:
        more = f" There are {len(grave) - 1} more serious remarks." if len(grave) > 1 else ""
        return f"not to be believed yet. {grave[0]}{more}"
    worst = max(
        (run["normalised"] for run in result["experiments"] if run["normalised"] is not None), default=None
    )
    runs = len(result["experiments"])
    flights = f"{runs} flight{'s' if runs > 1 else ''}"
    return f"normalised error of {flights} at most {cell(worst)} (0 is perfect, 1 a model that never moves)."


def _verdict_on_controller(result: Mapping[str, Any]) -> str:
    best, first = result["controller"], result["first_controller"]
    if best is None:
        return f"none to fly: {result['no_controller'].removeprefix('No controller to fly: ')}"
    measure = result["quality"]
    words = quality_words(measure["kind"], measure["unit"])
    found = f"measured {cell(best['measured'])}" if best["measured"] is not None else "not measured yet"
    before = "" if first is None else f"; the first one: measured {cell(first['measured'])}"
    return f"test {best['test']}, {words} predicted {cell(best['predicted'])}, {found}{before}."


def _next(result: Mapping[str, Any]) -> str:
    advice = result.get("advice")
    if result["controller"] is None:
        return "fly another controller that you trust, and look into the remarks."
    if advice is None:
        return "fly another test, or this controller; the preset paper does not say what a test would bring."
    if advice["gain"] is None or (advice["trusted"] and advice["stop"] is None):
        return "ask for a flight to hear what it would bring."
    if not advice["trusted"]:
        return "look into the remarks, then fly another test: the twin cannot say what it would bring."
    if advice["stop"]:
        return "stop; another flight would bring no more than one measurement scatters."
    return f"another flight may bring {_with_unit(advice['gain'], result['quality']['unit'])}."


def _twin(result: Mapping[str, Any]) -> str:
    return "TWIN\n" + "\n".join(result["twin"]["equations"])


def _errors(result: Mapping[str, Any]) -> str:
    head = [
        "test",
        "ended",
        "open loop",
        "closed loop",
        "normalised",
        "before learning",
        "predicted δ",
        "measured δ",
    ]
    keys = ("test", "ended", "open_loop", "closed_loop", "normalised", "before", "predicted", "measured")
    rows = [[run[key] for key in keys] for run in result["experiments"]]
    note = (
        "Errors are mean squares over steps and states, SI units; normalised: 1 is a model that never"
        " moves.\nδ is the distance of the last state to the target."
    )
    return "ERRORS OF THE TWIN, ONE ROW A TEST\n" + table(head, rows) + "\n" + note


def _gains(best: Mapping[str, Any], first: Mapping[str, Any] | None) -> list[list[object]]:
    """A row a gain: name, value, the first controller's, unit, bounds."""
    return [
        [
            gain["name"],
            gain["value"],
            None if first is None else first["gains"][gain["name"]],
            gain["unit"],
            "fixed"
            if gain["low"] is None
            else f"{gain['low']:g} to {gain['high']:g}" + (f", {held_at(gain)}" if held_at(gain) else ""),
        ]
        for gain in best["gains"]
    ]


def held_at(gain: Mapping[str, Any]) -> str:
    """Where a gain of a result stands at a bound, for a person.

    Args:
        gain: of the controller; results of before this was told have none of it.

    Returns:
        "at its upper bound", "at its lower bound" or "".
    """
    return f"at its {gain['at_bound']} bound" if gain.get("at_bound") else ""


def _controller(result: Mapping[str, Any]) -> str:
    best, first = result["controller"], result["first_controller"]
    rows = _gains(best, first)
    measured, reference = best["measured"], first["measured"]
    quality = (
        f"Final distance on the system: {cell(measured)}; first controller: {cell(reference)}; "
        f"doing nothing: {result['task']['distance']:.4g}; predicted by the twin: {cell(best['predicted'])}."
    )
    title = f"BEST CONTROLLER FLOWN: TEST {best['test']}"
    return f"{title}\n{table(['gain', 'value', 'first', 'unit', 'bounds'], rows)}\n{quality}"


def _remarks(result: Mapping[str, Any]) -> str:
    remarks = []
    last = result["iterations"][-1]
    flat = [loop["test"] for iteration in result["iterations"] for loop in iteration["asked"] if loop["flat"]]
    if flat:
        remarks.append(
            f"The best model ignored the commands when test{'s' if len(flat) > 1 else ''} "
            f"{', '.join(str(test) for test in flat)} {'were' if len(flat) > 1 else 'was'} chosen."
        )
    capped = sum(iteration["capped_generations"] for iteration in result["iterations"])
    if capped:
        remarks.append(f"The non-dominated set was at its cap in {capped} generations.")
    poor = [
        run["test"] for run in result["experiments"] if run["normalised"] is None or run["normalised"] > 1.0
    ]
    if poor:
        remarks.append(
            f"On test{'s' if len(poor) > 1 else ''} {', '.join(str(test) for test in poor)} the twin is no"
            " better than a model that never moves: give it more generations."
        )
    remarks.append(
        f"Iteration {last['iteration']}, {last['generations']} generations, {last['archive_size']}"
        f" non-dominated models, {100 * last['intron_share']:.0f} % introns, {last['evaluations']}"
        f" evaluations, {last['spared']} spared."
    )
    remarks += [line for line in [_time(result)] if line]
    return "\n".join(remarks)


def _time(result: Mapping[str, Any]) -> str:
    seconds = result["run_info"].get("seconds")
    if not isinstance(seconds, float):
        return ""
    return f"{seconds:.1f} s on {result['run_info']['threads']} threads."


# The preset "default"

QUALITIES = {
    "iae": "integrated absolute error",
    "ise": "integrated squared error",
    "final_distance": "distance of the last state to the target",
}


def _states(result: Mapping[str, Any]) -> str:
    twin = result["twin"]
    rows = [
        [
            state["name"],
            state["unit"] or "1",
            state["error"],
            state["sensor"],
            None if not state["sensor"] or state["error"] is None else state["error"] / state["sensor"],
        ]
        for state in twin["states"]
    ]
    head = ["state", "unit", "error of the twin", "noise of the sensor", "ratio"]
    lines = [
        "WHAT THE TWIN LEAVES, STATE BY STATE",
        table(head, rows),
        "Errors: root mean square of flown minus simulated, over whole flights, each from where it began."
        " Noise:\nstandard deviation, as estimated. A ratio of 1 is a twin that leaves the sensors' noise alone.",
        _disturbances(twin["disturbances"]),
        _actuators(twin["actuators"]),
        *(_hidden(state) for state in twin["hidden"]),
        f"{twin['terms']} terms, {twin['committee']} models in the committee; χ² a reading {cell(twin['misfit'])}"
        f" (1: noise and disturbances explain what is left)\nover {twin['readings']} readings,"
        f" {twin['ignored']} ignored.",
        *(remark["sentence"] if isinstance(remark, dict) else str(remark) for remark in twin["remarks"]),
    ]
    return "\n".join(lines)


def _disturbances(disturbances: Sequence[Mapping[str, Any]]) -> str:
    if not disturbances:
        return "Disturbances: none were found beside the sensors' noise."
    words = []
    for found in disturbances:
        name, unit = found["name"], found["unit"] or "1"
        parts = [f"{found['white']:.2g} {unit} a period"] if found["white"] else []
        if found["lasting"]:
            parts.append(f"{found['lasting']:.2g} ({unit})/s that lasts {found['memory']:.2g} s")
        words.append(f"{name} {' and '.join(parts)}")
    return f"Disturbances (standard deviations): {'; '.join(words)}."


def _actuators(actuators: Sequence[Mapping[str, Any]]) -> str:
    """Lags and delays in words; commands that have the same are named together."""
    groups: dict[tuple[float, int], list[str]] = {}
    for actuator in actuators:
        groups.setdefault((actuator["lag"], actuator["delay"]), []).append(actuator["name"])
    if list(groups) == [(0.0, 0)]:
        return "Actuators: no lag and no delay were found."
    words = []
    for (lag, delay), names in groups.items():
        slow = f"lag {lag:.3g} s" if lag else "no lag"
        late = f"delay {delay} period{'s' if delay != 1 else ''}" if delay else "no delay"
        words.append(f"{', '.join(names)}: {slow}, {late}")
    return f"Actuators: {'; '.join(words)}."


def _hidden(state: Mapping[str, Any]) -> str:
    """A state that no sensor reads, in words."""
    what = "squares" if state["squared"] else "values"
    fading = f"forgotten to 1/e in {state['time']:.3g} s" if state["time"] < A_DAY else "not forgotten"
    return f"Hidden: the {what} of {', '.join(state['commands'])} fill a state that no sensor reads; it is {fading}."


def _identified_errors(result: Mapping[str, Any]) -> str:
    head = ["test", "ended", "one step", "whole flight", "normalised", "before learning"]
    rows = [
        [
            run["test"],
            run["ended"],
            run["open_loop"],
            run["closed_loop"],
            run["normalised"],
            run["normalised_before"],
        ]
        for run in result["experiments"]
    ]
    note = (
        f"Mean squares over steps and states ({_squares(result)}), to the noisy readings. Normalised: over that of a"
        " model that\nnever moves; 1 is useless. Before learning: the same, of the twin that had not seen the flight."
    )
    return "ERRORS OF THE TWIN, ONE ROW A TEST\n" + table(head, rows) + "\n" + note


def _flights(result: Mapping[str, Any]) -> str:
    head = ["test", "predicted", "± spread", "flown", "predicted − flown", "risk"]
    keys = ("test", "predicted", "spread", "measured", "predicted_minus_measured", "risk")
    rows = [[run[key] for key in keys] for run in result["experiments"]]
    reasons = [
        _of_run(run) + (f" It was cut: {run['reason']}." if run["reason"] else "")
        for run in result["experiments"]
    ]
    reasons += [
        f"Test {failure['test']} failed: {failure['reason']}." for failure in result.get("failures", ())
    ]
    measure = result["quality"]
    title = (
        f"FLIGHTS\nQuality: {quality_words(measure['kind'], measure['unit'])}; less is better.\n"
        f"What counts: {counted(measure)}."
    )
    note = (
        "Spread: standard deviation that the measured quality is expected to have.\nRisk: probability that the flight"
        " leaves the envelope."
    )
    return "\n".join([title, table(head, rows), note, *reasons])


def _of_run(run: Mapping[str, Any]) -> str:
    if run["test"] is None:
        return f"A run of {run['steps']} steps that nobody asked for."
    return f"Test {run['test']}: {run['why'] or _own(run)}"


def _own(run: Mapping[str, Any]) -> str:
    return "Gains of your own" + (", gently excited." if run["excited"] else ".")


def _controller_to_fly(result: Mapping[str, Any]) -> str:
    best, first = result["controller"], result["first_controller"]
    if best is None:
        return f"NO CONTROLLER TO FLY\n{result['no_controller'].removeprefix('No controller to fly: ')}"
    gains = _gains(best, first)
    state = f"TEST {best['test']}, FLOWN" if best["flown"] else "NOT FLOWN YET"
    qualities = [["this controller", best["predicted"], best["spread"], best["measured"]]]
    if first is not None:
        qualities.append(["first controller", first["predicted"], None, first["measured"]])
    gently = any(run["excited"] for run in result["experiments"][:1])
    excited = "\nThe first controller was excited when it was flown." if gently else ""
    return "\n".join(
        [
            f"CONTROLLER TO FLY: {state}",
            table(["gain", "value", "first", "unit", "bounds"], gains),
            "",
            table(["quality", "predicted", "± spread", "measured"], qualities),
            f"{best['why']} Risk {cell(best['risk'])}.{excited}",
        ]
    )


def _advice(result: Mapping[str, Any]) -> str:
    advice, unit = result["advice"], result["quality"]["unit"]
    title = "ANOTHER EXPERIMENT?\n"
    scatter = advice["scatter"]
    if advice["gain"] is None:
        return title + "No committee was asked for a flight yet; ask for one to hear what it would bring."
    if not advice["trusted"]:
        return f"{title}Flown by itself the model does not follow what it was learnt from: it cannot say. Fly another."
    share = f", {100.0 * advice['share']:.2g} % of what it is now" if advice["share"] is not None else ""
    words = f"{title}When test {advice['before_test']} was planned, knowing which model is right would"
    size = None if scatter is None else _with_unit(scatter, unit)
    if advice["gain"] == 0.0:
        stop = " For the controller, stop." if advice["stop"] else ""
        scattered = "" if size is None else f"\nThe scatter of one measurement is {size}."
        return f"{words} not have improved\nthe quality.{stop}{scattered}"
    words += f" have improved the quality\nby {_with_unit(advice['gain'], unit)}{share}."
    if size is None:
        return words
    if advice["stop"]:
        return f"{words}\nThat is below the scatter of one measurement, {size}. For the controller, stop."
    return f"{words}\nThat is above the scatter of one measurement, {size}: another experiment may pay."


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.2g} {unit}".rstrip()


def quality_words(kind: str, unit: str) -> str:
    """What is minimised, for a person.

    Args:
        kind: "iae", "ise" or "final_distance".
        unit: of it; "" where it has none.

    Returns:
        Such as "integrated absolute error (rad s)".
    """
    return QUALITIES[kind] + (f" ({unit})" if unit else "")


def counted(measure: Mapping[str, Any]) -> str:
    """What counts in a quality, with weights and units, for a person.

    Args:
        measure: `quality` of a result.

    Returns:
        Such as "2 × pitch (rad), 1 × yaw (rad)".
    """
    squared = "" if measure["kind"] == "iae" else "²"
    parts = [
        f"{each['weight']:.4g} × {each['name']}{squared} ({each['unit'] or '1'})"
        for each in measure["counts"]
    ]
    efforts = (("effort", "commands²"), ("effort_rate", "their rates²"))
    parts += [f"{measure[key]:.4g} × {what} (in scales)" for key, what in efforts if measure[key]]
    return ", ".join(parts)


def _squares(result: Mapping[str, Any]) -> str:
    units = dict.fromkeys(state["unit"] or "1" for state in result["signals"]["states"])
    return ", ".join(f"({unit})²" if "/" in unit or " " in unit else f"{unit}²" for unit in units)
