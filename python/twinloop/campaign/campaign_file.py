"""Campaign files: what a campaign is about, in TOML that a person fills in."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import to_type
from twinloop.autopilots.declared import Declared, declared
from twinloop.campaign import Campaign
from twinloop.campaign.keeping import as_begun, check_setup
from twinloop.campaign.presets import PRESETS
from twinloop.campaign.system_section import SystemSection, said_by, system_section
from twinloop.controllers import Family, UnboundFamily
from twinloop.errors import InvalidInput, NotAvailable, at, unknown
from twinloop.logs import TIME, refuse_others
from twinloop.records import differences, read
from twinloop.signals import Command as Channel
from twinloop.signals import RigidBody, Signals, State
from twinloop.systems import System
from twinloop.systems.named import NAMED, system_named

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

KINEMATICS = '[kinematics] with angles = ["roll", "pitch", "yaw"] and rates = ["p", "q", "r"], names of states of yours'
"""What a file is told to declare where the section is not one."""
MOST_BYTES = 10_000_000
"""Of a campaign file."""
SECTIONS = (
    *("dt", "lags", "states", "commands", "kinematics", "controller", "task", "first", "campaign", "options"),
    *("autopilot", "system", "log"),
)
SIGNALS = ("dt", "states", "commands")
"""Sections of a file that describes a system, whatever else it leaves out."""
WHOLE = (*SIGNALS, "controller", "task", "first")
"""Those of a whole campaign file, where no system says what is left out."""
TASK = ("initial_state", "target_state", "duration")
CAMPAIGN = ("preset", "seed", "goal", "quality", "weights")
TEMPLATE = """\
# A campaign of twinloop. Fill in what your system is, then: {ask}
# Units are SI and radians; names of states and commands become symbols in equations.

dt = 0.05                        # period of the commands, s
# lags = 1                       # if only outputs are measured: the rate of each state is made of its past reading

[states.angle]                   # one section a state, in the order of the state vector
unit = "rad"
scale = 3.14                     # its usual size; ten times this counts as diverged
envelope = [-2.5, 2.5]           # where the system is safe; leave it out if it is everywhere

[states.rate]
unit = "rad/s"
scale = 8.0
derivative_of = "angle"
envelope = [-12.0, 12.0]
# noise = 0.01                   # standard deviation of the sensor, if it is known
# periodic = false               # true: an angle that wraps
# measured = true                # false: no sensor reads it, and records leave it out; it is made of those of angle

# [kinematics]                   # if gyroscopes measure the body rates of roll, pitch and yaw: instead of derivative_of
# angles = ["roll", "pitch", "yaw"]
# rates = ["p", "q", "r"]        # about x, y and z of the body

[commands.torque]                # one section a command
unit = "N m"
bounds = [-2.0, 2.0]             # limits of what is sent

[controller]                     # one PID an axis: pairs of an angle and its rate, or an angle alone
kind = "pid"
axes = [["angle", "rate"]]

[controller.gains]               # bounds [low, high] of each gain, or a number that fixes it
"angle.kp" = [0.0, 6.0]
"angle.ki" = [0.0, 6.0]
"angle.kd" = [0.0, 1.0]

[task]
initial_state = [0.0, 0.0]       # where every test starts
target_state = [1.0, 0.0]        # where every test should end
duration = 1.0                   # of a test, s

[first]                          # the first test: gains of a controller that you trust
"angle.kp" = 2.0
"angle.ki" = 2.0
"angle.kd" = 0.3

# [autopilot]                    # to certify gains: their parameters, with names, scales and limits
# kind = "px4"                   # or "px4-shell", "ardupilot", "betaflight", "ros2", "json"
# [autopilot.parameters]         # parameter = scale * gain + offset
# "angle.kp" = {{ name = "MC_ROLLRATE_P", scale = 0.1, limits = [0.01, 0.5] }}
# "angle.ki" = false             # it has no parameter for this gain
# [autopilot.sweep]              # a sweep that it generates: command, axis, amplitude, first, last (Hz), duration (s)

[campaign]
preset = "default"               # or "paper"
seed = 0
# goal = "both"                  # "control", "model" or "both"
# quality = "iae"                # "iae", "ise" or "final_distance"
# weights = {{ angle = 2.0 }}      # of states in it; by default 1, of rates 0, each in units of its scale

# [log]                          # what t, states and commands are called in logs, where not so: columns of CSV, or of a
#                                # log of PX4 (.ulg) the field of each; q of a topic as angles
# angle = "vehicle_attitude.pitch"
# rate = "vehicle_angular_velocity.xyz[1]"
# torque = "vehicle_torque_setpoint.xyz[1]"

# [system]                       # a system that flies by program: {run}; leave it out if a person flies
# use = "rig:Rig"                # a class in rig.py beside this file, which is run; or a name: {names}
# timeout = 60.0                 # s that a run may take
# [system.arguments]             # its arguments
# noise = 0.001

[options]                        # delay_least is chosen for a real machine; all others are at their default
delay_least = 1.0                # periods of more delay that gains must bear, as a certificate asks; not of "paper"
"""


def template(store: str) -> str:
    """A campaign file to fill in, with every default as a comment.

    Args:
        store: file in which the campaign will be kept, for the first line.
    """
    options = PRESETS["default"]
    lines = [
        f"# {field.name} = {_toml(getattr(options, field.name))}"
        for field in dataclasses.fields(options)
        if field.name != "delay_least"
    ]
    ask, run = to_type("ask", store), to_type("run", Path(store).with_suffix(".toml"))
    return TEMPLATE.format(ask=ask, run=run, names=", ".join(NAMED)) + "\n".join(lines) + "\n"


@dataclasses.dataclass(frozen=True)
class CampaignFile:
    """What a campaign file says.

    Args:
        path: of the file.
        arguments: of the campaign.
        first: gains of the first test, by name.
        flies: what flies by itself; None: a person flies.
        made: that system, where it had to be made to know its signals.
    """

    path: Path
    arguments: Mapping[str, Any]
    first: Mapping[str, float]
    flies: SystemSection | None = None
    made: System | None = None

    def campaign(self, **others: Any) -> Campaign:
        """The campaign.

        Args:
            others: arguments that no file holds, such as `store` or `threads`.

        Raises:
            InvalidInput: gains of `[first]` that the controller has not; the store holds another campaign, or its first
                test has other gains.
        """
        store = others.get("store")
        if self.first and not (store and Path(store).exists()):
            # Before a store is begun that a corrected file would no longer agree with.
            self.first_genes(self.arguments["controller"].bind(self.arguments["signals"]))
        campaign = Campaign(**self.arguments, **others)
        try:
            self._check_first(campaign, campaign.store)
        except InvalidInput:
            campaign.close()
            raise
        return campaign

    def first_genes(self, family: Family) -> Floats:
        """The gains of `[first]` (size,).

        Args:
            family: that they are gains of.

        Raises:
            InvalidInput: gains that it has not.
        """
        with at(f"Campaign file {self.path}, [first]"):
            return family.genes(dict(self.first))

    def check(self, known: Campaign, store: str, name: str) -> None:
        """Refuses a campaign that was begun with something else, in the words of `campaign`.

        Args:
            known: as its store has it.
            store: what messages call the store.
            name: of the campaign in its store.

        Raises:
            InvalidInput: the campaign has another setup, or its first test has other gains.
        """
        asked = Campaign(**self.arguments, threads=1, progress=None)
        check_setup(known.setup, asked.setup, as_begun(store, name))
        self._check_first(known, store)

    def _check_first(self, campaign: Campaign, store: str | None) -> None:
        """Refuses other gains than those of the first test that was made; what a system says of them nobody typed."""
        # One that failed or was abandoned waits for gains of another controller.
        gone = ("failed", "abandoned")
        made = next((test for test in campaign.tests if campaign.status(test) not in gone), None)
        if made is None or made.reason or made.predicted is not None or self.made is not None:
            return  # the first test may be one that was planned from attached flights
        differ = differences({"first": made.parameters}, {"first": {**campaign.family.fixed, **self.first}})
        if differ:
            raise InvalidInput(
                f"Campaign file {self.path}: expected the gains that the first test of {store} was made with,"
                f" found others: {differ}; write those of the store, or copy the file for another campaign."
            )

    def system(self) -> System:
        """What flies by itself; making it may run code of a user's own.

        Raises:
            NotAvailable: the file names none, or a package is missing.
            InvalidInput: no such system, or arguments that it has not.
        """
        if self.made is not None:
            return self.made
        if self.flies is None:
            raise NotAvailable(
                f"File {self.path}: expected a section [system] that names what flies, found none; add it, or fly"
                f" yourself: {to_type('ask', self.path.with_suffix('.db'))}."
            )
        return system_named(
            self.flies.use, self.flies.arguments, self.arguments["signals"], self.path.resolve().parent
        )


def read_file(path: str | Path, begun: System | None = None) -> CampaignFile:
    """Reads a campaign file.

    Args:
        path: of the file.
        begun: stands in for the system of the file, where the file leaves something to it; None: that system is made.

    Returns:
        What it says.

    Raises:
        InvalidInput: no such file, no TOML, an unknown key, or a value that cannot be used.
    """
    path = Path(path)
    found = _toml_of(path)
    if "autopilot" in found:
        declared(found["autopilot"], f"File {path}")
    flies = system_section(found.get("system"))
    if flies is not None and flies.use == "folder" and "log" in found:
        # What writes its logs there calls the columns as it does anywhere.
        named = {"columns": _section(found, "log", None, ())}
        flies = dataclasses.replace(flies, arguments={**named, **flies.arguments})
    described = flies is None or "states" in found
    _keys(found, SECTIONS, WHOLE if flies is None else SIGNALS if described else (), str(path))
    signals = made = None
    if described:
        signals = _signals(found)
    else:
        for key in ("dt", "lags", "commands", "kinematics"):
            if key in found:
                raise InvalidInput(
                    f"Campaign file, {path}: expected [states] beside {key}, found none; add them, or leave {key}"
                    " out and take those of the system."
                )
    if flies is not None and not all(key in found for key in WHOLE):
        made = begun or system_named(flies.use, flies.arguments, signals, path.resolve().parent)
        signals = signals or made.signals
    assert signals is not None  # of the file, or of its system
    every = (TIME, *signals.state_names, *signals.command_names)
    refuse_others(_section(found, "log", None, ()), every, f"under [log] of {path}")
    own = made is not None and "task" not in found
    task = said_by(made, TASK, path) if own else _section(found, "task", TASK, TASK)
    arguments = {
        "signals": signals,
        "controller": _controller(found["controller"], signals)
        if "controller" in found
        else said_by(made, ("controller",), path)["controller"],
        **task,
        **_section(found, "campaign", CAMPAIGN, ()),
        "options": found.get("options", {}),
    }
    first = _section(found, "first", None, ())
    if made is not None and "first" not in found:
        first = dict(said_by(made, ("default_gains",), path)["default_gains"])
    return CampaignFile(path, arguments, first, flies, made)


def said_in(path: str | Path) -> set[str]:
    """Which sections a campaign file has.

    Args:
        path: of the file.

    Raises:
        InvalidInput: no such file, no TOML, or an unknown section.
    """
    return set(_sections_of(path))


def read_signals(path: str | Path) -> tuple[Signals, Mapping[str, Any]]:
    """What a campaign file says of the signals, and its options; other sections need not be there.

    Args:
        path: of the file.

    Raises:
        InvalidInput: no such file, no TOML, an unknown key, or a value that cannot be used.
    """
    found = _sections_of(path, SIGNALS)
    return _signals(found), _section(found, "options", None, ())


def read_fields(path: str | Path) -> Mapping[str, str]:
    """What a campaign file says of the columns or fields of logs, by signal; nothing where it has no [log].

    Args:
        path: of the file.

    Raises:
        InvalidInput: no such file, no TOML, or an unknown section.
    """
    return _section(_sections_of(path), "log", None, ())


def _sections_of(path: str | Path, needed: tuple[str, ...] = ()) -> dict[str, Any]:
    """What a campaign file has, of known sections, and those that are needed among them."""
    found = _toml_of(Path(path))
    _keys(found, SECTIONS, needed, str(path))
    return found


def _signals(found: Mapping[str, Any]) -> Signals:
    return Signals(
        states=_members(found, "states", State),
        commands=_members(found, "commands", Channel),
        dt=found["dt"],
        kinematics=_kinematics(found["kinematics"]) if "kinematics" in found else None,
        lags=found.get("lags", 0),
    )


def _kinematics(value: object) -> RigidBody:
    if not isinstance(value, Mapping):
        raise InvalidInput(
            f"Campaign file, kinematics: expected a section, found {value!r}; write a section {KINEMATICS}."
        )
    _keys(value, ("angles", "rates"), ("angles", "rates"), "[kinematics]")
    with at("Campaign file, [kinematics]"):
        body: RigidBody = _tagged(value, RigidBody)
    return body


def read_autopilot(path: str | Path) -> Declared | None:
    """What a campaign file, or a file of that alone, declares of an autopilot.

    Args:
        path: of the file.

    Returns:
        It, or None where the file has no section [autopilot].

    Raises:
        InvalidInput: no such file, no TOML, an unknown key, or a value that cannot be used.
    """
    path = Path(path)
    found = _toml_of(path)
    _keys(found, SECTIONS, (), str(path))
    return declared(found["autopilot"], f"File {path}") if "autopilot" in found else None


def _toml_of(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InvalidInput(
                f"File {path}: expected a campaign file, found one of more than {MOST_BYTES} bytes."
            )
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as reason:
        raise InvalidInput(
            f"File {path}: expected a campaign file, found {reason.strerror}; check its name."
        ) from reason
    except (ValueError, RecursionError) as reason:
        if isinstance(reason, InvalidInput):
            raise
        raise InvalidInput(f"File {path}: expected TOML, found: {reason}; correct that line.") from reason


def _members(found: Mapping[str, Any], name: str, kind: type[State] | type[Channel]) -> list[Any]:
    members = []
    for key, value in _section(found, name, None, ()).items():
        table = {"name": key, **_table(value, f"{name}.{key}")}
        with at(f"Campaign file, [{name}.{key}]"):
            members.append(_tagged(table, kind))
    return members


def _tagged(table: Any, kind: Any) -> Any:
    record = {"kind": kind.KIND, "version": kind.VERSION, **_table(table, kind.KIND)}
    return kind.from_record(record)


def _controller(table: Any, signals: Signals | None) -> UnboundFamily:
    found = {"version": 1, **_table(table, "controller")}
    if isinstance(found.get("axes"), list):
        axes = [[axis] if isinstance(axis, str) else axis for axis in found["axes"]]
        found["axes"] = [
            [*axis, None] if isinstance(axis, list) and len(axis) == 1 else axis for axis in axes
        ]
        # Gains are named after axes: of a mistyped one its gains are not what is wrong.
        for name in (name for axis in found["axes"] if isinstance(axis, list) for name in axis):
            if signals is not None and isinstance(name, str) and name not in signals.state_names:
                raise unknown("state in the axes of [controller]", name, signals.state_names)
    if isinstance(found.get("output"), Mapping):
        found["output"] = {"kind": "mixer", "version": 1, **found["output"]}
    with at("Campaign file, [controller]"):
        family: UnboundFamily = read(UnboundFamily, found, "controller")
    return family


def _section(
    found: Mapping[str, Any], name: str, keys: tuple[str, ...] | None, needed: tuple[str, ...]
) -> dict[str, Any]:
    table = _table(found.get(name, {}), name)
    if keys is not None:
        _keys(table, keys, needed, f"[{name}]")
    return table


def _table(value: object, where: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InvalidInput(f"Campaign file, {where}: expected a section, found {value!r}; write [{where}].")
    return dict(value)


def _keys(table: Mapping[str, Any], keys: tuple[str, ...], needed: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in keys:
            raise unknown(f"key in {where}", key, keys)
    missing = [key for key in needed if key not in table]
    if missing:
        raise InvalidInput(f"Campaign file, {where}: expected {', '.join(missing)}, found none; add them.")


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(item) for item in value)}]"
    return repr(value)
