"""The kite file: what a user declares of a kite, checked, and the parameter table that it makes."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from awescli.notation.document import open_document
from awescli.notation.errors import BadInput, BadInputs
from awescli.notation.former_names import formerly
from awescli.notation.parameters import Parameter, ParameterTable
from awescli.notation.quantities import ControlSurface
from awescli.physics.propeller import Propeller


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class ParameterRow(_Frozen):
    """One parameter of the kite, SI and radians unless `unit` and the aerodynamic table say otherwise."""

    value: float = Field(allow_inf_nan=False, description="declared value, in its unit")
    unit: str = Field(default="-", description="unit of value, bounds and std; `-`: none")
    lower: float | None = Field(default=None, description="least value that a fit may reach; nothing: no limit")
    upper: float | None = Field(default=None, description="largest value that a fit may reach; nothing: no limit")
    free: bool = Field(default=False, description="whether identify may change it; a free one is drawn to its value by std")
    std: float | None = Field(
        default=None,
        gt=0,
        description="prior standard deviation, std / value in the logarithm where bounds exclude zero; default a quarter of the range",
    )
    source: str = Field(default="", description="where the number comes from")


class AerodynamicTable(_Frozen):
    """Coefficient -> monomial -> parameter name. Monomials are products of powers: `alpha^2*flaps`, `abs(beta)`, `q_hat`, `1`."""

    frame: Literal["wind", "body"] = Field(
        default="wind", description="wind: CD, CY, CL; body: CX, CY, CZ; moments Cl, Cm, Cn always in body axes"
    )
    angles: Literal["rad", "deg"] = Field(default="rad", description="unit in which alpha, beta and deflections enter the monomials")
    terms: dict[str, dict[str, str]] = Field(description="coefficient -> monomial -> name of the parameter that multiplies it")


class WindLaw(_Frozen):
    """How the recorded wind is carried to the kite's height."""

    law: Literal["table", "power", "log", "uniform"] = Field(
        default="table", description="table: between recorded heights; power, log: from one station; uniform: alike at all heights"
    )
    exponent: float = Field(default=0.0, description="power law exponent")
    reference_height: float = Field(default=10.0, gt=0, description="height of a station without a height column [m]")
    roughness: float = Field(default=0.0002, gt=0, description="roughness length of the log law [m]")
    std: float = Field(
        default=0.1, ge=0, description="standard deviation of the recorded wind [m/s]; its error is a nuisance, not an effect"
    )
    direction_std: float = Field(default=0.01, ge=0, description="standard deviation of the recorded direction [rad]")


class TetherLaw(_Frozen):
    """Which law gives the tension (docs/equations.md (12) to (14))."""

    law: Annotated[Literal["thesis", "exact"], formerly(seed="thesis")] = Field(
        default="thesis",
        description="exact: the constraint |p| = line length itself; thesis: its published form, without the path's curvature",
    )
    tension: Literal["constraint", "measured"] = Field(default="constraint", description="constraint: from the line; measured: as logged")


class SurfaceDeclaration(_Frozen):
    """How a surface of the log enters the aerodynamic table."""

    sign: Literal[-1, 1] = Field(default=1, description="-1 where the log's positive deflection is the table's negative one")
    lower: float = Field(default=-0.6, description="[rad], in the log's sign")
    upper: float = Field(default=0.6, description="[rad], in the log's sign")


LOAD_RESOLUTION = 1e-3
"""[N] noise of a load cell at zero load: not nothing, so that a weight stays finite."""


class Noise(_Frozen):
    """White sensor noise, one standard deviation per sample, in SI and radians; load_relative is a share of the load."""

    position: tuple[float, float, float] = Field(default=(0.1, 0.1, 0.15), description="white noise of a sample, north, east, down [m]")
    velocity: float = Field(default=0.05, gt=0, description="[m/s]")
    euler: float = Field(default=0.0035, gt=0, description="[rad]")
    rates: float = Field(default=0.0052, gt=0, description="[rad/s]")
    airspeed: float = Field(default=0.3, gt=0, description="[m/s]")
    flow_angles: float = Field(default=0.0087, gt=0, description="[rad]")
    load_relative: float = Field(default=0.01, gt=0, description="share of the load")
    acceleration: float = Field(default=0.2, gt=0, description="[m/s2]")

    def channels(self) -> dict[str, tuple[float, float]]:
        """Measured channel (`quantities.MEASURED`) -> (standard deviation [SI], share of the signal that comes on top)."""
        position = dict(zip(("p_n", "p_e", "p_d"), self.position, strict=True))
        groups = {
            ("v_n", "v_e", "v_d"): self.velocity, ("phi", "theta", "psi"): self.euler, ("p", "q", "r"): self.rates,
            ("a_x", "a_y", "a_z"): self.acceleration, ("V_a",): self.airspeed, ("alpha", "beta"): self.flow_angles,
        }  # fmt: skip
        absolute = position | {name: std for names, std in groups.items() for name in names}
        return {name: (std, 0.0) for name, std in absolute.items()} | {"tension": (LOAD_RESOLUTION, self.load_relative)}


class KiteDeclaration(_Frozen):
    """A kite as its user declares it: everything a model needs, and nothing about a flight."""

    name: str = Field(description="what the kite is called")
    description: str = Field(default="", description="one line about it")
    parameters: dict[str, ParameterRow] = Field(description="name -> value, unit, bounds, source, whether it is free")
    aerodynamics: AerodynamicTable = Field(description="table of terms of the coefficients")
    tether: TetherLaw = Field(
        default=TetherLaw(), description="law of the line's tension; of no meaning to a kite without the effect `tether`"
    )
    wind: WindLaw = Field(default=WindLaw(), description="how the recorded wind is carried to the kite's height, and how well it is known")
    surfaces: dict[ControlSurface, SurfaceDeclaration] = Field(
        default={}, description="control surface -> its sign and travel in the log; what is not named has sign 1"
    )
    propellers: tuple[Propeller, ...] = Field(default=(), description="what the effect `thrust` flies with")
    set_point_rate: float = Field(
        default=50.0,
        gt=0.1,
        le=1e4,
        description="rate at which the flight controller sets the surfaces and holds them [Hz]; a slower log lacks set-points, which are "
        "taken on the line between its rows",
    )
    effects: tuple[str, ...] = Field(
        default=("gravity", "aerodynamics", "tether"),
        description="ordered; each name from the table of effects, with `:target` where an effect has several places to act",
    )
    constraints: tuple[str, ...] = Field(
        default=(), description="linear constraints that identified values keep: `Jx + Jy >= Jz`, `2*CYb + 0.1 <= CYp`; <=, >= or ="
    )
    noise: Noise = Field(default=Noise(), description="white noise of the sensors")

    def table(self) -> ParameterTable:
        """The declared parameters as a table, in file order."""
        return ParameterTable(parameter_of(name, row) for name, row in self.parameters.items())

    def with_parameters(self, table: ParameterTable) -> "KiteDeclaration":
        """The same declaration holding the rows of `table`."""
        return self.model_copy(update={"parameters": {p.name: row_of(p) for p in table.rows}})


def parameter_of(name: str, row: ParameterRow) -> Parameter:
    lower = -float("inf") if row.lower is None else row.lower
    upper = float("inf") if row.upper is None else row.upper
    return Parameter(name, row.value, row.unit, lower, upper, row.free, row.source, row.std, relative=lower > 0 or upper < 0)


def row_of(p: Parameter) -> ParameterRow:
    finite = float("inf")
    return ParameterRow(
        value=p.value, unit=p.unit, free=p.free, std=p.std, source=p.source,
        lower=None if p.lower == -finite else p.lower, upper=None if p.upper == finite else p.upper,
    )  # fmt: skip


def read_kite(path: Path) -> KiteDeclaration:
    """Read and check a kite file. Raises BadInput (BadInputs: all mistakes at once) with file:line, also for numbers that are still to be
    filled in, for unknown effects, for parameters that effects need, and for what is not of this world (admissible.py); a file that is no
    kite file is one mistake."""
    from awescli.physics.admissible import mistakes, without_repeats
    from awescli.physics.kite import check_declaration
    from awescli.physics.unfilled import unfilled

    document = open_document(Path(path))
    if isinstance(document.data, dict) and not {"parameters", "aerodynamics"} <= set(document.data):
        found = ", ".join(list(document.data)[:6])
        do = "A kite file has `parameters` and `aerodynamics`; `awes init DIR --flight LOG` writes one to fill in."
        raise BadInput(f"this is no kite file (it holds: {found})", document.where(), do)
    # before numbers that are still to be filled in get their stand-ins, which are of no kite
    errors, declaration = mistakes(document.data, document.where), None
    document, unknown = unfilled(document)
    errors += unknown
    try:
        declaration = document.check(KiteDeclaration)
        check_declaration(declaration, document.where)
    except BadInput as e:
        errors += e.errors if isinstance(e, BadInputs) else [e]
    if errors or declaration is None:
        errors = without_repeats(errors)
        raise errors[0] if len(errors) == 1 else BadInputs(errors)
    return declaration


def kite_text(declaration: KiteDeclaration) -> str:
    """The declaration as the text of a kite file (what `read_kite` reads back to an equal object)."""
    import yaml

    class Flow(dict):
        pass

    class Row(list):
        pass

    class Dumper(yaml.SafeDumper):
        pass

    Dumper.add_representer(Flow, lambda d, data: d.represent_mapping("tag:yaml.org,2002:map", data, flow_style=True))
    Dumper.add_representer(Row, lambda d, data: d.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=True))
    content = declaration.model_dump(mode="json")
    content["parameters"] = {
        name: Flow({k: v for k, v in row.items() if v is not None and v != ""}) for name, row in content["parameters"].items()
    }
    for key in ("tether", "wind", "noise"):
        content[key] = Flow(content[key])
    content["propellers"] = [
        {key: Row(v) if isinstance(v, list) else v for key, v in propeller.items() if v not in (None, "")}
        | {"speed": Flow({key: Row(v) if isinstance(v, list) else v for key, v in propeller["speed"].items() if v})}
        for propeller in content["propellers"]
    ]
    content["surfaces"] = {k: Flow(v) for k, v in content["surfaces"].items()}
    content["aerodynamics"]["terms"] = {k: Flow(v) for k, v in content["aerodynamics"]["terms"].items()}
    # a kite that flies free has no tether to tell of, and most have no propeller
    if declaration.tether == TetherLaw():
        del content["tether"]
    if not declaration.propellers:
        del content["propellers"]
    return yaml.dump(content, Dumper=Dumper, sort_keys=False, width=160, allow_unicode=True)
