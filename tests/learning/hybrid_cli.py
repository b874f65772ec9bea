"""The command line with train-hybrid behind a stage that hands on the declared kite: python hybrid_cli.py train-hybrid ..."""

import awescli  # noqa: F401, I001  (thread settings before numpy)
from awescli import artifacts
from awescli.cli import build_app
from awescli.stages.base import KITE_FILE, Stage
from awescli.stages.train_hybrid import TrainHybrid


class Declared(Stage):
    name, help, makes = "identify", "Take the kite as it is declared.", (KITE_FILE,)

    def run(self, context, config):
        artifacts.write_text(context.folder / KITE_FILE, context.kite.read_text())
        return {}


APP = build_app((Declared(), TrainHybrid()))

if __name__ == "__main__":
    APP()
