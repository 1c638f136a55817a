"""Numbers of the values of a column over time, as the program computes them: `mean`, `amplitude`, `period` and `arrival`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

# The share of the amplitude below which swings around the mean are noise, and of the largest value below which differences are.
NOISE = 0.05
ROUNDING = 1e-12
# The share of the largest magnitude at which values have arrived.
ARRIVED = 0.01


def mean(times: Sequence[float], values: Sequence[float]) -> float:
    """The mean of values that are linear between the times."""
    span = times[-1] - times[0]
    if span == 0.0:
        return values[-1]
    steps = zip(times, times[1:], values, values[1:], strict=False)
    return sum((end - start) * (a + b) / 2 for start, end, a, b in steps) / span


def amplitude(_times: Sequence[float], values: Sequence[float]) -> float:
    """Half of the difference of the extrema."""
    return (max(values) - min(values)) / 2


def arrival(times: Sequence[float], values: Sequence[float]) -> float | None:
    """The time at which the magnitude first reaches a hundredth of its largest; `None` if all values are 0."""
    sizes = [abs(value) for value in values]
    level = ARRIVED * max(sizes)
    if not level > 0:
        return None
    at = next(at for at, size in enumerate(sizes) if size >= level)
    if at == 0:
        return times[0]
    return times[at - 1] + (times[at] - times[at - 1]) * (level - sizes[at - 1]) / (sizes[at] - sizes[at - 1])


def period(times: Sequence[float], values: Sequence[float]) -> float | None:
    """The mean time between crossings of the mean in the same direction; `None` if there are less than two of them.

    A crossing counts if the values then swing beyond the mean by a twentieth of the amplitude.
    """
    size = amplitude(times, values)
    if not all(map(math.isfinite, values)) or size <= ROUNDING * max(map(abs, values)):
        return None
    level = mean(times, values)
    crossings: dict[bool, list[float]] = {True: [], False: []}
    is_above: bool | None = None
    change = math.nan
    for at, value in enumerate(values):
        off = value - level
        before = values[at - 1] - level
        if at > 0 and (before > 0) != (off > 0):
            change = times[at - 1] + before / (before - off) * (times[at] - times[at - 1])
        if abs(off) <= NOISE * size:
            continue
        if is_above is not None and is_above != (off > 0):
            crossings[off > 0].append(change)
        is_above = off > 0
    spans = [(all_[-1] - all_[0], len(all_) - 1) for all_ in crossings.values() if all_]
    count = sum(number for _, number in spans)
    return sum(span for span, _ in spans) / count if count else None


NUMBERS: Mapping[str, Callable[[Sequence[float], Sequence[float]], float | None]] = {
    "mean": mean,
    "amplitude": amplitude,
    "period": period,
    "arrival": arrival,
}
