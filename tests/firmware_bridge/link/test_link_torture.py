"""Thousands of uploads that are cut, damaged, doubled, swapped and restarted: never a mixed plan, never a wrong one."""

import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest

from firmware_bridge import _controller, wire
from firmware_bridge.dialect.generated import messages as m
from firmware_bridge.mavlink import Codec
from flight import Trajectory

CONTROLLER = Path(__file__).parents[3] / "firmware_bridge" / "controller"
PRESETS = np.array([row[3] for row in _controller.parameter_table()], dtype=np.float32)
_NAMES = [row[0] for row in _controller.parameter_table()]


def boot(kept: bytes | None) -> _controller.Link:
    controller = _controller.Controller()
    assert controller.set_parameters(PRESETS)[0] == 0
    link = _controller.Link(controller, None, 1, 0, 1, 10**9, 0, 5000, 1)
    if kept:
        assert link.restore(kept) == 0
    return link


def receive(link: _controller.Link, frame: bytes, now_us: int) -> None:
    """A frame, and the update that follows a tick."""
    link.receive(frame, True, now_us)
    link.update(now_us)


def held(link: _controller.Link, reader: Codec, codec: Codec) -> tuple[int, int, bytes]:
    """Id, CRC and every segment's bytes of the active plan, as read back over a perfect line."""
    answers: list = []
    for _ in range(4):  # a commit may still be in progress
        link.update(10**9)
    for wanted in ((), (0xFF,)):
        request = m.TrajectoryRead(target_system=1, target_component=1, transfer_id=5, wanted=(*wanted, *[0] * 64)[:64])
        link.receive(codec.encode(request), True, 10**9)
        while frame := link.transmit(10**9):
            answers += [received.message for received in reader.decode(frame)]
    header = next(a for a in answers if isinstance(a, m.TrajectoryBegin))
    segments = sorted((a for a in answers if isinstance(a, m.TrajectorySegment)), key=lambda s: s.index)
    content = b"".join(np.float32([s.duration_us, *s.coefficients]).tobytes() for s in segments[: header.segments])
    return header.trajectory_id, header.crc32, content


def upload_frames(plan: wire.WirePlan, trajectory: Trajectory, transfer_id: int, codec: Codec) -> list[bytes]:
    messages = [plan.begin(transfer_id), *(plan.segment(transfer_id, i) for i in range(len(plan.durations_us)))]
    messages.append(wire.samples(plan, trajectory, transfer_id))
    messages.append(m.TrajectoryCommit(transfer_id=transfer_id, trajectory_id=plan.id, crc32=plan.crc32))
    for message in messages:
        message.target_system = message.target_component = 1
    return [codec.encode(message) for message in messages]


def bad_line(frames: list[bytes], rng: np.random.Generator) -> list[bytes]:
    """The frames as they may arrive: some lost, doubled, swapped, damaged; the commit may overtake; several rounds."""
    frames = frames * int(rng.integers(1, 5))
    arriving = [frame for frame in frames for _ in range(rng.choice([0, 1, 1, 1, 2]))]
    order = np.argsort(np.arange(len(arriving)) + rng.uniform(0, rng.choice([0, 4, 40]), len(arriving)))
    for i in np.flatnonzero(rng.random(len(arriving)) < 0.05):
        damaged = bytearray(arriving[i])
        damaged[rng.integers(len(damaged))] ^= 1 << int(rng.integers(8))
        arriving[i] = bytes(damaged)
    return [arriving[i] for i in order]


def torture(runs: int, plans, seed: int) -> tuple[int, int]:
    """How many uploads took effect, and how many restarts there were."""
    rng = np.random.default_rng(seed)
    codec, reader = Codec(255, 190, None), Codec(254, 190, None)
    files = [plans.file(4, name=f"plan-{i}", seed=i) for i in range(6)]
    sent = [(wire.plan_from_file(file), file.trajectory) for file in files]
    lease = codec.encode(m.LeaseRequest(target_system=1, target_component=1, nonce=1, action=1))
    whole: dict[tuple[int, int], bytes] = {}
    for plan, trajectory in sent:
        link = boot(None)
        for frame in [lease, *upload_frames(plan, trajectory, 3, codec)]:
            receive(link, frame, 1)
        identity = held(link, reader, codec)
        assert identity[:2] == (plan.id, plan.crc32)
        whole[identity[:2]] = identity[2]
    link, now, took_effect, restarts = boot(None), (0, 0, b""), 0, 0
    for transfer_id in range(10, 10 + runs):
        receive(link, lease, transfer_id)
        plan, trajectory = sent[rng.integers(len(sent))]
        arriving = bad_line(upload_frames(plan, trajectory, transfer_id, codec), rng)
        restart_at = rng.integers(len(arriving) + 1) if rng.random() < 0.3 else -1
        for i, frame in enumerate(arriving):
            if i == restart_at:
                link, restarts = boot(link.kept()), restarts + 1
                receive(link, lease, transfer_id)
            receive(link, frame, transfer_id)
        after = held(link, reader, codec)
        if after != now:
            assert after[:2] == (plan.id, plan.crc32)
            took_effect += 1
        assert after == (0, 0, b"") or whole[after[:2]] == after[2]
        now = after
    return took_effect, restarts


def test_a_thousand_bad_uploads_leave_only_whole_plans(plans):
    took_effect, restarts = torture(1000, plans, seed=0)
    assert took_effect > 100  # else the test tests nothing
    assert restarts > 200


@pytest.mark.slow
def test_ten_thousand_bad_uploads_leave_only_whole_plans(plans):
    took_effect, restarts = torture(10_000, plans, seed=1)
    assert took_effect > 1000
    assert restarts > 2000


def parameter_frames(values: np.ndarray, transfer_id: int, codec: Codec) -> list[bytes]:
    padded = [*map(float, values), *[0.0] * (-len(values) % 48)]
    messages: list = [
        m.ParametersStage(transfer_id=transfer_id, group=i // 48, values=tuple(padded[i : i + 48]))
        for i in range(0, len(padded), 48)
    ]
    crc32 = zlib.crc32(np.asarray(values, np.float32).tobytes())
    messages.append(m.ParametersCommit(transfer_id=transfer_id, crc32=crc32))
    for message in messages:
        message.target_system = message.target_component = 1
    return [codec.encode(message) for message in messages]


def test_parameters_and_uploads_that_meet_leave_whole_sets_and_whole_plans(plans):
    """Shuffled into each other, neither is ever mixed."""
    rng = np.random.default_rng(3)
    codec, reader = Codec(255, 190, None), Codec(254, 190, None)
    files = [plans.file(4, name=f"plan-{i}", seed=i) for i in range(3)]
    sent = [(wire.plan_from_file(file), file.trajectory) for file in files]
    sets = np.repeat(PRESETS[None], 4, axis=0)
    first, last = _NAMES.index("mass_kg"), _NAMES.index("emergency_s")  # one in either group
    sets[:, first] *= 1.0 + 0.01 * np.arange(4)
    sets[:, last] *= 1.0 + 0.01 * np.arange(4)
    lease = codec.encode(m.LeaseRequest(target_system=1, target_component=1, nonce=1, action=1))
    controller = _controller.Controller()
    assert controller.set_parameters(PRESETS)[0] == 0
    link = _controller.Link(controller, None, 1, 0, 1, 10**9, 0, 5000, 1)
    seen_sets, seen_plans, now_us = set(), set(), 1000
    for transfer_id in range(10, 610):
        now_us += int(rng.choice([1000, 700_000]))
        receive(link, lease, now_us)
        plan, trajectory = sent[rng.integers(len(sent))]
        upload = upload_frames(plan, trajectory, transfer_id, codec)
        setting = parameter_frames(sets[rng.integers(len(sets))], transfer_id, codec)
        for _ in range(2):  # in order each, shuffled into each other; some lost
            turns = rng.permutation([0] * len(upload) + [1] * len(setting))
            queues = [list(upload), list(setting)]
            if rng.random() < 0.3:
                turns = np.sort(turns)[:: rng.choice([-1, 1])]
            for turn in turns:
                frame = queues[turn].pop(0)
                if rng.random() > 0.02:
                    receive(link, frame, now_us)
                active = controller.parameters().ravel()
                matches = [i for i, values in enumerate(sets) if np.array_equal(values, active)]
                assert len(matches) == 1, "a mixed set of parameters"
                seen_sets.add(matches[0])
        identity = held(link, reader, codec)[:2]
        assert identity in {(0, 0), *((plan.id, plan.crc32) for plan, _ in sent)}
        seen_plans.add(identity)
    assert seen_sets == {0, 1, 2, 3}  # else the test tests nothing
    assert len(seen_plans) >= 3


@pytest.fixture(scope="session")
def fuzz_target(sanitized, tmp_path_factory) -> Path:
    """The fuzz target with address and undefined-behaviour sanitizers, driven by random inputs."""
    program = tmp_path_factory.mktemp("fuzz") / "fuzz_link"
    fuzz = [CONTROLLER / "fuzz" / name for name in ("fuzz_link.c", "fuzz_main.c")]
    includes = [f"-I{CONTROLLER / 'include'}", f"-I{CONTROLLER.parent / 'dialect' / 'generated'}"]
    command = ["gcc", *sanitized.flags, *includes, *fuzz, *sanitized.objects, "-lm", "-o", program]
    built = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    return program


def test_fuzzing_the_link_and_the_state_machine_finds_nothing(fuzz_target: Path):
    run = subprocess.run([str(fuzz_target), "1", "1500"], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr[-2000:]
    assert "1500 runs, no finding" in run.stdout
