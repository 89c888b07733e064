"""Count the instructions of every tick on an emulated Cortex-M: QEMU's execution log, one line per instruction.

Usage: count_instructions.py ELF MACHINE   (prints mean, worst and the number of ticks)
"""

import subprocess
import sys


def symbol_address(elf: str, name: str) -> bytes:
    listing = subprocess.run(["arm-none-eabi-nm", elf], check=True, capture_output=True, text=True).stdout
    for line in listing.splitlines():
        address, *_, symbol = line.split(maxsplit=2)
        if symbol == name:
            return f"/{int(address, 16):08x}/".encode()
    raise SystemExit(f"{elf} has no symbol {name}")


def count(elf: str, machine: str) -> list[int]:
    """Instructions between the two markers, tick by tick (a call and a return of the markers included)."""
    begin, end = symbol_address(elf, "driver_marker_begin"), symbol_address(elf, "driver_marker_end")
    command = ["qemu-system-arm", "-machine", machine, "-nographic", "-semihosting", "-kernel", elf]
    log = [*command, "-singlestep", "-d", "exec,nochain"]
    counts: list[int] = []
    running = None
    with subprocess.Popen(log, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, bufsize=1 << 20) as qemu:
        assert qemu.stderr is not None
        for line in qemu.stderr:
            if begin in line:
                running = 0
            elif running is not None:
                if end in line:
                    counts.append(running)
                    running = None
                else:
                    running += 1
    return counts


if __name__ == "__main__":
    ticks = count(sys.argv[1], sys.argv[2])
    print(sum(ticks) / len(ticks), max(ticks), len(ticks))
