"""The twin's step written to be read: plain NumPy, one thing after the other, roots by bisection.

It is the scheme of `monochord.physics.twin.kernel`, on the same records, some thousand times slower. It
shares the names of rows and fields with the kernel's parts, and no arithmetic: each formula is written down a
second time. The force of a touch follows from its equation alone and the tension from iteration until nothing
changes, where the kernel predicts, corrects and stops early.
"""

from collections.abc import Callable
from dataclasses import replace
from math import cosh, exp, floor, hypot, log1p, pi, sqrt, tanh
from typing import Any, NamedTuple

import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Samples
from monochord.physics.twin import friction, roughness
from monochord.physics.twin import records as r
from monochord.physics.twin.records import (
    ChainParameters,
    Constants,
    ContactSolution,
    ContactState,
    DriverParameters,
    DriverState,
    LayerParameters,
    Motion,
    MountParameters,
    Out,
    Parameters,
    PickupParameters,
    Plausible,
    PreampState,
    SensorState,
    State,
    TouchParameters,
    TurningState,
)
from monochord.physics.twin.stream import Take, Twin, empty_out, take_of

TOLERANCE = 1e-14
"""Relative change at which the tension, and several touches among themselves, have converged."""
MAX_ITERATIONS = 200
"""Of either."""
GAUSS = ((-sqrt(0.6), 5.0 / 18.0), (0.0, 8.0 / 18.0), (sqrt(0.6), 5.0 / 18.0))
"""Nodes and weights: exact for the mean of a polynomial of degree five."""
MASK_64 = (1 << 64) - 1
RIGID = r.record_of(MountParameters, spring=0.0, static=0.0, modal=0.0)[()]
"""What holds an ideal twin's objects."""


class Layer(NamedTuple):
    """A rough layer's u0 in m and F0 in N, as plain numbers: those of records are slow to read."""

    thickness: float
    load: float


def advance_slowly(twin: Twin, frames: Samples) -> tuple[Take, Twin]:
    """Return what `monochord.physics.twin.advance` returns, by the readable step, a millisecond each."""
    sensor = Parameters(*(array[0] for array in twin.parameters))
    batch = State(*(array.copy() for array in twin.state))
    state = State(*(array[0] for array in batch))
    more = None if twin.plausible is None else Plausible(*(array.copy() for array in twin.plausible))
    plausible = None if more is None else Plausible(*(array[0] for array in more))
    bank = state.bank.reshape(r.rows(len(twin.scene.touches)), -1)
    batched_out = empty_out(1, len(twin.scene.touches), frames)
    out = Out(*(array[0] for array in batched_out))
    oversampling = int(sensor.constants.oversampling)
    for frame in range(frames):
        for index in range((twin.start + frame) * oversampling, (twin.start + frame + 1) * oversampling):
            if index % r.CONTROL_PERIOD == 0:
                _update_controls(sensor, state, plausible, bank, index)
            _step(sensor, state, plausible, bank, index)
        _write_frame(sensor, state, plausible, bank, out, frame, twin.start + frame)
    return take_of(batched_out, 0), replace(twin, start=twin.start + frames, state=batch, plausible=more)


def _update_controls(
    sensor: Parameters, state: State, plausible: Plausible | None, bank: Floats, index: int
) -> None:
    """At a control update: where touches will be at the next, the tension, and the compliances."""
    constants: Constants = sensor.constants
    memory: SensorState = state.memory
    nominal = constants.tension
    touches = range(len(sensor.touches))
    time = (index + r.CONTROL_PERIOD) * constants.step
    moving = bool((state.drivers["gate"] != sensor.drivers["on"]).any())
    for t in touches:
        state.motion[t] = state.ahead[t]
        keys = sensor.keys[t, : sensor.touches[t].keys]
        for name in ("position", "force", "clearance", "across"):
            state.ahead[name][t] = np.interp(time, keys["time"], keys[name])
            moving |= bool(state.ahead[name][t] != state.motion[name][t])

    tension = nominal + _drifted(constants, index)
    for t in touches:
        if state.contact[t].time_off < r.CONTACT_HOLD:
            tension += _rise(constants, state.motion[t])
    if plausible is not None:
        chain = plausible.chain
        chain.pressed = sum(
            chain.tension_per_force * state.motion[t].force
            for t in touches
            if state.contact[t].time_off < r.CONTACT_HOLD
        )
        tension += chain.pressed
    if abs(tension - memory.tuned_tension) > r.RETUNING_THRESHOLD * nominal:
        _tune(bank, constants, tension)
        memory.tuned_tension, memory.max_q_tension = tension, bank[r.Q_TENSION].max()

    for t in touches:
        _prepare_touch(sensor, state, plausible, bank, t, tension)
    largest = r.CONTROL_PERIOD * constants.step / r.SWITCHING_TIME
    gates = state.drivers["gate"]
    state.drivers["gate"] = gates + np.clip(sensor.drivers["on"] - gates, -largest, largest)
    if moving:
        memory.steady_time, memory.settled = 0.0, 0.0


def _prepare_touch(
    sensor: Parameters, state: State, plausible: Plausible | None, bank: Floats, t: int, tension: float
) -> None:
    """Fill a touch's depth, its modes' shapes, its residual compliance and its bristles."""
    constants: Constants = sensor.constants
    touch: TouchParameters = sensor.touches[t]
    own: ContactState = state.contact[t]
    now: Motion = state.motion[t]
    ahead: Motion = state.ahead[t]
    length, k1, k2 = constants.length, touch.k1, touch.k2
    places = np.linspace(0.0, length, sensor.compliance.shape[1])
    static_ahead, static_now = (
        np.interp([ahead.position, now.position], places, sensor.compliance[t]) * constants.tension / tension
    )
    others = sum(
        other.force
        * min(ahead.position, other.position)
        * (length - max(ahead.position, other.position))
        / (tension * length)
        for o, other in enumerate(state.ahead)
        if o != t
    )
    layer, mount = _layer(plausible, t), _mount(plausible, t)
    s = _compressed(ahead.force, k1, k2)
    ahead.depth = s * s + static_ahead * ahead.force + others - ahead.clearance
    ahead.depth += mount.static * ahead.force + _closed(ahead.force, layer)
    row = r.SHAPE + r.ROWS_A_TOUCH * t
    half = bank.shape[1] // 2
    n = np.arange(1, half + 1)
    bank[row, :half] = sensor.weights[t] * np.sin(n * pi * now.position / length)
    then = sensor.weights[t] * np.sin(n * pi * ahead.position / length)
    bank[row + 1, :half] = (then - bank[row, :half]) / r.CONTROL_PERIOD
    square = (bank[r.OMEGA2_TENSION] * tension + bank[r.OMEGA2_BENDING])[:half]
    oscillates = square > 0.0
    shape = bank[row, :half][oscillates]
    own.residual_compliance = max(
        0.0, static_now - float(np.sum(shape**2 / (constants.mass * square[oscillates])))
    )
    own.residual_compliance += mount.spring
    if own.s > 0.0:
        own.eta = _approach(own.s, k1, k2, own.residual_compliance, layer)
    load = max(now.force, r.MIN_BRISTLE_FORCE)
    normal = k1 + 1.5 * k2 * _compressed(load, k1, k2)
    normal = 1.0 / (1.0 / normal + layer.thickness / (layer.load + load))
    own.bristle_stiffness = 1.0 / (1.0 / (touch.tangential_ratio * normal) + own.residual_compliance)
    own.bristle_damping = touch.beta * load / constants.step
    if plausible is not None and plausible.turnings[t].half + plausible.turnings[t].arm > 0.0:
        turns: TurningState = plausible.turnings[t]
        slopes, weights = plausible.slopes[t], plausible.slope_weights[t]
        slopes[0] = weights * np.cos(n * pi * now.position / length)
        slopes[1] = (weights * np.cos(n * pi * ahead.position / length) - slopes[0]) / r.CONTROL_PERIOD
        firm = turns.half**2 * normal + turns.arm * load
        whole = float(np.interp(now.position, places, plausible.slope_compliance[t]))
        modal = float(np.sum(slopes[0][oscillates] ** 2 / (constants.mass * square[oscillates])))
        rest = max(0.0, whole * sqrt(constants.tension / tension) - modal)
        turns.stiffness = 1.0 / (1.0 / firm + rest)
    if own.time_off >= r.CONTACT_HOLD:
        own.height = _height(touch, own, _surface_seed(constants, t))


def _layer(plausible: Plausible | None, t: int) -> Layer:
    """Return a touch's rough layer, of no thickness in an ideal twin."""
    if plausible is None:
        return Layer(thickness=0.0, load=1.0)
    layer: LayerParameters = plausible.layers[t]
    return Layer(thickness=float(layer.thickness), load=float(layer.load))


def _mount(plausible: Plausible | None, t: int) -> Any:
    """Return a touch's `MountParameters`, rigid in an ideal twin."""
    return RIGID if plausible is None else plausible.mounts[t]


def _closed(force: float, layer: Layer) -> float:
    """Return by how much a rough layer closes, in m."""
    return layer.thickness * log1p(force / layer.load)


def _drifted(constants: Constants, index: int) -> float:
    """Return the drift of the tension at a step, in N, a quarter of the tension at most."""
    drift = constants.drift + constants.drift_rate * index * constants.step
    return float(np.clip(drift, -0.25 * constants.tension, 0.25 * constants.tension))


def _rise(constants: Constants, motion: Motion) -> float:
    """Return k_T F, or solve T^2 (T - T0) = E A F^2 x (L - x) / (2 L^2) for T - T0, in N."""
    if constants.linear_law == 1:
        return float(constants.tension_per_force) * motion.force
    length, nominal, x = constants.length, constants.tension, motion.position
    right = constants.axial_stiffness * motion.force**2 * x * (length - x) / (2.0 * length**2)
    return _bisected(lambda rise: (nominal + rise) ** 2 * rise - right, 0.0, right / nominal**2)


def _tune(bank: Floats, constants: Constants, tension: float) -> None:
    """Fill the propagator: one step of each mode's closed solution."""
    step, mass = constants.step, constants.mass
    square = bank[r.OMEGA2_TENSION] * tension + bank[r.OMEGA2_BENDING]
    own = square > 0.0
    square, sigma, stretch = square[own], bank[r.DECAY, own], bank[r.STRETCH, own]
    ring = np.sqrt(square - sigma**2)
    decay = np.exp(-sigma * step)
    cosine, sine = decay * np.cos(ring * step), decay * np.sin(ring * step) / ring
    bank[r.Q_Q, own], bank[r.Q_V, own] = cosine + sigma * sine, sine
    bank[r.V_Q, own], bank[r.V_V, own] = -square * sine, cosine - sigma * sine
    bank[r.Q_FORCE, own] = (1.0 - cosine - sigma * sine) / (mass * square)
    bank[r.V_FORCE, own] = sine / mass
    bank[r.Q_TENSION, own] = bank[r.Q_FORCE, own] * stretch * constants.tension_gain
    bank[r.V_TENSION, own] = bank[r.V_FORCE, own] * stretch * constants.tension_gain


def _step(sensor: Parameters, state: State, plausible: Plausible | None, bank: Floats, index: int) -> None:
    """Take one step: hold the drivers' forces, propagate every mode, then solve tension and touches."""
    constants: Constants = sensor.constants
    memory: SensorState = state.memory
    step, count = constants.step, len(sensor.touches)
    shake = 0.0
    if sensor.sound.size:
        frame = (index // constants.oversampling) % sensor.sound.size
        shake = constants.frame_acceleration * sensor.sound[frame]
    first, second = _driver_forces(sensor, state, plausible)
    push = bank[r.DRIVE_1] * first + bank[r.DRIVE_2] * second + bank[r.FRAME] * shake
    q, v = bank[r.Q].copy(), bank[r.V].copy()
    q_free = bank[r.Q_Q] * q + bank[r.Q_V] * v + bank[r.Q_FORCE] * push
    v_free = bank[r.V_Q] * q + bank[r.V_V] * v + bank[r.V_FORCE] * push

    solutions = _moved_touches(sensor, state, plausible, bank, index)
    included = memory.tuned_tension - constants.tension - _pressed_tension(plausible)
    included -= _drifted(constants, index - index % r.CONTROL_PERIOD)
    free = float(bank[r.STRETCH] @ q_free**2)
    stretch, tension, q_new, force = free, 0.0, q_free, np.zeros_like(q)
    if constants.linear_law == 0:
        tension = 0.5 * constants.tension_per_stretch * (memory.stretch + free) - included
        stretch -= 2.0 * tension * float((bank[r.STRETCH] * bank[r.Q_TENSION]) @ (q_free * (q_free + q)))
    for t in range(count):
        alone = _predicted(sensor, state, plausible, solutions[t], bank, t, q_free) * bank[r.Q_FORCE]
        stretch += float(bank[r.STRETCH] @ (alone * (2.0 * q_free + alone)))
    stretch = max(0.0, stretch)
    for turn in range(MAX_ITERATIONS):
        if constants.linear_law == 0:
            tension = 0.5 * constants.tension_per_stretch * (memory.stretch + stretch) - included
            tension = max(tension, -r.MAX_SLACK / memory.max_q_tension)
        pull = bank[r.Q_TENSION] * tension
        q_pulled, compliance = (q_free - pull * q) / (1.0 + pull), bank[r.Q_FORCE] / (1.0 + pull)
        force = _solve_touches(
            sensor, state, plausible, bank, q_pulled, compliance, solutions, rubbing=turn == 0
        )
        q_new = q_pulled + compliance * force
        before, stretch = stretch, float(bank[r.STRETCH] @ q_new**2)
        if abs(stretch - before) <= TOLERANCE * stretch:
            break
    memory.stretch = stretch
    bank[r.V] = v_free + bank[r.V_FORCE] * force - bank[r.V_TENSION] * tension * (q_new + q)
    bank[r.Q] = q_new
    memory.coil_speed_1 = bank[r.SENSE_1] @ bank[r.V]
    memory.coil_speed_2 = bank[r.SENSE_2] @ bank[r.V]
    for t in range(count):
        _keep_turn(plausible, state.contact[t], solutions[t], bank, t)
        _keep_contact(sensor.touches[t], state.contact[t], solutions[t], step, _surface_seed(constants, t))
        if plausible is not None:
            modes = plausible.mount_modes[t]
            modes["q"] += modes["q_force"] * solutions[t].force
            modes["v"] += modes["v_force"] * solutions[t].force
    state.solution[:] = solutions
    if plausible is not None:
        plausible.coils["place_before"] = plausible.coils["place"]
        plausible.coils["place"] = bank[[r.DRIVE_1, r.DRIVE_2]] @ bank[r.Q]


def _pressed_tension(plausible: Plausible | None) -> float:
    """Return the tension in N that a press makes beside the geometric law."""
    return 0.0 if plausible is None else float(plausible.chain.pressed)


def _keep_turn(
    plausible: Plausible | None, own: ContactState, solution: ContactSolution, bank: Floats, t: int
) -> None:
    """Take over the string's slope at a touch after a step."""
    if plausible is None:
        return
    turns: TurningState = plausible.turnings[t]
    slope = float(plausible.slopes[t, 0] @ bank[r.Q, : plausible.slopes.shape[2]])
    pressed = own.s > 0.0 and solution.s > 0.0
    turns.deflection = turns.deflection + slope - turns.slope if pressed else 0.0
    turns.slope = slope


def _moved_touches(
    sensor: Parameters, state: State, plausible: Plausible | None, bank: Floats, index: int
) -> Any:
    """Move the touches, and what holds them, to the end of a step; return what their solutions start from."""
    past = (index % r.CONTROL_PERIOD + 1.0) / r.CONTROL_PERIOD
    solutions = np.zeros(len(sensor.touches), r.dtype_of(ContactSolution))
    for t in range(len(solutions)):
        solution: ContactSolution = solutions[t]
        now: Motion = state.motion[t]
        ahead: Motion = state.ahead[t]
        travel = (ahead.position - now.position) / r.CONTROL_PERIOD
        if travel != 0.0:
            bank[r.SHAPE + r.ROWS_A_TOUCH * t] += bank[r.SHAPE + r.ROWS_A_TOUCH * t + 1]
            if plausible is not None:
                plausible.slopes[t, 0] += plausible.slopes[t, 1]
        rolls = sensor.touches[t].rolls != 0.0
        solution.speed_along = 0.0 if rolls else travel / sensor.constants.step
        solution.rolled = travel if rolls else 0.0
        solution.surface = now.depth + past * (ahead.depth - now.depth) + state.contact[t].height
        if plausible is not None:
            modes = plausible.mount_modes[t]
            q, v = modes["q"].copy(), modes["v"].copy()
            modes["q"], modes["v"] = modes["q_q"] * q + modes["q_v"] * v, modes["v_q"] * q + modes["v_v"] * v
            solution.surface -= modes["q"].sum()
    return solutions


def _driver_forces(sensor: Parameters, state: State, plausible: Plausible | None) -> tuple[float, float]:
    """Return both drivers' forces in N, those of their magnets with them."""
    memory: SensorState = state.memory
    first, second = (
        _driver_force(
            sensor.drivers[d], state.drivers[d], speed, 0.0 if plausible is None else plausible.coils[d].bias
        )
        for d, speed in enumerate((memory.coil_speed_1, memory.coil_speed_2))
    )
    if plausible is None:
        return first, second
    coils = plausible.coils
    coils["drive"] = first, second
    magnets = coils["pull"] * (coils["place"] + 0.5 * (coils["place"] - coils["place_before"]))
    return first + magnets[0], second + magnets[1]


def _driver_force(driver: DriverParameters, memory: DriverState, velocity: float, bias: float) -> float:
    """Return a driver's force in N: band filter (trapezoidal rule), extrapolated half a step, and limit."""
    g, k = driver.g, driver.k
    band = (memory.first + g * (velocity - memory.second)) / (1.0 + g * (g + k))
    low = memory.second + g * band
    output, before = k * band, memory.output
    memory.first, memory.second, memory.output = 2.0 * band - memory.first, 2.0 * low - memory.second, output
    if driver.limit == 0.0 or memory.gate == 0.0:
        return 0.0
    pushed = _saturated(driver.gain * (1.5 * output - 0.5 * before) + bias)
    return memory.gate * driver.limit * (pushed - tanh(bias)) * cosh(bias) ** 2


def _saturated(x: float) -> float:
    """Return tanh(x), as the kernel has it."""
    half = 0.5 * float(np.clip(x, -20.0, 20.0))
    fraction = 11.0
    for odd in (9.0, 7.0, 5.0, 3.0, 1.0):
        fraction = odd + half * half / fraction
    return 2.0 * (half / fraction) / (1.0 + (half / fraction) ** 2)


def _solve_touches(
    sensor: Parameters,
    state: State,
    plausible: Plausible | None,
    bank: Floats,
    q: Floats,
    compliance: Floats,
    solutions: Any,
    *,
    rubbing: bool,
) -> Floats:
    """Solve all touches in turn until none changes; return their modal force.

    Friction is solved in the first iteration of the tension only, with `rubbing`, and held in those that
    follow.
    """
    half, step = q.size // 2, sensor.constants.step
    shapes = [bank[r.SHAPE + r.ROWS_A_TOUCH * t, :half] for t in range(len(solutions))]
    normal = sum((one.force * shape for one, shape in zip(solutions, shapes, strict=True)), np.zeros(half))
    tangential = sum(
        (one.force_across * shape for one, shape in zip(solutions, shapes, strict=True)), np.zeros(half)
    )
    moments = np.zeros(len(solutions))
    for _ in range(MAX_ITERATIONS):
        change = 0.0
        for t, shape in enumerate(shapes):
            one: ContactSolution = solutions[t]
            before, before_across = one.force, one.force_across
            slope, stiffness = np.zeros(half), 0.0
            if plausible is not None and state.contact[t].s > 0.0:
                slope, stiffness = plausible.slopes[t, 0], float(plausible.turnings[t].stiffness)
            normal = normal - shape * one.force - slope * moments[t]
            free = q[:half] + compliance[:half] * normal
            # M = -k (z + z_new) / 2, z_new = z + slope - slope_old: linear in the force, m + g f.
            base, gain = 0.0, 0.0
            if plausible is not None and stiffness > 0.0:
                turns: TurningState = plausible.turnings[t]
                own = 2.0 / stiffness + float(slope**2 @ compliance[:half])
                base = -(2.0 * turns.deflection + float(slope @ free) - turns.slope) / own
                gain = -float((slope * shape) @ compliance[:half]) / own
            crossing = float((slope * shape) @ compliance[:half])
            height = float(shape @ free) + crossing * base
            one.s, one.eta, one.force = _pressed(
                one.surface - height,
                float(shape**2 @ compliance[:half]) + crossing * gain + _mount(plausible, t).modal,
                state.contact[t],
                sensor.touches[t],
                _layer(plausible, t),
                step,
            )
            moments[t] = base + gain * one.force
            normal = normal + shape * one.force + slope * moments[t]
            if rubbing:
                tangential = tangential - shape * one.force_across
                across = float(shape @ (q[half:] + compliance[half:] * tangential))
                _rub(sensor, state, t, one, across, float(shape**2 @ compliance[half:]))
                tangential = tangential + shape * one.force_across
            change = max(change, abs(one.force - before), abs(one.force_across - before_across))
        if len(solutions) <= 1 or change <= TOLERANCE * solutions["force"].max():
            break
    return np.concatenate([normal, tangential])


def _predicted(
    sensor: Parameters,
    state: State,
    plausible: Plausible | None,
    one: ContactSolution,
    bank: Floats,
    t: int,
    q_free: Floats,
) -> Floats:
    """Return the modal force of a touch that presses alone on a string that moves freely, (modes,) in N."""
    half, step = q_free.size // 2, sensor.constants.step
    shape = bank[r.SHAPE + r.ROWS_A_TOUCH * t, :half]
    gap = one.surface - float(shape @ q_free[:half])
    compliance = float(shape**2 @ bank[r.Q_FORCE, :half]) + _mount(plausible, t).modal
    _, _, one.force = _pressed(
        gap, compliance, state.contact[t], sensor.touches[t], _layer(plausible, t), step
    )
    return np.concatenate([shape * one.force, np.zeros(half)])


def _pressed(
    gap: float, compliance: float, own: ContactState, touch: TouchParameters, layer: Layer, step: float
) -> tuple[float, float, float]:
    """Solve eta + compliance force(eta) = gap for one touch; return s, eta and the force held over the step.

    The force is the rise of stored energy over that of eta, that is the mean elastic force over eta, and Hunt
    and Crossley's loss while contact lasts; where it ends within the step, all stored energy is returned.
    """
    k1, k2, residual = float(touch.k1), float(touch.k2), float(own.residual_compliance)
    beta, s_old, eta_old = float(touch.beta / step), float(own.s), float(own.eta)
    if gap <= 0.0 and s_old == 0.0:
        return 0.0, gap, 0.0

    def force_to(s: float) -> float:
        f, f_old = _elastic(s, k1, k2), _elastic(s_old, k1, k2)
        secant = k1 * (s + s_old) + k2 * (s**2 + s * s_old + s_old**2)  # (f - f_old) / (s - s_old)
        x = (f - f_old) / (layer.load + f_old)
        closing = (log1p(x) / x if x != 0.0 else 1.0) / (layer.load + f_old)
        work = layer.thickness * secant * (1.0 - layer.load * closing)
        distance = layer.thickness * secant * closing
        for node, weight in GAUSS:
            between = 0.5 * (s + s_old) + 0.5 * (s - s_old) * node
            slope = 2.0 * between + residual * between * (2.0 * k1 + 3.0 * k2 * between)
            work, distance = work + weight * slope * _elastic(between, k1, k2), distance + weight * slope
        mean = work / distance if eta_old >= 0.0 else work * s / (distance * s - eta_old)
        return max(0.0, mean + 0.5 * beta * (f + f_old) * (s * s - s_old * s_old))

    if gap <= 0.0 or (s_old > 0.0 and compliance * force_to(0.0) >= gap):
        force = _elastic(s_old, k1, k2)
        stored = s_old**4 * (0.5 * k1 + 0.4 * k2 * s_old) + 0.5 * residual * force**2
        stored += layer.thickness * force - layer.load * _closed(force, layer)
        lowest = gap - compliance * stored / eta_old
        eta = _bisected(lambda eta: eta + compliance * stored / (eta_old - eta) - gap, lowest, 0.0)
        return 0.0, eta, stored / (eta_old - eta)

    def eta_at(s: float) -> float:
        return _approach(s, k1, k2, residual, layer)

    s = _bisected(lambda s: eta_at(s) + compliance * force_to(s) - gap, 0.0, sqrt(gap))
    return s, eta_at(s), force_to(s)


def _elastic(s: float, k1: float, k2: float) -> float:
    """Return the elastic force in N at a compression s^2."""
    return k1 * s**2 + k2 * s**3


def _approach(s: float, k1: float, k2: float, residual: float, layer: Layer) -> float:
    """Return eta in m: compression s^2, deflection of the modes beyond the bank, and closure of the layer."""
    return s**2 + residual * _elastic(s, k1, k2) + _closed(_elastic(s, k1, k2), layer)


def _compressed(force: float, k1: float, k2: float) -> float:
    """Return s where the elastic force has a given value."""
    if force <= 0.0:
        return 0.0
    most = (force / k2) ** (1.0 / 3.0) if k2 > 0.0 else sqrt(force / k1)
    return _bisected(lambda s: _elastic(s, k1, k2) - force, 0.0, 1.01 * most)


def _bisected(rising: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of a rising function between two numbers, to their last digit."""
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return middle
        if rising(middle) > 0.0:
            high = middle
        else:
            low = middle


def _rub(
    sensor: Parameters, state: State, t: int, one: ContactSolution, across: float, compliance: float
) -> None:
    """Solve the bristles across and along the string under the touch's force, which is known by now."""
    constants: Constants = sensor.constants
    touch: TouchParameters = sensor.touches[t]
    own: ContactState = state.contact[t]
    motion: Motion = state.motion[t]
    load, step, length, axial = one.force, constants.step, constants.length, constants.axial_stiffness
    soft = motion.position * (length - motion.position) / (axial * length) if axial > 0.0 else 0.0
    z = np.array([own.z, own.z_along])
    moved = np.array([
        motion.across * step - (across - own.string_across),
        one.speed_along * step + soft * own.force_along,
    ])  # fmt: skip
    yielding = np.array([compliance, soft])
    force, z_new, slid, kind = np.zeros(2), np.zeros(2), moved, r.NONE
    if load > 0.0:
        static, kinetic = touch.static_friction, touch.kinetic_friction
        stiffness, speed = own.bristle_stiffness, own.sliding_speed
        coefficient = kinetic + (static - kinetic) * exp(-((speed / touch.stribeck_speed) ** 2))
        longest = coefficient * load / stiffness
        stretched = hypot(own.z, own.z_along) / longest
        u = min(1.0, max(0.0, (stretched - friction.BREAKAWAY) / (1.0 - friction.BREAKAWAY)))
        creep = 3.0 * u**2 - 2.0 * u**3
        fade = creep * speed * step / longest
        damping = min(own.bristle_damping, 4.0 * stiffness / fade) if fade > 0.0 else own.bristle_damping
        # force = stiffness z_new + damping (z_new - z), z_new = (z + moved - yielding force) / (1 + fade)
        total = (stiffness + damping) / (1.0 + fade)
        force = (total * (z + moved) - damping * z) / (1.0 + yielding * total)
        slid = moved - yielding * force
        z_new = (z + slid) / (1.0 + fade)
        kind = r.STICK if creep == 0.0 else r.CREEP if creep < 1.0 else r.SLIDE
        whole = hypot(*force)
        if whole > static * load:
            force, z_new = force * static * load / whole, z_new * static * load / whole
            slid, kind = moved - yielding * force, r.SLIDE
    one.force_across, one.force_along = force
    one.z, one.z_along = z_new
    one.slid_across, one.slid_along = slid
    one.friction, one.string_across = kind, across + compliance * force[0]


def _keep_contact(
    touch: TouchParameters, own: ContactState, one: ContactSolution, step: float, seed: int
) -> None:
    """Take over a touch's solution; its place on the object moves by what the bristles lost."""
    slid = np.array([one.slid_across, one.slid_along])
    lost = slid - (np.array([one.z, one.z_along]) - np.array([own.z, own.z_along]))
    own.s, own.eta, own.force = one.s, one.eta, one.force
    own.z, own.z_along, own.force_along = one.z, one.z_along, one.force_along
    own.string_across, own.friction = one.string_across, one.friction
    own.sliding_speed = hypot(*slid) / step
    touches = one.force > 0.0
    begins = touches and own.time_off >= r.CONTACT_HOLD
    own.time_off = 0.0 if touches else own.time_off + step
    gone = np.zeros(2)
    if own.time_off < r.CONTACT_HOLD:
        path = np.array([own.path_across, own.path_along]) + lost
        lag, smooth, mark = (
            path.copy()
            if begins
            else np.array([getattr(own, f"{name}_across"), getattr(own, f"{name}_along")])
            for name in ("lag", "smooth", "mark")
        )
        own.path_across, own.path_along = path
        own.rolled += one.rolled
        along = own.path_along + own.rolled
        if abs(own.path_across - own.read_across) + abs(along - own.read_along) > r.MIN_SURFACE_MOTION:
            own.height = _height(touch, own, seed)
            own.read_across, own.read_along = own.path_across, along
        lag += step / r.PATH_TIME * (path - lag)
        smooth += step / r.PATH_TIME * (lag - smooth)
        distance = float(np.hypot(*(smooth - mark)))
        if distance > r.SLIP_PLAY:
            gone = (smooth - mark) * (1.0 - r.SLIP_PLAY / distance)
        own.lag_across, own.lag_along = lag
        own.smooth_across, own.smooth_along = smooth
        own.mark_across, own.mark_along = mark + gone
    own.speed_across += step / r.SLIP_SPEED_TIME * (gone[0] / step - own.speed_across)
    own.speed_along += step / r.SLIP_SPEED_TIME * (gone[1] / step - own.speed_along)
    own.mean_force += step / r.CONTACT_HOLD * (one.force - own.mean_force)


def _write_frame(
    sensor: Parameters,
    state: State,
    plausible: Plausible | None,
    bank: Floats,
    out: Out,
    frame: int,
    index: int,
) -> None:
    """Write one frame: microphones and labels."""
    constants: Constants = sensor.constants
    memory: SensorState = state.memory
    pickup: PickupParameters = sensor.pickup
    taut = memory.tuned_tension / constants.tension
    near, far = taut * (bank[r.END_1] @ bank[r.Q]), taut * (bank[r.END_2] @ bank[r.Q])
    past = ((index * constants.oversampling) % r.CONTROL_PERIOD) / r.CONTROL_PERIOD
    if plausible is not None:
        more_near, more_far = _residual_ends(sensor, state, plausible, past)
        near, far = near + more_near, far + more_far
    air = float(sensor.sound[index % sensor.sound.size]) if sensor.sound.size else 0.0
    raw = np.array([
        pickup.gain_1 * (pickup.own_1 * near + (1.0 - pickup.own_1) * far) + pickup.air_1 * air,
        pickup.gain_2 * (pickup.own_2 * far + (1.0 - pickup.own_2) * near) + pickup.air_2 * air,
    ])  # fmt: skip
    if plausible is not None:
        raw += _picked_up(plausible, index)
    amplified = [_amplified(pickup, state.preamps[c], raw[c]) for c in (0, 1)]
    if plausible is not None:
        amplified = [_distorted(plausible, signal) for signal in amplified]
    for c in (0, 1):
        noisy = amplified[c] + pickup.noise * _normal_noise(int(constants.seed), 4 * index + 2 * c)
        out.microphones[c, frame] = np.clip(noisy, -1.0, 1.0)
    for t in range(len(sensor.touches)):
        own: ContactState = state.contact[t]
        touching = own.time_off < r.CONTACT_HOLD
        if own.touching != touching:
            own.touching, memory.steady_time, memory.settled = touching, 0.0, 0.0
        now, ahead = state.motion[t].position, state.ahead[t].position
        out.contact[t, frame] = touching
        out.position[t, frame] = now + past * (ahead - now) - (plausible.chain.offset if plausible else 0.0)
        out.force[t, frame] = own.mean_force * touching
        out.reaction[t, frame] = own.force
        out.slip[t, frame] = touching and hypot(own.speed_across, own.speed_along) > r.SLIP_SPEED
        out.across[t, frame], out.along[t, frame] = own.speed_across, own.speed_along
        out.friction[t, frame] = own.friction
    period = constants.step * constants.oversampling
    steady = True
    for value, c in zip(amplified, (1, 2), strict=True):
        levels = [
            level + period / time * (value**2 - level)
            for time, level in (
                (r.SHORT_LEVEL_TIME, getattr(memory, f"short_level_{c}")),
                (r.LONG_LEVEL_TIME, getattr(memory, f"long_level_{c}")),
            )
        ]
        setattr(memory, f"short_level_{c}", levels[0])
        setattr(memory, f"long_level_{c}", levels[1])
        steady &= abs(levels[0] - levels[1]) <= r.LEVEL_TOLERANCE * (levels[1] + r.SILENT_POWER)
    memory.steady_time = memory.steady_time + period if steady else 0.0
    if memory.steady_time >= r.SETTLING_TIME:
        memory.settled = 1.0
    out.settled[frame] = memory.settled


def _residual_ends(
    sensor: Parameters, state: State, plausible: Plausible, past: float
) -> tuple[float, float]:
    """Return what a static force of the touches' size brings to the ends beside the bank's modes, in N."""
    both = np.zeros(2)
    places = np.linspace(0.0, sensor.constants.length, sensor.compliance.shape[-1])
    for t, shares in enumerate(plausible.end_shares):
        position = (1.0 - past) * state.motion[t].position + past * state.ahead[t].position
        force = plausible.chain.normal * state.contact[t].force
        force += plausible.chain.across * state.solution[t].force_across
        both += force * np.array([np.interp(position, places, share) for share in shares])
    return float(both[0]), float(both[1])


def _picked_up(plausible: Plausible, index: int) -> Floats:
    """Return what drivers and mains induce in both microphones."""
    chain: ChainParameters = plausible.chain
    mixing = np.array([[chain.feed_own, chain.feed_other], [chain.feed_other, chain.feed_own]])
    cycle = np.linspace(0.0, 1.0, plausible.hum.size)
    hum = np.interp((chain.hum_step * index) % 1.0, cycle, plausible.hum)
    return mixing @ plausible.coils["drive"] + np.array([chain.hum_1, chain.hum_2]) * hum


def _distorted(plausible: Plausible, signal: float) -> float:
    """Return a signal after the stage before the converter."""
    x = float(np.clip(signal, -r.STAGE_CLIP, r.STAGE_CLIP))
    return x + plausible.chain.second * x**2 + plausible.chain.third * x**3


def _amplified(pickup: PickupParameters, memory: PreampState, signal: float) -> float:
    """Return a signal after the preamplifier: a high-pass of one pole and a low-pass of two, trapezoidal."""
    step = pickup.low_cut * (signal - memory.low_cut)
    passed = signal - (memory.low_cut + step)
    band = (memory.first + pickup.g * (passed - memory.second)) / (1.0 + pickup.g * (pickup.g + pickup.k))
    low = memory.second + pickup.g * band
    memory.low_cut, memory.first = memory.low_cut + 2.0 * step, 2.0 * band - memory.first
    memory.second = 2.0 * low - memory.second
    return low


def _normal_noise(seed: int, index: int) -> float:
    """Return the sum of eight uniform numbers, shifted and scaled to zero mean and unit variance."""
    words = [(_bits(seed, index + half) >> 16 * piece) & 0xFFFF for half in (0, 1) for piece in range(4)]
    return (sum(words) - 8 * 32767.5) * sqrt(12.0 / 8.0) / 65536.0


def _height(touch: TouchParameters, own: ContactState, seed: int) -> float:
    """Return a surface's height in m where it touches: octaves of random heights at whole numbers."""
    across = own.path_across / touch.roughness_length
    along = (own.path_along + own.rolled) / touch.roughness_length
    total = 0.0
    for octave in range(roughness.OCTAVES):
        column, row = floor(across * 2**octave), floor(along * 2**octave)
        key = _derived_seed(seed, octave)
        heights = [
            [(_bits(key, ((column + i) << 24) + row + j) >> 11) / 2**52 - 1.0 for j in (0, 1)] for i in (0, 1)
        ]
        x, y = across * 2**octave - column, along * 2**octave - row
        x, y = 3.0 * x**2 - 2.0 * x**3, 3.0 * y**2 - 2.0 * y**3
        total += 0.5**octave * float(np.array([1.0 - x, x]) @ np.array(heights) @ np.array([1.0 - y, y]))
    return touch.roughness * roughness.RMS_SCALE * total


def _surface_seed(constants: Constants, t: int) -> int:
    return _derived_seed(int(constants.seed), roughness.OCTAVES + t)


def _derived_seed(seed: int, index: int) -> int:
    return _bits(seed, roughness.SEED_INDEX + index) >> 2


def _bits(seed: int, index: int) -> int:
    """Return 64 bits by SplitMix64."""
    x = (seed * 0x9E3779B97F4A7C15 + index) & MASK_64
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & MASK_64
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & MASK_64
    return x ^ (x >> 31)
