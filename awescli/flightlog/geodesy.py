"""Latitude, longitude and altitude -> north, east, down from a place on the ground (WGS84)."""

import numpy as np

SEMI_MAJOR = 6378137.0
"""[m] of the WGS84 ellipsoid (NIMA TR8350.2)."""
FLATTENING = 1 / 298.257223563
ECCENTRICITY2 = FLATTENING * (2 - FLATTENING)
Place = float | np.ndarray


def earth_fixed(latitude: Place, longitude: Place, altitude: Place) -> np.ndarray:
    """Earth-centred, earth-fixed coordinates (3, ...) [m] of latitude, longitude [rad] and height above the ellipsoid [m]."""
    s, c = np.sin(latitude), np.cos(latitude)
    normal = SEMI_MAJOR / np.sqrt(1 - ECCENTRICITY2 * s * s)
    return np.array(
        [
            (normal + altitude) * c * np.cos(longitude),
            (normal + altitude) * c * np.sin(longitude),
            (normal * (1 - ECCENTRICITY2) + altitude) * s,
        ]
    )


def ned_from_geodetic(
    latitude: np.ndarray, longitude: np.ndarray, altitude: np.ndarray, origin: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(north, east, down), each (N,) [m], of latitude, longitude [rad], altitude [m] (N,) from `origin` (the same three).

    The axes are those of the tangent plane at the origin, as a range and an elevation seen from there are.
    """
    lat, lon, _ = origin
    far = earth_fixed(latitude, longitude, altitude) - earth_fixed(*origin)[:, None]
    s, c, s_l, c_l = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    rows = np.array([[-s * c_l, -s * s_l, c], [-s_l, c_l, 0.0], [-c * c_l, -c * s_l, -s]])
    north, east, down = rows @ far
    return north, east, down


def geodetic_from_ned(place: np.ndarray, origin: tuple[float, float, float]) -> tuple[float, float, float]:
    """(latitude, longitude [rad], altitude [m]) of one place (3,) north, east, down from `origin`: the inverse of `ned_from_geodetic`, by
    Newton steps with the radius of a sphere, which leave micrometres within a few kilometres."""
    found = np.array(origin, dtype=float)
    for _ in range(6):
        north, east, down = (x[0] for x in ned_from_geodetic(found[:1], found[1:2], found[2:], origin))
        n, e, d = np.asarray(place) - (north, east, down)
        found = found + (n / SEMI_MAJOR, e / (SEMI_MAJOR * np.cos(found[0])), -d)
    return float(found[0]), float(found[1]), float(found[2])
