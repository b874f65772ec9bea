"""sin, cos, exp, atan2 as recorded polynomials, so that many lanes are computed at once without calling libm.

Range reduction after Cody & Waite, coefficients from Moshier's Cephes library (sin.c, exp.c, atan.c); accurate to a few
units in the last place for |x| < 1e5 (tests/engine compare with libm). They round differently from libm in the last bits.
"""

import math
from collections.abc import Sequence

from awescli.engine.record import Scalar, Tape

_SIN = (1.58962301576546568060e-10, -2.50507477628578072866e-8, 2.75573136213857245213e-6, -1.98412698295895385996e-4,
        8.33333333332211858878e-3, -1.66666666666666307295e-1)  # fmt: skip
_COS = (-1.13585365213876817300e-11, 2.08757008419747316778e-9, -2.75573141792967388112e-7, 2.48015872888517045348e-5,
        -1.38888888888730564116e-3, 4.16666666666665929218e-2)  # fmt: skip
_HALF_PI = (1.57079625129699707031, 7.54978941586159635335e-8, 5.39030285815811905290e-15)
"""pi/2 in three parts, the first two short enough that n * part is exact (twice Cephes' DP1-DP3)."""
_EXP_P = (1.26177193074810590878e-4, 3.02994407707441961300e-2, 9.99999999999999999910e-1)
_EXP_Q = (3.00198505138664455042e-6, 2.52448340349684104192e-3, 2.27265548208155028766e-1, 2.00000000000000000009e0)
_LN2 = (6.93145751953125e-1, 1.42860682030941723212e-6)
_ATAN_P = (-8.750608600031904122785e-1, -1.615753718733365076637e1, -7.500855792314704667340e1,
           -1.228866684490136173410e2, -6.485021904942025371773e1)  # fmt: skip
_ATAN_Q = (1.0, 2.485846490142306297962e1, 1.650270098316988542046e2, 4.328810604912902668951e2,
           4.853903996359136964868e2, 1.945506571482613964425e2)  # fmt: skip


def _polynomial(x: Scalar, coefficients: Sequence[float]) -> Scalar:
    total = x.tape.constant(coefficients[0])
    for c in coefficients[1:]:
        total = total * x + c
    return total


def _quarter_turns(x: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """(x - n pi/2 in [-pi/4, pi/4], n odd as 1 or 0, n)"""
    n = x.tape.put(("round", (x * (2 / math.pi)).index))
    r = ((x - n * _HALF_PI[0]) - n * _HALF_PI[1]) - n * _HALF_PI[2]
    odd = n - 2.0 * x.tape.put(("round", (n * 0.5 - 0.25).index))
    return r, odd, n


def _sine_and_cosine_of_small(r: Scalar) -> tuple[Scalar, Scalar]:
    z = r * r
    return r + r * z * _polynomial(z, _SIN), (1.0 - 0.5 * z) + z * z * _polynomial(z, _COS)


def _sine_at(x: Scalar, ahead: float) -> Scalar:
    """sin(x + ahead pi/2)"""
    r, odd, n = _quarter_turns(x)
    s, c = _sine_and_cosine_of_small(r)
    m = n + ahead
    # m modulo 4 in {0, 1, 2, 3}; round(m/4 - 3/8) is floor(m/4) for whole m
    quarter = m - 4.0 * x.tape.put(("round", (m * 0.25 - 0.375).index))
    use_cosine = odd if ahead == 0 else 1.0 - odd
    value = (use_cosine - 0.5).select(c, s)
    return (quarter - 1.5).select(-value, value)


def _sin() -> tuple[Tape, int]:
    tape = Tape()
    (x,) = tape.inputs("a", 1)
    return tape, _sine_at(x, 0.0).index


def _cos() -> tuple[Tape, int]:
    tape = Tape()
    (x,) = tape.inputs("a", 1)
    return tape, _sine_at(x, 1.0).index


def _exp() -> tuple[Tape, int]:
    tape = Tape()
    (x,) = tape.inputs("a", 1)
    x = (x - 709.0).select(709.0, x)
    x = (-708.0 - x).select(-708.0, x)
    n = tape.put(("round", (x * (1 / math.log(2))).index))
    r = (x - n * _LN2[0]) - n * _LN2[1]
    z = r * r
    p = r * _polynomial(z, _EXP_P)
    e = 1.0 + 2.0 * (p / (_polynomial(z, _EXP_Q) - p))
    return tape, (e * tape.put(("power_of_two", n.index))).index


def _atan2() -> tuple[Tape, int]:
    tape = Tape()
    y, x = tape.inputs("a", 2)
    ay, ax = y.select(y, -y), x.select(x, -x)
    steep = ay - ax
    small, large = steep.select(ax, ay), steep.select(ay, ax)
    t = small / large.select(large, 1.0)
    near_one = t - 0.66
    s = near_one.select((t - 1.0) / (t + 1.0), t)
    z = s * s
    a = s + s * z * (_polynomial(z, _ATAN_P) / _polynomial(z, _ATAN_Q))
    a = near_one.select(math.pi / 4 + a, a)
    a = steep.select(math.pi / 2 - a, a)
    a = (-x).select(math.pi - a, a)
    return tape, (-y).select(-a, a).index


APPROXIMATIONS = {"sin": _sin, "cos": _cos, "exp": _exp, "atan2": _atan2}
