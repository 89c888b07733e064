"""What `make pictures` runs exists: scripts, examples, and a picture in the docs for each."""

from tools import pictures


def test_scripts_and_examples_of_pictures_exist():
    for name, (script, *_) in pictures.SCRIPTS.items():
        assert (pictures.ROOT / script).is_file(), script
        assert (pictures.OUT / f"{name}.svg").is_file()
    for example in pictures.EXAMPLES:
        assert (pictures.ROOT / "examples" / f"{example}.py").is_file()
        assert (pictures.OUT / "examples" / f"{example}.png").is_file()
