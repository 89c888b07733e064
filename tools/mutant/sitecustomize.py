"""Put on PYTHONPATH by tools/mutate.py: every Python that starts there reads one source file with a fault in it.

The fault is made while the file is imported, so nothing on disk changes, and programs that a test starts have it too.
"""

import json
import os
from importlib.machinery import SourceFileLoader
from importlib.util import decode_source


def _read_with_fault(file: str, text: str, replacement: str) -> None:
    as_written = SourceFileLoader.get_code

    def get_code(self: SourceFileLoader, fullname: str):
        path = self.get_filename(fullname)
        if os.path.realpath(path) != file:
            return as_written(self, fullname)
        source = decode_source(self.get_data(path))
        return compile(source.replace(text, replacement), path, "exec", dont_inherit=True)

    SourceFileLoader.get_code = get_code


if "GOSHAWK_MUTATION" in os.environ:
    _read_with_fault(*json.loads(os.environ["GOSHAWK_MUTATION"]))
