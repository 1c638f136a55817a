"""Writes stamp.stl beside itself: a round wire bent to the letter C, as a closed surface in millimetres.

    python3 meshes/stamp.py
"""

from math import cos, pi, radians, sin
from pathlib import Path
from struct import pack

RING, WIRE, OPENING = 3.5, 1.5, radians(40)
BELOW, ABOVE, ALONG, CAP = 32, 6, 60, 6


def around():
    """Angles around the wire from its lowest line, with finer steps on the lower half."""
    lower = [-pi / 2 + pi * i / BELOW for i in range(BELOW)]
    return lower + [pi / 2 + pi * i / ABOVE for i in range(ABOVE)]


def sections():
    """Centre, direction of the ring's radius, axial shift and radius of each section along the wire, between its ends."""
    for i in reversed(range(CAP)):
        yield OPENING, -WIRE * sin(pi / 2 * (i + 1) / (CAP + 1)), WIRE * cos(pi / 2 * (i + 1) / (CAP + 1))
    for i in range(ALONG + 1):
        yield OPENING + (2 * pi - 2 * OPENING) * i / ALONG, 0.0, WIRE
    for i in range(CAP):
        yield 2 * pi - OPENING, WIRE * sin(pi / 2 * (i + 1) / (CAP + 1)), WIRE * cos(pi / 2 * (i + 1) / (CAP + 1))


def place(angle, shift, radius, turn):
    """The place on a section at an angle around the wire."""
    out, up = RING + radius * sin(turn), -radius * cos(turn)
    return (out * cos(angle) - shift * sin(angle), out * sin(angle) + shift * cos(angle), up)


def surface():
    """All triangles, counterclockwise as seen from outside."""
    rings = [[place(*section, turn) for turn in around()] for section in sections()]
    ends = [place(OPENING, -WIRE, 0.0, 0.0), place(2 * pi - OPENING, WIRE, 0.0, 0.0)]
    for one, other in zip(rings, rings[1:]):
        for j in range(len(one)):
            k = (j + 1) % len(one)
            yield one[j], other[j], other[k]
            yield one[j], other[k], one[k]
    for j in range(len(rings[0])):
        k = (j + 1) % len(rings[0])
        yield ends[0], rings[0][j], rings[0][k]
        yield ends[1], rings[-1][k], rings[-1][j]


triangles = list(surface())
with open(Path(__file__).with_name("stamp.stl"), "wb") as file:
    file.write(b"A round wire bent to the letter C, in mm".ljust(80) + pack("<I", len(triangles)))
    for triangle in triangles:
        file.write(pack("<12fH", 0, 0, 0, *(x for corner in triangle for x in corner), 0))
