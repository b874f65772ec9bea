"""Wind shear: the exponent of the height profile."""

from dataclasses import replace
from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import exp, log, maximum
from awescli.physics.airflow import HEIGHT_FLOOR
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Wind


class WindShear(Effect):
    """v = v_r (h/h_r)^a. `a` is the whole exponent: null is the exponent that the kite file declares (0 for a table of heights).

    Source: IEC 61400-1 (0.2 for normal profiles); 0.03-0.2 over sea and flat land.
    """

    name = "wind_shear"
    doc = "power-law exponent of the wind over height"
    parameters = (Parameter("a", 0.0, "-", -0.3, 0.6, source="IEC 61400-1: 0.2"),)
    reference, declared = 10.0, 0.0

    def __init__(self, target: str = "", declaration: KiteDeclaration | None = None):
        super().__init__(target, declaration)
        if declaration is not None:
            law = declaration.wind
            self.reference = law.reference_height
            self.declared = law.exponent if law.law == "power" else 0.0
            self.parameters = (replace(self.parameters[0], value=self.declared),)

    def airflow(self, wind: Wind, at: Instant, own: SimpleNamespace) -> Wind:
        height = maximum(-at.z.p_d, HEIGHT_FLOOR + 0.0 * at.z.p_d)
        factor = exp((own.a - self.declared) * log(height / self.reference))
        return wind._replace(n=wind.n * factor, e=wind.e * factor)
