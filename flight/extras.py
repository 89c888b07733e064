"""Which extra of the installation brings a library; without any, Goshawk plans, flies and learns."""

EXTRAS = {
    "map": {
        "cv2": "opencv-python-headless", "lazrs": "lazrs", "open3d": "open3d", "pycolmap": "pycolmap",
        "ruamel.yaml": "ruamel.yaml", "trimesh": "trimesh",
    },
    "gcs": {
        "aiohttp": "aiohttp", "msgspec": "msgspec", "open3d": "open3d", "segno": "segno", "trimesh": "trimesh",
        "viser": "viser",
    },
    "ros": {"rosbags": "rosbags", "lz4": "lz4", "zstandard": "zstandard"},
    "cluster": {"dask": "dask", "distributed": "distributed"},
}  # fmt: skip
"""By extra: the modules that some verbs import when they need them, and the distribution of each."""


def install(extra: str) -> str:
    """The command that adds an extra, as every shell takes it."""
    return f'pip install "goshawk[{extra}]"'


def missing(error: BaseException) -> str | None:
    """The sentence that ends "this needs"; None for an error that is not about a library of an extra."""
    if not isinstance(error, ModuleNotFoundError):
        return None
    for extra, libraries in EXTRAS.items():
        for module, distribution in libraries.items():
            if error.name in (module, module.split(".")[0]):
                return f"{distribution}, which comes with an extra: {install(extra)}"
    return None
