"""Settings are in pyproject.toml. Here is what they cannot say: a wheel takes the demo from where it lies in the repository."""

import ast
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).parent


def demo_files() -> tuple[str, ...]:
    """`FILES` of awescli/stages/demonstration.py, read and not imported: what awes imports is not there while it is built."""
    tree = ast.parse((ROOT / "awescli" / "stages" / "demonstration.py").read_text(encoding="utf-8"))
    return next(ast.literal_eval(node.value) for node in tree.body if isinstance(node, ast.Assign) and node.targets[0].id == "FILES")


class WithDemo(build_py):
    """build_py, and the demo's files into the package; an editable install reads them where they lie."""

    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            for name in demo_files():
                target = Path(self.build_lib) / "awescli" / "demo" / name
                self.mkpath(str(target.parent))
                self.copy_file(str(ROOT / name), str(target))


setup(cmdclass={"build_py": WithDemo})
