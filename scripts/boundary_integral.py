#!/usr/bin/env python3
"""Rupture of a fault between two elastic half-spaces, by a spectral boundary integral: references of docs/verification.

    scripts/boundary_integral.py slip_weakening [spacing in m]
    scripts/boundary_integral.py short_fault [spacing in m]
    scripts/boundary_integral.py rate_and_state [spacing in m]
    scripts/boundary_integral.py slip_weakening_in_space [spacing in m]

prints, at points of the fault, the times at which the slip rate first exceeds 1 mm/s and a hundredth of its largest value, that value and
its time, and the slip at the end. It needs NumPy and shares nothing with the solver. Equations: for a slip D(x, t) the shear traction of the fault is

    T = T0 + dT(x, t) + f - mu V / (2 c_s),   f(k, t) = -mu |k| / 2 (w(0) D(k, t) - integral of w(|k| c_s s) V(k, t - s) ds),

w(p) the integral of C(q) from p to infinity, C the kernel of mode II of P. H. Geubelle and J. R. Rice, J. Mech. Phys. Solids 43 (1995),
1791-1824. In space the slip is a vector: its Fourier components along the wave vector have the kernel of mode II, those across it that
of mode III, J1(q)/q. The fault is repeated with a period; no wave of the next copy arrives within the run.
"""

import sys

import numpy as np

DENSITY, SHEAR_SPEED, PRESSURE_SPEED = 2670.0, 3464.0, 6000.0
SHEAR_MODULUS = DENSITY * SHEAR_SPEED**2
DAMPING = SHEAR_MODULUS / (2 * SHEAR_SPEED)


def bessel(order, x):
    """The Bessel function J0 or J1, from its integral: the trapezoidal rule of a periodic function is exact to rounding."""
    points = int(np.max(x)) // 2 + 40
    total = np.zeros_like(x)
    for angle in (np.arange(points) + 0.5) * np.pi / points:
        total += np.cos(order * angle - x * np.sin(angle))
    return total / points


def remaining_kernels(largest, points_per_unit=100):
    """The points p up to `largest`, and there the integrals of the kernels of modes II and III from p to infinity."""
    p = np.linspace(0, largest, int(largest * points_per_unit) + 1)
    ratio = PRESSURE_SPEED / SHEAR_SPEED
    # J1(x)/x and its integral from 0, on a grid on which both arguments lie.
    fine = np.linspace(0, ratio * largest, int(ratio * largest * points_per_unit) + 1)
    quotient = np.full_like(fine, 0.5)
    quotient[1:] = bessel(1, fine[1:]) / fine[1:]
    w = 1 - cumulative(quotient, fine[1])
    at = lambda values, x: np.interp(x, fine, values)
    kernel = at(quotient, p) + 4 * p * (at(w, ratio * p) - at(w, p))
    kernel += 3 * bessel(0, p) - 4 / ratio * bessel(0, ratio * p)
    static = 2 * (1 - (SHEAR_SPEED / PRESSURE_SPEED) ** 2)
    return p, static - cumulative(kernel, p[1]), at(w, p)


def cumulative(values, spacing):
    """The integral from the first point to each one, by the trapezoidal rule with end corrections (Hermite)."""
    slopes = np.gradient(values, spacing, edge_order=2)
    parts = spacing / 2 * (values[1:] + values[:-1]) + spacing**2 / 12 * (slopes[:-1] - slopes[1:])
    return np.concatenate([[0.0], np.cumsum(parts)])


class SlipWeakening:
    """TPV205-2D of SCEC: the coefficient falls linearly with the slip; a barrier beyond 15 km."""

    period, end = 102.4e3, 3.0
    points = [-12e3, -7.5e3, -6e3, -4.5e3, 0, 3e3, 4.5e3, 6e3, 7.5e3]

    def __init__(self, x):
        self.load = np.full_like(x, 70e6)
        for centre, load in [(0, 81.6e6), (-7.5e3, 78e6), (7.5e3, 62e6)]:
            self.load[abs(x - centre) < 1500 - 1e-6] = load
            # The mean at its edges.
            edges = abs(abs(x - centre) - 1500) < 1e-6
            self.load[edges] = (70e6 + load) / 2
        self.barrier = abs(x) > 15e3 + 1e-6

    def advance(self, elastic, slip, velocity, step, time):
        """The slip rate where the traction is elastic - DAMPING V, for a slip at the end of the step."""
        coefficient = np.where(self.barrier, 1e4, np.maximum(0.525, 0.677 - 0.152 * slip / 0.4))
        return np.maximum(0, (self.load + elastic - 120e6 * coefficient) / DAMPING)

    def commit(self, velocity, step):
        pass


class ShortFault(SlipWeakening):
    """A fault of 12 km under a uniform stress, but for the patch that breaks first: jobs/fault_rupture.toml."""

    points = [0, 3e3, 4.5e3]

    def __init__(self, x):
        super().__init__(x)
        self.load[abs(x) > 1500 + 1e-6] = 70e6
        self.barrier = abs(x) > 6e3 - 1e-6


class RateAndState:
    """The data of TPV101 of SCEC in the plane, without its strengthening ends: ageing law, a smooth perturbation of the stress."""

    period, end = 102.4e3, 2.2
    points = [0, 1.5e3, 3e3]
    pressure, stress, a, b, reference, v0, distance = 120e6, 75e6, 0.008, 0.012, 0.6, 1e-6, 0.02
    start_velocity = 1e-12

    def __init__(self, x):
        inside = abs(x) < 3e3
        self.shape = np.where(inside, 25e6 * np.exp(x**2 / np.where(inside, x**2 - 9e6, -1)), 0)
        arg = np.sinh(self.stress / (self.a * self.pressure)) * 2 * self.v0 / self.start_velocity
        strength = (self.a * np.log(arg) - self.reference) / self.b
        self.state = np.full_like(x, self.distance / self.v0 * np.exp(strength))

    def state_after(self, velocity, step):
        y = velocity * step / self.distance
        grown = step * np.where(y > 1e-9, -np.expm1(-y) / np.maximum(y, 1e-9), 1.0)
        return self.state * np.exp(-y) + grown

    def advance(self, elastic, slip, velocity, step, time):
        rise = np.exp((time - 1) ** 2 / (time * (time - 2))) if 0 < time < 1 else float(time >= 1)
        load = self.stress + self.shape * rise + elastic
        state = self.state_after(velocity, step)
        psi = self.reference + self.b * np.log(self.v0 * state / self.distance)
        scale, direct = 2 * self.v0 * np.exp(-psi / self.a), self.a * self.pressure
        # direct z + DAMPING scale sinh z = load, by Newton's method from above.
        z = np.minimum(load / direct, np.arcsinh(load / (DAMPING * scale)))
        for _ in range(30):
            residual = direct * z + DAMPING * scale * np.sinh(z) - load
            z -= residual / (direct + DAMPING * scale * np.cosh(z))
        return scale * np.sinh(z)

    def commit(self, velocity, step):
        self.state = self.state_after(velocity, step)


def run(fault_of, spacing, courant=0.4):
    count = int(round(fault_of.period / spacing))
    x = (np.arange(count) - count // 2) * spacing
    fault = fault_of(x)
    steps = int(np.ceil(fault.end * PRESSURE_SPEED / (courant * spacing)))
    step = fault.end / steps
    wave = 2 * np.pi * np.fft.rfftfreq(count, spacing)
    p, rest, _ = remaining_kernels(wave[-1] * SHEAR_SPEED * fault.end)
    weights = np.array([np.interp(wave * SHEAR_SPEED * step * n, p, rest) for n in range(steps + 1)])
    # Slip rates at the middle of the steps: the kernel is integrated over each step.
    integrated = step / 2 * (weights[1:] + weights[:-1])
    rates = np.zeros((steps, len(wave)), complex)
    slip, velocity = np.zeros(count), fault.advance(0.0, np.zeros(count), np.zeros(count), 0.0, 0.0)
    velocities = [velocity]
    for n in range(steps):
        past = np.einsum("nk,nk->k", integrated[n:0:-1], rates[:n]) if n else 0
        time, rate = (n + 1) * step, velocity
        for _ in range(4):
            mean = (velocity + rate) / 2
            transformed = np.fft.rfft(mean)
            ahead = slip + step * mean
            delayed = past + integrated[0] * transformed
            force = -SHEAR_MODULUS * wave / 2 * (rest[0] * np.fft.rfft(ahead) - delayed)
            rate = fault.advance(np.fft.irfft(force, count), ahead, (velocity + rate) / 2, step, time)
        mean = (velocity + rate) / 2
        rates[n], slip, velocity = np.fft.rfft(mean), slip + step * mean, rate
        fault.commit(mean, step)
        velocities.append(velocity)
    return x, step, np.array(velocities), slip


class SlipWeakeningInSpace:
    """TPV5 of SCEC before waves from the surface and from the ends of the fault arrive: a quadrant, the first axis along the strike."""

    period, end = 18e3, 2.0
    points = [(0, 0), (2e3, 0), (3e3, 0), (4.5e3, 0), (0, 2e3), (0, 3e3), (2e3, 2e3)]

    def __init__(self, x):
        self.load = np.zeros((2, len(x), len(x)))
        # Edges of the patch have the mean, its corner a quarter.
        part = np.where(abs(x) < 1500 - 1e-6, 1.0, np.where(abs(x) < 1500 + 1e-6, 0.5, 0.0))
        self.load[0] = 70e6 + 11.6e6 * part[:, None] * part

    def advance(self, elastic, slipped):
        """The slip rates where the tractions are elastic - DAMPING V, for a length of the path of slip at the end of the step."""
        traction = self.load + elastic
        size = np.hypot(*traction)
        strength = 120e6 * np.maximum(0.525, 0.677 - 0.152 * slipped / 0.4)
        return traction * np.maximum(0, (size - strength) / DAMPING) / size


def run_in_space(spacing, courant=0.4):
    """The slip along the strike is even in both coordinates and the other one odd, so that their transforms are real."""
    count = int(round(SlipWeakeningInSpace.period / spacing))
    half = count // 2 + 1
    x = np.arange(half) * spacing
    fault = SlipWeakeningInSpace(x)
    steps = int(np.ceil(fault.end * PRESSURE_SPEED / (courant * spacing)))
    step = fault.end / steps
    along = 2 * np.pi * np.fft.rfftfreq(count, spacing)
    wave = np.hypot(along[:, None], along)
    cosine, sine = (part / np.maximum(wave, 1e-300) for part in np.broadcast_arrays(along[:, None], along))
    p, *rest = remaining_kernels(wave.max() * SHEAR_SPEED * fault.end)
    modes = [0, 1]
    weights = np.zeros((steps, 2, half, half), np.float32)
    before = [np.full_like(wave, rest[mode][0]) for mode in modes]
    for n in range(steps):
        for mode in modes:
            after = np.interp(wave * SHEAR_SPEED * step * (n + 1), p, rest[mode])
            weights[n, mode], before[mode] = step / 2 * (before[mode] + after), after
    signs = np.array([1, -1])[:, None, None]

    def whole(field):
        mirrored = np.concatenate([field, signs * field[:, -2:0:-1]], axis=1)
        return np.concatenate([mirrored, signs * mirrored[:, :, -2:0:-1]], axis=2)

    def transform(field):
        """Components along and across the wave vector."""
        strike, dip = np.fft.rfft2(whole(field))[:, :half].real
        return np.array([cosine * strike + sine * dip, cosine * dip - sine * strike])

    def back(modal):
        field = np.array([cosine * modal[0] - sine * modal[1], sine * modal[0] + cosine * modal[1]])
        mirrored = np.concatenate([field, signs * field[:, -2:0:-1]], axis=1)
        return np.fft.irfft2(mirrored, (count, count))[:, :half, :half]

    static = np.array([kernel[0] for kernel in rest])[:, None, None]
    rates = np.zeros((steps, 2, half, half), np.float32)
    slip, slipped = np.zeros_like(fault.load), np.zeros((half, half))
    velocity = fault.advance(0.0, slipped)
    places = [tuple(int(round(part / spacing)) for part in point) for point in fault.points]
    velocities = [[np.hypot(*velocity[:, i, j]) for i, j in places]]
    for n in range(steps):
        past = np.einsum("nmij,nmij->mij", weights[n:0:-1], rates[:n]) if n else 0
        rate = velocity
        for _ in range(4):
            mean = (velocity + rate) / 2
            force = static * transform(slip + step * mean) - past - weights[0] * transform(mean)
            rate = fault.advance(back(-SHEAR_MODULUS * wave / 2 * force), slipped + step * np.hypot(*mean))
        mean = (velocity + rate) / 2
        rates[n], slip, slipped, velocity = transform(mean), slip + step * mean, slipped + step * np.hypot(*mean), rate
        velocities.append([np.hypot(*velocity[:, i, j]) for i, j in places])
    return step, np.array(velocities), [slipped[place] for place in places]


def first_time(step, velocities, level):
    """The time at which the velocities, linear between the steps, first reach a level."""
    at = int(np.argmax(velocities >= level))
    if at == 0:
        return 0.0 if velocities[0] >= level else np.inf
    low, high = velocities[at - 1 : at + 1]
    return step * (at - 1 + (level - low) / (high - low))


def show(point, step, velocities, slip):
    times = [first_time(step, velocities, level) for level in (1e-3, 0.01 * velocities.max())]
    largest, at = velocities.max(), step * velocities.argmax()
    print(f"{point} {times[0]:9.4f} {times[1]:9.4f} {largest:9.4f} {at:9.4f} {slip:9.4f}")


def main():
    faults = {"slip_weakening": SlipWeakening, "short_fault": ShortFault, "rate_and_state": RateAndState}
    spacing = float(sys.argv[2]) if len(sys.argv) > 2 else 100.0
    print("place in m; times of 1 mm/s and of a hundredth of the largest slip rate in s; this in m/s, its time in s; slip at the end in m")
    if sys.argv[1] == "slip_weakening_in_space":
        step, velocities, slips = run_in_space(spacing)
        for (strike, dip), rates, slip in zip(SlipWeakeningInSpace.points, velocities.T, slips):
            show(f"{strike:8.0f} {dip:8.0f}", step, rates, slip)
        return
    fault = faults[sys.argv[1]]
    x, step, velocities, slip = run(fault, spacing)
    for point in fault.points:
        i = int(round((point - x[0]) / spacing))
        show(f"{point:8.0f}", step, velocities[:, i], slip[i])


if __name__ == "__main__":
    main()
