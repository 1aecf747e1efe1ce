"""The twin around the target: frequency responses, Nyquist curves and the gang of four, with the whole committee."""

from __future__ import annotations

import numpy as np

from twinloop.campaign.examination.examination import Examination
from twinloop.faces.figures.figure import Figure, Level, Line, Panel
from twinloop.faces.figures.units import words

ROLES = ("a", "b", "c", "d", "e", "f")


def bode(found: Examination) -> Figure | None:
    """The twin linearised at the target over what the flights show, faint where these do not cohere."""
    if not found.responses:
        return None
    panels = []
    for each in found.responses:
        title = f"{words(each.input)} → {words(each.state)}"
        twin = each.twin[0]
        scale = float(np.abs(twin).max()) or 1.0
        members = [Line(each.frequencies, np.abs(g) / scale, "twin", faint=True) for g in each.twin[1:]]
        size = [*members, Line(each.frequencies, np.abs(twin) / scale, "twin", "twin (pale: committee)")]
        turn = [Line(each.frequencies, _degrees(twin), "twin")]
        if each.flown is not None:
            i, j = each.place
            gains, coherence = each.flown.gains[:, j, i], each.flown.coherence[:, j]
            good = coherence > each.flown.needed
            for rows, faint, name in ((good, False, "flights (pale: not coherent)"), (~good, True, "")):
                at = each.flown.frequencies[rows]
                size.append(
                    Line(at, np.abs(gains[rows]) / scale, "measured", name, joined=False, faint=faint)
                )
                near = np.interp(np.log(at), np.log(each.frequencies), _degrees(twin))
                angle = np.rad2deg(np.angle(gains[rows]))
                turned = angle + 360.0 * np.rint((near - angle) / 360.0)
                turn.append(Line(at, turned, "measured", joined=False, faint=faint))
        panels += [
            Panel(f"{title}: gain", size, "frequency (rad/s)", "gain, largest = 1", x_log=True, y_log=True),
            Panel(f"{title}: phase", turn, "frequency (rad/s)", "phase (°)", x_log=True),
        ]
    return Figure(
        "bode",
        "Frequency response of the twin, and of the flights",
        panels,
        "The twin is linearised at the target, the flights are whole manoeuvres: far from the target the two may"
        " differ. Dots are pale where the flights and the commands are not coherent, or where the sensors' noise is too"
        " large a share of the reading: in closed loop noise goes back into the commands there."
        f"{_of_friction(found)}",
        columns=2,
    )


def nyquist(found: Examination) -> Figure | None:
    """Each loop in the complex plane, with the committee and the circle of Ms = 2."""
    if not found.loops:
        return None
    turn = np.linspace(0.0, 2.0 * np.pi, 97)
    panels = []
    for each in found.loops:
        near = np.abs(each.open) < 6.0
        members = [
            Line(np.where(ok, g.real, np.nan), np.where(ok, g.imag, np.nan), "twin", faint=True)
            for g, ok in zip(each.open[1:], near[1:], strict=True)
        ]
        twin = each.open[0]
        marks = [
            Line(-1.0 + 0.5 * np.cos(turn), 0.5 * np.sin(turn), "limit", "Ms = 2"),
            *members,
            Line(
                np.where(near[0], twin.real, np.nan),
                np.where(near[0], twin.imag, np.nan),
                "twin",
                "twin (pale: committee)",
            ),
            Line([-1.0], [0.0], "limit", "−1", joined=False),
        ]
        panels.append(
            Panel(
                words(each.loop),
                marks,
                "real",
                "imaginary",
                x_range=(-3.2, 1.2),
                y_range=(-1.8, 1.0),
                equal=True,
            )
        )
    return Figure(
        "nyquist",
        "Nyquist curves of the loops",
        panels,
        "Each loop is broken at one place while the others stay closed. A curve outside of the circle keeps the"
        f" sensitivity below 2.{_of_friction(found)}",
    )


def sensitivities(found: Examination) -> Figure | None:
    """Sensitivity and complementary sensitivity of each loop."""
    if not found.loops:
        return None
    panels = []
    for each in found.loops:
        members = [Line(each.frequencies, s, "twin", faint=True) for s in each.sensitivity[1:]]
        panels.append(
            Panel(
                f"{words(each.loop)}: S and T",
                [
                    *members,
                    Line(each.frequencies, each.sensitivity[0], "twin", "|S| (pale: committee)"),
                    Line(each.frequencies, each.complementary[0], "c", "|T|"),
                    Level(2.0, "limit", "2"),
                ],
                "frequency (rad/s)",
                "gain",
                x_log=True,
                y_log=True,
                y_range=(1e-3, max(4.0, 1.2 * float(each.sensitivity.max()))),
            )
        )
    return Figure(
        "sensitivities",
        "Sensitivity and complementary sensitivity",
        panels,
        "S: how feedback changes a disturbance, above 1 where it amplifies it; T: how the loop follows its target."
        f"{_of_friction(found)}",
    )


def closed(found: Examination) -> Figure | None:
    """The rest of the gang of four: what noise does to the commands, and disturbances to the states."""
    if found.closed is None:
        return None
    curves, signals = found.closed, found.signals
    x_label, panels = "frequency (rad/s)", []
    for title, label, rows, names in (
        ("C S: sensors' noise → commands", "half ranges per scale", curves.of_noise, signals.command_names),
        (
            "P S: disturbance of commands → states",
            "scales per half range",
            curves.of_disturbances,
            signals.state_names,
        ),
    ):
        most = float(rows.max())
        lines = [
            Line(curves.frequencies, row, ROLES[i % len(ROLES)], words(name))
            for i, (row, name) in enumerate(zip(rows, names, strict=True))
        ]
        ends = (1e-4 * most, 2.0 * most) if most > 0.0 else None
        panels.append(Panel(title, lines, x_label, label, x_log=True, y_log=True, y_range=ends))
    return Figure(
        "closed",
        "Effect of noise and disturbances",
        panels,
        "With all loops closed, root sum of squares over the states' sensors, and over the commands; in units of the"
        f" states' scales and the commands' half ranges.{' Dry friction slides.' if found.has_friction else ''}",
        columns=2,
    )


def _of_friction(found: Examination) -> str:
    """What is drawn of dry friction."""
    return (
        " The twin's dry friction slides; a second bundle of lines is of all models as it sticks."
        if found.has_friction
        else ""
    )


def _degrees(gains: np.ndarray) -> np.ndarray:
    """Phase without jumps, in degrees."""
    return np.asarray(np.rad2deg(np.unwrap(np.angle(gains))))
