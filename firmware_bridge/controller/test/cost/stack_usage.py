"""The deepest stack of each entry point, from the compiler's own call graph (gcc -fcallgraph-info=su).

There is no recursion, and function pointers stand in two tables only, so the longest path is a bound, not a sample.
Left out are what the C library's memcpy and its kind use (a few words) and what an interrupt needs.
"""

import re
from pathlib import Path

_NODE = re.compile(r'node: \{ title: "([^"]+)" label: "([^"]*)"')
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
_BYTES = re.compile(r"(\d+) bytes \((\w+)\)")
_ENCODERS = dict.fromkeys(("encode", "encode_among", "encode_telemetry", "link_next_message"), "link_encode_")
TABLES = {"link_dispatch": "link_receive_"} | _ENCODERS
"""Who calls through a table of functions, and how the names of those in it begin."""


class CallGraph:
    """All .ci files of a folder."""

    def __init__(self, folder: Path) -> None:
        self.own: dict[str, int] = {}
        self.calls: dict[str, set[str]] = {}
        for file in sorted(folder.glob("*.ci")):
            text = file.read_text()
            for name, label in _NODE.findall(text):
                if found := _BYTES.search(label):
                    assert found[2] == "static", f"{name}: its frame has no fixed size"
                    self.own[name] = int(found[1])
            for source, target in _EDGE.findall(text):
                self.calls.setdefault(source, set()).add(target)
        for source, targets in self.calls.items():
            if "__indirect_call" in targets:
                table = TABLES.get(source.rpartition(":")[2])  # what is local has its file before its name
                assert table is not None, f"{source} calls through a pointer; which functions?"
                targets.remove("__indirect_call")
                targets |= {name for name in self.own if name.startswith(table) and name != source}

    def deepest(self, function: str, above: tuple[str, ...] = ()) -> tuple[int, list[str]]:
        """Bytes, and the path of calls that needs them."""
        assert function not in above, f"recursion: {' > '.join((*above, function))}"
        below = [self.deepest(called, (*above, function)) for called in self.calls.get(function, ())]
        most, path = max(below, default=(0, []))
        return self.own.get(function, 0) + most, [function.rpartition(":")[2], *path]
