"""A network as C: its layers as loops over one table of weights. `engine/dense.py` says what they compute."""

from awescli.engine.dense import FARTHEST, layer_slices
from awescli.export.c_expressions import constant, wrapped
from awescli.learning.correction import Correction


def network(correction: Correction) -> str:
    """`static void network(const double *s, double *n)` and its tables: s: what it sees, n: what it adds."""
    tables = {
        "mean": correction.mean, "inverse_deviation": 1 / correction.deviation, "middle": correction.middle,
        "inverse_half": 1 / correction.half, "scale": correction.scale, "weights": correction.weights,
    }  # fmt: skip
    text = "".join(_table(f"network_{name}", values.tolist()) for name, values in tables.items())
    lines = "\n".join(f"    {line}" for line in [*_faded(correction), *_layers(correction)])
    says = f"what the network adds to d/dt of (u, v, w, p, q, r); s ({len(correction.inputs)}): {', '.join(correction.inputs)}"
    return f"{text}\n{_comment(f'n (6): {says}')}static void network(const double *s, double *n)\n{{\n{lines}\n}}\n"


def _comment(text: str) -> str:
    return "/* " + "\n".join(wrapped(text, "   ")) + " */\n"


def _table(name: str, values: list[float]) -> str:
    rows = "\n    ".join(wrapped(", ".join(map(constant, values)), ""))
    return f"static const double {name}[] = {{\n    {rows}\n}};\n"


def _faded(correction: Correction) -> list[str]:
    """Normalised inputs in a, and how far outside its training the network fades."""
    return [
        f"double a[{max(correction.sizes)}], b[{max(correction.sizes)}], outside = 0.0, fade;",
        "int i, j;",
        f"for (i = 0; i < {correction.sizes[0]}; i++) {{",
        "    double e;",
        "    a[i] = (s[i] - network_mean[i]) * network_inverse_deviation[i];",
        f"    e = (fabs(a[i] - network_middle[i]) * network_inverse_half[i] - 1.0) * {constant(1 / correction.width)};",
        "    if (e > 0.0)",
        "        outside += e * e;",
        "}",
        f"fade = exp(outside < {constant(FARTHEST)} ? -outside : {constant(-FARTHEST)});",
    ]


def _layers(correction: Correction) -> list[str]:
    """Layer after layer, from a to b and back; the last one into n."""
    lines, here, there = [], "a", "b"
    places = layer_slices(correction.sizes)
    for k, (weights, biases) in enumerate(places):
        rows, columns = correction.sizes[k + 1], correction.sizes[k]
        last = k == len(places) - 1
        lines += [
            f"for (i = 0; i < {rows}; i++) {{",
            f"    double sum = network_weights[{biases.start} + i];",
            f"    for (j = 0; j < {columns}; j++)",
            f"        sum += network_weights[{weights.start} + i * {columns} + j] * {here}[j];",
            "    n[i] = network_scale[i] * fade * sum;" if last else f"    {there}[i] = tanh(sum);",
            "}",
        ]
        here, there = there, here
    return lines
