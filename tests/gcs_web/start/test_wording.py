"""What the library says reaches the page without options, folders of the station and numbers of errors."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from flight import results
from flight.errors import InputError
from gcs_web.protocol.wording import for_page

WORDS = st.lists(st.text("abcdefgh ,.;()", min_size=1, max_size=12), max_size=8)


def test_a_name_that_is_taken_is_said_without_folder_and_option(tmp_path: Path):
    taken = tmp_path / "trajectories" / "lap.json"
    taken.parent.mkdir()
    taken.write_text("{}")
    try:
        results.require_free(taken, overwrite=False)
    except InputError as error:
        said = for_page(str(error), tmp_path)
    assert said.startswith('trajectories/lap.json exists; give another name, or "Overwrite" to replace it')
    assert str(tmp_path) not in said


def test_numbers_of_errors_and_bracketed_options_go_and_commands_stay():
    assert for_page("udp://0:1: [Errno 22] Invalid argument") == "udp://0:1: Invalid argument"
    assert for_page("raise radius_m (--radius) to 0.3 or more") == "raise radius_m to 0.3 or more"
    assert for_page("run `goshawk log fix --all` first") == "run `goshawk log fix --all` first"
    assert for_page("give --full-throttle RPM") == 'give the option "full throttle" RPM'


@given(WORDS)
def test_what_has_no_option_and_no_path_is_left_as_it_is(words: list[str]):
    text = " ".join(words)
    assert for_page(text, Path("/a/project")) == text


@given(WORDS, st.sampled_from(["--overwrite", "--up", "--no-such-option"]))
def test_no_option_is_left(words: list[str], option: str):
    assert "--" not in for_page(" ".join([*words, option, *words]))
