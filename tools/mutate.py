"""Mutation check of the Python rooms: each fault of tools/mutations.toml must make one of its named tests fail.

    python tools/mutate.py                 all of them; ends with 1 if fewer than 90 % are noticed
    python tools/mutate.py gate redo       those whose file or description contains one of these words
    python tools/mutate.py --jobs 4        so many at a time (2)

The sources on disk stay as they are: see tools/mutant/sitecustomize.py. The faults of the embedded C are made by
tools/assure.py, on its syntax tree.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tools" / "mutations.toml"
LEAST_SHARE = 0.9
LONGEST_RUN_S = 900.0
"""The named tests take seconds; a fault under which they take longer loops for ever, and counts as noticed."""
PYTEST = ("-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "slow or not slow")


@dataclass(frozen=True, slots=True)
class Mutation:
    """One fault, as the list writes it."""

    fault: str
    """What a user would suffer from it."""
    file: str
    text: str
    """Stands in the file exactly once."""
    replacement: str
    tests: tuple[str, ...]
    """Test files, or single tests as pytest names them; at least one must fail."""


def mutations() -> list[Mutation]:
    with LIST.open("rb") as stream:
        entries = tomllib.load(stream)["mutation"]
    return [Mutation(**{**entry, "tests": tuple(entry["tests"])}) for entry in entries]


def stale(mutation: Mutation) -> str:
    """Why an entry no longer fits the tree; empty when it does."""
    found = (ROOT / mutation.file).read_text().count(mutation.text) if (ROOT / mutation.file).is_file() else 0
    missing = [test for test in mutation.tests if not (ROOT / test.partition("::")[0]).is_file()]
    if found != 1:
        return f"{mutation.file} holds {mutation.text!r} {found} times, expected once"
    return f"there is no {missing[0]}" if missing else ""


def run(tests: Sequence[str], mutation: Mutation | None = None) -> tuple[int, str]:
    """Exit code and last lines of the tests, with the fault or without; 1 means that a test failed."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment["OPENBLAS_NUM_THREADS"] = "1"
    if mutation is not None:
        place = os.path.realpath(ROOT / mutation.file)
        environment["GOSHAWK_MUTATION"] = json.dumps([place, mutation.text, mutation.replacement])
        environment["PYTHONPATH"] = str(ROOT / "tools" / "mutant")
    with tempfile.TemporaryDirectory() as folder:  # examples that Hypothesis keeps of a fault are of no use later
        environment["HYPOTHESIS_STORAGE_DIRECTORY"] = folder
        command = [sys.executable, *PYTEST, f"--basetemp={folder}/tests", *tests]
        try:
            done = subprocess.run(
                command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=LONGEST_RUN_S, check=False
            )
        except subprocess.TimeoutExpired:
            return 1, "no end"
    return done.returncode, "\n".join((done.stdout + done.stderr).splitlines()[-15:])


def killed(mutation: Mutation) -> bool:
    """
    Raises:
        SystemExit: the tests could not even be collected: the fault is none that a test could notice.
    """
    code, said = run(mutation.tests, mutation)
    if code not in (0, 1):
        raise SystemExit(f"{mutation.file}: {mutation.fault}: the tests did not run (exit code {code})\n{said}")
    print(f"{'killed  ' if code else 'SURVIVED'}  {mutation.file}: {mutation.fault}", flush=True)
    return code == 1


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("words", nargs="*", help="only faults whose file or description contains one of these")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    chosen = [m for m in mutations() if any(w in f"{m.file} {m.fault}" for w in options.words or [""])]
    reasons = [reason for mutation in chosen if (reason := stale(mutation))]
    if reasons or not chosen:
        print("\n".join(reasons) or f"no fault is about {' or '.join(options.words)}")
        return 2
    code, said = run(sorted({test for mutation in chosen for test in mutation.tests}))
    if code:
        print(f"the tests fail without any fault; correct that first\n{said}")
        return 2
    with ThreadPoolExecutor(options.jobs) as pool:
        noticed = list(pool.map(killed, chosen))
    share = sum(noticed) / len(noticed)
    print(f"{sum(noticed)} of {len(noticed)} faults noticed, {100 * share:.1f} % (at least {100 * LEAST_SHARE:.0f} %)")
    return 0 if share >= LEAST_SHARE else 1


if __name__ == "__main__":
    raise SystemExit(main())
