"""Whatever a file or a text holds, it is read, or refused in a sentence: nothing else, and not for long.

`TWINLOOP_FUZZ=20000 python -m pytest tests/ground/test_fuzz.py` tries for longer than every change does.
"""

import io
import json
import os
import re
import string
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

import twinloop as tl
from lives import CONTROLLER, SIGNALS, begun
from strategies import programs
from twinloop import _core
from twinloop.campaign.campaign_file import read_file, template
from twinloop.errors import TwinloopError
from twinloop.law.parsing import program_of

MANY = settings(
    max_examples=int(os.environ.get("TWINLOOP_FUZZ", "60")),
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
TEMPLATE = template("rig.db")
VALUES = ["0", "-1", "1e999", "nan", "-inf", "true", '""', '"\\u0000"', "[]", "[[]]", "{}", "[1, [2]]", "1e-300",
          "9" * 400, '"' + "x" * 300 + '"', "1979-05-27", "[nan, nan]", "[3.0, -3.0]", "0x7f",
          "'''a\nb'''"]  # fmt: skip


@st.composite
def damaged(draw, text):
    """A text with lines lost, doubled, exchanged, values replaced and bytes changed."""
    lines = text.splitlines()
    for _ in range(draw(st.integers(0, 4))):
        i = draw(st.integers(0, len(lines) - 1))
        match draw(st.sampled_from(["lose", "double", "exchange", "value", "uncomment", "byte"])):
            case "lose":
                del lines[i]
                lines = lines or [""]
            case "double":
                lines.insert(i, lines[i])
            case "exchange":
                j = draw(st.integers(0, len(lines) - 1))
                lines[i], lines[j] = lines[j], lines[i]
            case "value":
                key, equals, _ = lines[i].partition("=")
                lines[i] = f"{key}{equals} {draw(st.sampled_from(VALUES))}"
            case "uncomment":
                lines[i] = lines[i].removeprefix("# ")
            case "byte":
                at = draw(st.integers(0, max(0, len(lines[i]) - 1)))
                lines[i] = lines[i][:at] + draw(st.characters(codec="utf-8")) + lines[i][at + 1 :]
    return "\n".join(lines)


def refused(call):
    """What a call gives; None where it is refused in a sentence. Anything else fails the test."""
    try:
        return call()
    except TwinloopError as refusal:
        assert str(refusal).strip() and "Traceback" not in str(refusal)
        return None


@MANY
@given(damaged(TEMPLATE))
def test_a_damaged_campaign_file_is_a_campaign_or_refused(tmp_path, text):
    path = tmp_path / "rig.toml"
    path.write_text(text, encoding="utf-8")
    found = refused(lambda: read_file(path))
    if found is not None:
        campaign = refused(lambda: found.campaign(threads=1))
        assert campaign is None or campaign.signals.n_x >= 1


@MANY
@given(st.binary(max_size=300))
def test_any_bytes_are_no_campaign_file(tmp_path, content):
    path = tmp_path / "rig.toml"
    path.write_bytes(content)
    assert refused(lambda: read_file(path)) is None


FORMULAS = st.recursive(
    st.sampled_from(
        ["a", "b", "c", "1", "-2.5", "1e308", "1e999", "0", "1e-320", "()", "a.b", "__import__('os')", "2**9999"]
    ),
    lambda inner: st.one_of(
        st.tuples(
            inner, st.sampled_from([*"+-*/", "**", "^", "//", "%", "@", ",", "if a else", ""]), inner
        ).map(" ".join),
        st.tuples(st.sampled_from(["sin", "abs", "sqrt", "exp", "min", "open", "-", "+", "~", "lambda:"]), inner).map(
            lambda parts: f"{parts[0]}({parts[1]})"
        ),
    ),
    max_leaves=12,
)  # fmt: skip


@MANY
@given(FORMULAS | st.text(string.printable, max_size=80))
def test_a_formula_is_a_program_or_refused(text):
    program = refused(lambda: program_of([text], {"a": 0, "b": 1}, 2))
    assert program is None or isinstance(program, _core.Program)


# The text of a program


WORDS = ["r0", "r1", "r9", "r99", "r-1", "0.5", "-2.5e-3", "1e999", "nan", "0x1p3", "+", "-", "*", "/", "min", "sin",
         "tanh", "pow", "=", "(", ")", ",", "page", "page 1", "page 2", "inputs=2", "outputs=0", "registers=4000000000",
         "program", "∞", ""]  # fmt: skip


@st.composite
def program_texts(draw):
    """What a program is written as, by the grammar; in most of them some words or lines are others."""
    lines = str(draw(programs(pages=3, page_length=4))).splitlines()
    for _ in range(draw(st.integers(0, 2))):
        i = draw(st.integers(0, len(lines) - 1))
        match draw(st.sampled_from(["word", "word", "swap", "lose", "double", "space", "character"])):
            case "word":
                words = lines[i].split(" ")
                words[draw(st.integers(0, len(words) - 1))] = draw(st.sampled_from(WORDS))
                lines[i] = " ".join(words)
            case "swap":
                j = draw(st.integers(0, len(lines) - 1))
                lines[i], lines[j] = lines[j], lines[i]
            case "lose":
                lines = [*lines[:i], *lines[i + 1 :]] or [""]
            case "double":
                lines.insert(i, lines[i])
            case "space":
                lines[i] = f"\t {lines[i]}  "
            case "character":
                at = draw(st.integers(0, max(0, len(lines[i]) - 1)))
                lines[i] = lines[i][:at] + draw(st.characters(codec="utf-8")) + lines[i][at + 1 :]
    return "\n".join(lines)


def parsed(text):
    """A program; None where it is refused by the number of the line."""
    try:
        return _core.Program.parse(text)
    except ValueError as refusal:
        assert re.search(r"\bexpected\b", str(refusal)), str(refusal)
        return None


def reads_back(text):
    """Whether a text is a program; one that is has a text of its own, which reads back to it and runs as it does."""
    program = parsed(text)
    if program is None:
        return False
    again = _core.Program.parse(str(program))
    rows = np.linspace(-2.0, 2.0, 3 * program.inputs).reshape(3, program.inputs)
    assert again == program and str(again) == str(program)
    assert again.run(rows).tobytes() == program.run(rows).tobytes()
    return True


@MANY
@given(program_texts() | st.text(max_size=80))
def test_a_text_is_a_program_that_reads_back_or_refused(text):
    reads_back(text)


def test_many_of_the_texts_that_are_tried_are_programs_and_many_are_not():
    """Else the test above would try one of the two only; which texts these are does not change from run to run."""
    outcomes = []

    @seed(7)
    @settings(max_examples=200, database=None, suppress_health_check=list(HealthCheck))
    @given(program_texts())
    def tried(text):
        outcomes.append((reads_back(text), len(text.splitlines())))

    tried()
    programs_found = [length for whole, length in outcomes if whole]
    assert 0.3 < len(programs_found) / len(outcomes) < 0.9
    # And these are no empty ones: a header, a page, and instructions.
    assert sum(length > 4 for length in programs_found) > 0.15 * len(outcomes)


@MANY
@given(program_texts())
def test_the_text_of_a_program_is_no_formula(text):
    # One line may be left of it, such as "- 1".
    assert refused(lambda: program_of([text], {"a": 0, "b": 1}, 2)) is None or "\n" not in text.strip()


RECORD = begun().to_record()


@st.composite
def changed(draw, record):
    """A record with values replaced, somewhere."""
    copy = json.loads(json.dumps(record))
    for _ in range(draw(st.integers(1, 3))):
        place, key = copy, None
        parent = None
        while isinstance(place, dict | list) and place:
            parent, key = (
                place,
                draw(
                    st.sampled_from(sorted(place))
                    if isinstance(place, dict)
                    else st.integers(0, len(place) - 1)
                ),
            )
            place = parent[key]
            if draw(st.integers(0, 9)) == 0:
                break
        if parent is not None:
            parent[key] = draw(
                st.sampled_from([None, 0, -1, 1e308, 2**70, "", "nan", "x" * 50, [], {}, [[1]], True, "∞"])
            )
    return copy


@MANY
@given(changed(RECORD))
def test_a_changed_record_is_a_campaign_or_refused(record):
    campaign = refused(lambda: tl.Campaign.from_record(record, threads=1))
    assert campaign is None or len(campaign.experiments) <= 1


LOG = "t,angle,rate,torque\n0.0,0.1,0.2,0.3\n0.05,0.1,0.2,0.3\n0.10,0.1,0.2,\n"
CELLS = ["", "nan", "inf", "1e999", "1_0", "0x1p3", "٣", '"', '"a', "1;2", " ", "1e-5", "-0", "#", "\x00"]


@st.composite
def logs(draw):
    rows = [line.split(",") for line in LOG.splitlines()]
    for _ in range(draw(st.integers(0, 4))):
        row = draw(st.sampled_from(rows))
        row[draw(st.integers(0, len(row) - 1))] = draw(st.sampled_from(CELLS) | st.text(max_size=8))
    return draw(st.sampled_from([",", ";", "\t", "|"])).join(["t", "angle", "rate", "torque"]) + "\n" + "\n".join(
        draw(st.sampled_from([",", ";"])).join(row) for row in rows[1:]
    ) if draw(st.booleans()) else "\n".join(",".join(row) for row in rows)  # fmt: skip


@MANY
@given(logs() | st.text(max_size=200))
def test_a_log_is_a_trajectory_of_numbers_or_refused(tmp_path, text):
    path = tmp_path / "flight.csv"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    run = refused(lambda: tl.load(path, SIGNALS))
    assert run is None or run.states.shape == (run.steps + 1, SIGNALS.n_x)


@MANY
@given(st.data())
def test_a_file_of_numpy_is_a_trajectory_or_refused(tmp_path, data):
    buffer = io.BytesIO()
    t = 0.05 * np.arange(4)
    np.savez_compressed(buffer, t=t, states=np.zeros((4, 2)), commands=np.zeros((3, 1)))
    content = bytearray(buffer.getvalue())
    for _ in range(data.draw(st.integers(0, 6))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / "flight.npz"
    path.write_bytes(
        bytes(content[: data.draw(st.integers(0, len(content)))]) if data.draw(st.booleans()) else content
    )
    run = refused(lambda: tl.load(path, SIGNALS))
    assert run is None or run.steps == 3


def test_a_small_file_that_unpacks_to_a_huge_one_is_refused(tmp_path):
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("t", "states", "commands"):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                for _ in range(5):
                    member.write(bytes(2**24))
    assert path.stat().st_size < 10_000_000
    with pytest.raises(tl.InvalidInput, match="bytes"):
        tl.load(path, SIGNALS)


def test_a_log_without_end_is_refused(tmp_path):
    path = tmp_path / "long.csv"
    with path.open("wb") as file:
        file.write(LOG.encode())
        file.truncate(300_000_000)
    with pytest.raises(tl.InvalidInput, match="bytes"):
        tl.load(path, SIGNALS)


@pytest.mark.parametrize("name", ["nearness", "quality_weights"])
def test_an_option_beyond_all_floats_is_refused(name):
    huge = 10**400 if name == "nearness" else [10**400]
    with pytest.raises(tl.InvalidInput, match=name):
        begun(options={name: huge})


def test_the_template_itself_is_a_campaign(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(TEMPLATE, encoding="utf-8")
    campaign = read_file(path).campaign(threads=1)
    assert campaign.signals.n_x == SIGNALS.n_x
    assert [gain.name for gain in campaign.family.gains] == [
        gain.name for gain in CONTROLLER.bind(SIGNALS).gains
    ]
