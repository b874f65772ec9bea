"""What `awes demo` writes: the bundled flight, its kite file and the standard plan, as they lie in the repository.

A wheel holds copies of them, made when it is built (setup.py); a source checkout holds them themselves, in data/ and stages.yaml.
"""

from pathlib import Path

import awescli

FILES = (
    "data/km1_demo/kite.csv",
    "data/km1_demo/wind.csv",
    "data/km1_demo/README.md",
    "data/kites/km1_initial.yaml",
    "stages.yaml",
)
"""As the plan names them; the plan last."""


def demonstration() -> dict[str, bytes]:
    """File name -> content, read from the wheel or from the checkout that awes runs from."""
    package = Path(awescli.__file__).parent
    source = bundled if (bundled := package / "demo").is_dir() else package.parent
    return {name: (source / name).read_bytes() for name in FILES}
