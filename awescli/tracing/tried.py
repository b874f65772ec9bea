"""A candidate in a round of the search."""

from dataclasses import dataclass

from awescli.notation.present import present
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.screen import Score


@dataclass(frozen=True)
class Tried:
    """A candidate in a round. model: its fit, None where it was not fitted; significant: by its score, all candidates together; outcome: of
    the fit, "not fitted", "given up", "failed" or "set aside" (`answered_gusts`); gain: deviance by which the model leads the one before,
    unseen: the same on validation alone, both of all segments where it was fitted to a share of them; plausible: no strength at the end of
    its range; partly: fitted to no more than what tells candidates apart (`fit_on_part`); finalist: fitted to the end; under_null: deviance
    that it would gain of the same flight, were it not there (`bootstrap`), 0 where that was not asked."""

    score: Score
    significant: bool
    outcome: str = "not fitted"
    model: FittedModel | None = None
    gain: float = 0.0
    unseen: float = 0.0
    plausible: bool = True
    partly: bool = False
    finalist: bool = False
    under_null: float = 0.0

    @property
    def key(self) -> str:
        return self.score.key

    @property
    def undecided(self) -> bool:
        """A finalist whose fit came to no end: it has proved nothing."""
        return self.finalist and not self.fitted.fit.ended

    @property
    def start(self) -> tuple[dict[str, float], dict[str, float]]:
        """(strengths, shapes that were held) as it was fitted, by full name: from where it is fitted again elsewhere."""
        table, free = self.fitted.table, self.fitted.strengths
        values = {n: table[n].value for n in table if n.startswith(f"{self.key}.")}
        return {n: v for n, v in values.items() if n in free}, {n: v for n, v in values.items() if n not in free}

    @property
    def fitted(self) -> FittedModel:
        """The fit of a candidate that was fitted."""
        return present(self.model, f"the fit of {self.key}")
