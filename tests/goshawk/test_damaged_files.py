"""Files damaged in ways that Hypothesis thinks of: never a traceback, whatever the damage."""

import json
import tomllib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.goshawk.typing_in import attempt, last_sentence

V, M = "--vehicle vehicle.toml", "--map map"
KINDS = {
    # file: the line that reads it
    "w.json": f"plan w.json {M} {V} --out new.json --margin 1e6",
    "t.json": f"check t.json {M} {V}",
    "v.toml": "vehicle show v.toml",
    "map.toml": "log good.csv --columns map.toml",
    "f.csv": "log f.csv --columns map_good.toml",
    "f.parquet": "log f.parquet",
}
SOURCES = {
    "w.json": "waypoints.json",
    "t.json": "t_good.json",
    "v.toml": "vehicle.toml",
    "map.toml": "map_good.toml",
    "f.csv": "good.csv",
    "f.parquet": "good.parquet",
}
WORDS = [
    b"null",
    b"nan",
    b"1e999",
    b"-1",
    b'"',
    b"[",
    b"{}",
    b"true",
    b"\xff",
    b"\0",
    b"\n",
    b",",
    b"99999999999999999999",
]


@st.composite
def damages(draw: st.DrawFn) -> list[tuple[str, float, float, bytes]]:
    """What is done to a file's bytes: cut out, repeated, or replaced by a word, at places given as shares of it."""
    one = st.tuples(
        st.sampled_from(["cut", "repeat", "word", "end"]),
        st.floats(0.0, 1.0),
        st.floats(0.0, 0.05),
        st.sampled_from(WORDS),
    )
    return draw(st.lists(one, min_size=1, max_size=4))


def damaged(data: bytes, damage: list[tuple[str, float, float, bytes]]) -> bytes:
    for kind, place, share, word in damage:
        at, much = int(place * len(data)), 1 + int(share * len(data))
        if kind == "cut":
            data = data[:at] + data[at + much :]
        elif kind == "repeat":
            data = data[: at + much] + data[at:]
        elif kind == "word":
            data = data[:at] + word + data[at + len(word) :]
        else:
            data = data[:at]
    return data


@pytest.mark.parametrize("file", SOURCES)
@settings(max_examples=25, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(damage=damages())
def test_no_damage_to_a_file_ends_in_a_traceback(folder, file, damage):
    (folder / file).write_bytes(damaged((folder / SOURCES[file]).read_bytes(), damage))
    code, out, errors = attempt(folder, KINDS[file])
    assert code in (0, 1, 2)
    if code:
        last_sentence(errors)
    else:
        assert out.strip()
    (folder / "new.json").unlink(missing_ok=True)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**20), 10**20) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@pytest.mark.parametrize("file", ["w.json", "t.json"])
@settings(max_examples=40, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(value=VALUES, choice=st.integers(0, 10**6))
def test_no_value_in_a_json_file_ends_in_a_traceback(folder, file, value, choice):
    document = json.loads((folder / SOURCES[file]).read_text())
    places = list(_places(document))
    holder, key = places[choice % len(places)]
    holder[key] = value
    (folder / file).write_text(json.dumps(document))
    code, _, errors = attempt(folder, KINDS[file])
    assert code in (0, 1, 2)
    if code:
        last_sentence(errors)
    (folder / "new.json").unlink(missing_ok=True)


@settings(max_examples=60, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(value=VALUES, choice=st.integers(0, 10**6))
def test_no_value_in_a_vehicle_file_ends_in_a_traceback(folder, value, choice):
    import tomli_w

    document = tomllib.loads((folder / "vehicle.toml").read_text())
    places = list(_places(document))
    holder, key = places[choice % len(places)]
    holder[key] = value
    try:
        (folder / "v.toml").write_text(tomli_w.dumps(document))
    except (TypeError, UnicodeEncodeError):  # TOML has no null
        return
    code, _, errors = attempt(folder, KINDS["v.toml"])
    assert code in (0, 2)
    if code:
        last_sentence(errors)


def _places(document: object):
    """Every place in a document where a value stands: its holder and key."""
    items = (
        document.items() if isinstance(document, dict) else enumerate(document) if isinstance(document, list) else ()
    )
    for key, value in list(items):
        yield document, key
        yield from _places(value)


@settings(max_examples=15, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(damage=damages())
def test_no_damage_to_an_image_ends_in_a_traceback(folder, damage):
    import shutil

    images = folder / "images_damaged"
    shutil.rmtree(images, ignore_errors=True)
    shutil.copytree(folder / "images_small", images)
    first = next(images.rglob("0.png"))
    first.write_bytes(damaged(first.read_bytes(), damage))
    code, _, errors = attempt(folder, "map images_damaged --camera camera.toml --out new_map")
    assert code == 2  # of the wrong size, or damaged
    last_sentence(errors)
