"""`twinloop certify`: the certificate of a controller to fly, with the files that set it and that take it back."""

from __future__ import annotations

from pathlib import Path

import click

from twinloop._ground.writing import write_whole
from twinloop.autopilots import Autopilot
from twinloop.autopilots.files import FORMATS
from twinloop.campaign.certificate import Certificate
from twinloop.errors import InvalidInput
from twinloop.faces.answering import answer, json_option
from twinloop.faces.certificate import facts, page
from twinloop.faces.for_autopilots import for_an_autopilot, prepared
from twinloop.faces.opening import not_kept
from twinloop.faces.result import to_json
from twinloop.store import shown_name


@click.command()
@click.argument("store")
@for_an_autopilot
@json_option
@click.pass_context
def certify(
    context: click.Context,
    store: str,
    output: Path,
    kind: str | None,
    mapping: Path | None,
    name: str | None,
    as_json: bool,
) -> None:
    """Certify the controller to fly of STORE, or give the reasons against it.

    Writes certificate.html and certificate.json into FOLDER and, with --autopilot, first restore.* with the old gains
    and then gains.* with the new ones. If the certificate is refused, it exits with 1, writes no
    parameter file, and removes earlier gains.*.
    """
    given = prepared(store, name, kind, mapping)
    campaign, autopilot = given.campaign, given.autopilot
    unkept = not_kept(store, campaign, given.name)
    found = campaign.certificate()
    texts = _parameter_files(found, autopilot)
    if unkept:
        click.echo(unkept, err=True)
    output.mkdir(parents=True, exist_ok=True)
    # Earlier gains are no longer certified, whatever happens now.
    for suffix in {form.suffix for form in FORMATS.values()}:
        (output / f"gains{suffix}").unlink(missing_ok=True)
    names = {key: file for key, (file, _) in texts.items()}
    certified = facts(campaign, found, shown_name(store), given.name, autopilot, names)
    signals = campaign.signals
    html = page(certified, signals.state_names, [state.unit for state in signals.states])
    # What takes the gains back is there before what sets them, whatever happens between.
    for file, text in texts.values():
        write_whole(output / file, text)
    write_whole(output / "certificate.json", to_json(certified))
    write_whole(output / "certificate.html", html)
    files = [str(output / file) for file, _ in texts.values()]
    sheet = output / "certificate.html"
    text = f"Granted: {'; '.join([str(sheet), *([', '.join(files)] if files else [])])}."
    text = " ".join([text, *found.cautions])
    if not found.granted:
        text = f"Refused. {' '.join(found.refusals)} Details: {sheet}"
    written = [str(sheet), str(output / "certificate.json"), *files]
    answer({"granted": found.granted, "refusals": found.refusals, "files": written}, text, as_json)
    if not found.granted:
        context.exit(1)


def _parameter_files(found: Certificate, autopilot: Autopilot | None) -> dict[str, tuple[str, str]]:
    """Names and texts of the parameter files, the one with the old gains first; none where it is refused."""
    if autopilot is None or not found.granted or found.best is None:
        return {}
    if found.old is None:
        raise InvalidInput(
            "certify: expected a flight that went to its end inside the envelope, whose gains can be restored, found"
            " none; tell one, or leave --autopilot out."
        )
    suffix = autopilot.suffix
    return {
        "restore": (
            f"restore{suffix}",
            autopilot.text(found.old.parameters, "The old gains: load to go back."),
        ),
        "gains": (f"gains{suffix}", autopilot.text(found.best.parameters, "The new gains, as certified.")),
    }
