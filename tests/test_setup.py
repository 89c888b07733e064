"""Set-up on a machine where the package manager is busy or the network is away for a moment."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]


def again(folder: Path, failures: int, *, tries: int = 8) -> tuple[int, str, int]:
    """Run a command that fails so many times: exit code, what was said, and how often it was called."""
    calls = folder / "calls"
    command = folder / "busy"
    command.write_text(f'#!/bin/sh\necho x >> {calls}\n[ "$(wc -l < {calls})" -gt {failures} ] || exit 100\n')
    command.chmod(0o755)
    script = f'set -euo pipefail; say() {{ echo "$@"; }}; source {ROOT}/tools/again.sh; again "apt-get" {command}'
    environment = {**os.environ, "AGAIN_PAUSE_S": "0", "AGAIN_TRIES": str(tries)}
    done = subprocess.run(["bash", "-c", script], env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr, len(calls.read_text().splitlines())


@pytest.mark.parametrize("failures", [0, 1, 3])
def test_a_command_that_fails_for_a_moment_is_tried_until_it_succeeds(tmp_path: Path, failures: int):
    code, said, calls = again(tmp_path, failures)
    assert (code, calls) == (0, failures + 1)
    assert said.count("trying again") == failures


def test_a_command_that_always_fails_ends_with_its_own_code_after_a_bounded_number_of_tries(tmp_path: Path):
    code, said, calls = again(tmp_path, 100, tries=3)
    assert (code, calls) == (100, 3)
    assert "failed 3 times" in said


@pytest.mark.parametrize("jobs", ["auto", "", "0", "-1", "1.5", "2 3"])
def test_make_refuses_jobs_that_are_not_a_number(jobs: str):
    done = subprocess.run(["make", "help", f"JOBS={jobs}"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert f'JOBS is "{jobs}"; it must be a number' in done.stderr


def test_make_takes_a_number_of_jobs():
    command = ["make", "--dry-run", "--no-print-directory", "test", "JOBS=12"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert "-n 13 " in done.stdout


def test_set_up_fetches_nothing_without_a_second_try():
    lines = (ROOT / "tools" / "setup.sh").read_text().replace("\\\n", " ").splitlines()
    fetching = [
        line for line in lines if any(word in line for word in ("apt-get ", "pip install --quiet --dis", "sync"))
    ]
    fetching = [line for line in fetching if not line.strip().startswith(("#", "say"))]
    assert len(fetching) == 4
    assert all("again " in line for line in fetching)


def test_pre_commit_runs_the_commands_of_make_lint():
    """In the same order, with the tools of .venv, so that what a commit passes is what the lint of .ci/run passes."""
    printed = subprocess.run(
        ["make", "-n", "lint", "JOBS=2"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    commands = [" ".join(line.split()) for line in printed.splitlines() if line.startswith(".venv/bin/")]
    repositories = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    hooks = [hook for repository in repositories for hook in repository["hooks"]]
    asked = [re.sub(r'^bash -c "(.*)"$', r"\1", hook["entry"]) for hook in hooks]
    assert len(commands) == 4
    assert asked == commands
    assert all(repository["repo"] == "local" for repository in repositories), "a hook would be fetched"
    assert all(hook["language"] == "system" and not hook["pass_filenames"] for hook in hooks)
    assert "make lint" in (ROOT / ".ci" / "run").read_text().splitlines()


def test_pre_commit_reads_its_settings():
    command = [sys.executable, "-m", "pre_commit", "validate-config", str(ROOT / ".pre-commit-config.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
