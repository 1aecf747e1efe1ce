"""A certificate as a plain dictionary and as one page of HTML, to be printed."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from twinloop import __version__
from twinloop._ground.texts import in_unit
from twinloop.autopilots import Autopilot
from twinloop.campaign import Campaign
from twinloop.campaign.assessment import predicted_quality
from twinloop.campaign.certificate import Certificate
from twinloop.errors import NotAvailable
from twinloop.faces.figures.figure import Band, Line, Mark, Panel
from twinloop.faces.figures.style import DARK, LIGHT, RULES, SCROLL, variables
from twinloop.faces.figures.svg import panel_svg
from twinloop.faces.figures.units import labelled, words
from twinloop.faces.result import plain_dict
from twinloop.faces.text.words import quality_words
from twinloop.planning.leaving import risk_of_what, risk_words
from twinloop.planning.quality import quality_unit


def facts(
    campaign: Campaign,
    found: Certificate,
    store: str,
    name: str,
    autopilot: Autopilot | None,
    files: Mapping[str, str],
) -> dict[str, Any]:
    """A certificate as numbers and texts.

    Args:
        campaign: that it is of.
        found: its certificate.
        store: where the campaign is kept.
        name: of the campaign.
        autopilot: that the gains are for; None: none.
        files: names of the parameter files, as "restore" and "gains"; empty: none was written.

    Returns:
        A plain dictionary; None for a number that is not finite.
    """
    best, quality = found.best, campaign.setup.quality
    result: dict[str, Any] = {
        "kind": "certificate",
        "version": 1,
        "granted": found.granted,
        "refusals": found.refusals,
        "cautions": found.cautions,
        "campaign": {
            "name": name,
            "store": store,
            "preset": campaign.setup.preset,
            "seed": campaign.setup.seed,
            "twinloop": __version__,
        },
        "gains": _gains(found, autopilot),
        "judged_on": {
            "experiments": [
                {"test": run.number, "ended": run.trajectory.ended, "quality": run.quality}
                for run in found.experiments
            ],
            "members": found.members,
            "checks": [{**dataclasses.asdict(check), "verdict": check.verdict} for check in found.checks],
        },
        "margins": None if found.margins is None else dataclasses.asdict(found.margins),
        "prediction": None,
        "envelope": [{**dataclasses.asdict(use), "beyond_flown": use.beyond_flown} for use in found.uses],
        "risk": None if best is None else best.risk,
        "predicted_flights": campaign.setup.predicted_flights,
        "not_tested": found.not_tested,
        "autopilot": None,
    }
    if best is not None and found.step is not None:
        predicted, spread = predicted_quality(best, found.experiments)
        whole = found.step.steps == best.steps
        result["prediction"] = {
            "kind": quality.kind,
            "unit": quality_unit(quality),
            "quality": predicted,
            "spread": spread,
            "measured": best.measured,
            "drawn": quality.flown(found.step, best.target_state) if whole else None,
            "t": found.step.t,
            "states": found.step.states,
            "band": found.step.band,
            "target": best.target_state,
        }
    if autopilot is not None:
        result["autopilot"] = {"kind": autopilot.kind, "files": dict(files), "parameters": []}
        if files and best is not None and found.old is not None:
            old = autopilot.values(found.old.parameters)
            result["autopilot"]["parameters"] = [
                {"name": each, "new": value, "old": old[each]}
                for each, value in autopilot.values(best.parameters).items()
            ]
    return plain_dict(result)


def page(facts: Mapping[str, Any], names: Sequence[str], units: Sequence[str]) -> str:
    """A certificate as HTML, whole in one file.

    Args:
        facts: of the certificate.
        names: of the states.
        units: of the states.

    Raises:
        NotAvailable: Jinja2 is missing.
    """
    try:
        import jinja2
    except ImportError as missing:
        raise NotAvailable(
            "Certificate: expected the package jinja2 to write the page with, found none; pip install"
            " 'twinloop[report]'."
        ) from missing
    room = jinja2.Environment(
        loader=jinja2.PackageLoader("twinloop.faces"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    bounded = any(use["envelope"] is not None for use in facts["envelope"])
    return room.get_template("certificate.html").render(
        c=facts,
        title="Gain certificate" if facts["granted"] else "Gain certificate: refused",
        number=_number,
        quality=quality_words,
        risk=risk_words,
        bounded=bounded,
        what=risk_of_what(bounded),
        degrees=lambda value: None if value is None else math.degrees(value),
        plots=_plots(facts["prediction"], names, units),
        figures=f":root{{{variables(LIGHT)}}}@media (prefers-color-scheme:dark){{:root{{{variables(DARK)}}}}}"
        f"{RULES}{SCROLL}",
    )


def _gains(found: Certificate, autopilot: Autopilot | None) -> list[dict[str, Any]]:
    if found.best is None:
        return []
    old = {} if found.old is None else found.old.parameters
    rows = []
    for gain in found.law_gains:
        parameter = None if autopilot is None else autopilot.parameters.get(gain.name)
        rows.append({
            "name": gain.name,
            "unit": gain.unit,
            "value": found.best.parameters[gain.name],
            "old": old.get(gain.name),
            "low": getattr(gain, "low", None),
            "high": getattr(gain, "high", None),
            "parameter": None if parameter is None else parameter.name,
        })  # fmt: skip
    return rows


def _number(value: float | None) -> str:
    """For a person; what is not finite is without end."""
    return "∞" if value is None else f"{value:.4g}"


def _plots(
    prediction: Mapping[str, Any] | None, names: Sequence[str], units: Sequence[str]
) -> list[dict[str, str]]:
    """Pictures of the predicted states, each with its axes, and the same in words."""
    if prediction is None:
        return []
    t, states = np.array(prediction["t"]), np.array(prediction["states"])
    band = None if prediction["band"] is None else np.array(prediction["band"], dtype=np.float64)
    target = np.broadcast_to(np.array(prediction["target"]), states.shape) if states.size else states
    plots = []
    for i, (name, unit) in enumerate(zip(names, units, strict=True)):
        # In the unit that is declared, as the tables beside them and the sentences below.
        label = labelled(name, unit)
        marks: list[Mark] = (
            [] if band is None else [Band(t, band[0, :, i], band[1, :, i], "twin", "90 % band")]
        )
        marks += [
            Line(t, target[: len(states), i], "target", "target"),
            Line(t, states[:, i], "twin", "twin"),
        ]
        first, last = states[0, i], states[-1, i]
        said = f"from {first:.3g} to {in_unit(f'{last:.3g}', unit)} in {t[-1]:g} s"
        plots.append({"svg": panel_svg(Panel(words(name), marks, "time (s)", label)), "words": said})
    return plots
