"""Count the instructions of every tick of the driver on an emulated Cortex-M: QEMU's time tied to instructions.

Usage: count_instructions.py ELF MACHINE   (prints mean, worst and the number of ticks; built with -DPAINTED_WORDS=0u)
"""

import subprocess
import sys


def count(elf: str, machine: str) -> list[int]:
    """Instructions of each tick, as the program itself counts them by the processor's timer (target_main.c)."""
    done = subprocess.run(
        ["qemu-system-arm", "-machine", machine, "-icount", "shift=6,sleep=off", "-nographic", "-semihosting",
         "-kernel", elf], check=True, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    lines = (done.stdout or done.stderr).splitlines()  # the console is stderr when nobody watches
    return [int(line, 16) for line in lines[:-1]]  # the last one is the driver's verdict


if __name__ == "__main__":
    ticks = count(sys.argv[1], sys.argv[2])
    print(sum(ticks) / len(ticks), max(ticks), len(ticks))
