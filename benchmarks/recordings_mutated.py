"""Two thousand damaged recordings of every format: no traceback, bounded memory, a sentence with file and way out.

    python benchmarks/recordings_mutated.py [--count 2000] [--seed 1]

Each file is a good one with bytes flipped, cut off, pieces swapped or put in twice, or (of text) rows swapped and
columns renamed. A reader answers with a log or one of our errors; the error's sentence holds the file's name.
"""

import argparse
import json
import resource
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
from flight import FlightError  # noqa: E402
from sysid.logs.reading import read_log  # noqa: E402
from tests.sysid.logs.readers import good_files  # noqa: E402
from tests.sysid.logs.readers.good_files import mutated  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    rng = np.random.default_rng(chosen.seed)
    outcomes: Counter[str] = Counter()
    bad: list[str] = []
    begin_s = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        good = good_files.every(Path(folder))
        for number in range(chosen.count):
            name = sorted(good)[number % len(good)]
            path = Path(folder) / f"m{number}-{name}"
            path.write_bytes(mutated(good[name], rng, text=name.endswith((".csv", ".log", ".tum"))))
            try:
                log = read_log(path)
                outcomes["read, the loss said" if "lost" in log.metadata else "read"] += 1
            except FlightError as error:
                outcomes["refused"] += 1
                if path.name not in str(error) or len(str(error)) < len(str(path)) + 15:
                    bad.append(f"{path.name}: {error}")
            except Exception as error:
                bad.append(f"{path.name}: {type(error).__name__}: {error}")
            path.unlink()
    peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    result = {
        "files": chosen.count,
        "outcomes": dict(outcomes),
        "tracebacks_or_sentences_without_place": len(bad),
        "peak_gb": round(peak_gb, 2),
        "cpu_s": round(time.process_time() - begin_s, 1),
    }
    print(json.dumps(result, indent=1))
    for sentence in bad[:20]:
        print(sentence, file=sys.stderr)
    return 1 if bad or peak_gb > 4.0 else 0


if __name__ == "__main__":
    sys.exit(main())
