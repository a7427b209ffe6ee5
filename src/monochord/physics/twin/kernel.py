"""The whole sensor, step by step: touches, drivers, string and microphones in one compiled kernel.

In one step the drivers' forces are held and every mode is propagated exactly; then the touches and the
string's stretch are solved together. The stretch enters as an extra tension at the mean of old and new
position (a discrete gradient, so that energy is conserved), which makes the touches' equations scalar once
the tension is known; the tension is found by iteration, and converges in two or three rounds because it is
small.

What the world `plausible` adds stands in branches on `plausible`, which is None for an ideal twin: its kernel
is compiled without them.

At every control update, `CONTROL_PERIOD` steps apart, the touches' motion is read: position, force, clearance
and speed run linearly between keys. A force is converted to the depth at which a string at rest would press
back with it; the string then decides what force there really is.
"""

import sys
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from monochord.core.types import Floats
from monochord.physics.twin import (
    contact,
    electronics,
    friction,
    jit,
    mount,
    records,
    roughness,
    string,
    turning,
)
from monochord.physics.twin.jit import called, inlined
from monochord.physics.twin.records import (
    CONTACT_HOLD,
    CONTROL_PERIOD,
    CREEP,
    FORCE_TOLERANCE,
    LEVEL_TOLERANCE,
    LONG_LEVEL_TIME,
    MAX_CONTACT_SWEEPS,
    MAX_SLACK,
    MAX_STRETCH_ITERATIONS,
    MIN_BRISTLE_FORCE,
    MIN_GUESS_CHANGE,
    MIN_SURFACE_MOTION,
    NONE,
    PATH_TIME,
    RETUNING_THRESHOLD,
    SETTLING_TIME,
    SHORT_LEVEL_TIME,
    SILENT_POWER,
    SLIDE,
    SLIP_PLAY,
    SLIP_SPEED,
    SLIP_SPEED_TIME,
    STICK,
    SWITCHING_TIME,
    ChainParameters,
    CoilEffects,
    Constants,
    ContactSolution,
    ContactState,
    Integers,
    LayerParameters,
    Motion,
    Out,
    Parameters,
    Plausible,
    Records,
    SensorState,
    State,
    TouchParameters,
    TurningState,
)


@called
def read_motion(keys: Records, count: int, time: float, motion: Motion) -> None:
    """Fill a motion, save its depth, from keys at a time; constant before the first and after the last."""
    i = 0
    while i < count and keys[i].time <= time:
        i += 1
    if i in (0, count):
        end = keys[min(i, count - 1)]
        motion.position, motion.force = end.position, end.force
        motion.clearance, motion.across = end.clearance, end.across
        return
    a, b = keys[i - 1], keys[i]
    past, period = time - a.time, b.time - a.time
    motion.position = a.position + (b.position - a.position) * past / period
    motion.force = a.force + (b.force - a.force) * past / period
    motion.clearance = a.clearance + (b.clearance - a.clearance) * past / period
    motion.across = a.across + (b.across - a.across) * past / period


@called
def interpolated(table: Floats, share: float) -> float:
    """Return a value of a table over 0 to 1, linearly between its entries."""
    place = share * (table.size - 1)
    i = min(int(place), table.size - 2)
    return table[i] + (place - i) * (table[i + 1] - table[i])


@called
def cross_compliance(a: float, b: float, length: float, tension: float) -> float:
    """Return the deflection at b by a newton at a of a flexible string at rest, in m/N."""
    return min(a, b) * (length - max(a, b)) / (tension * length)


@called
def surface_depth(
    force: float,
    k1: float,
    k2: float,
    static: float,
    others: float,
    clearance: float,
    layer: LayerParameters | None = None,
) -> float:
    """Return the depth in m of a surface that presses with a force on a string of static compliance in m/N.

    `others` is the deflection that other touches cause there, in m.
    """
    s = contact.static_root(force, k1, k2)
    depth = s * s + static * force + others - clearance
    if layer is not None:
        depth += contact.layer_closure(force, layer)
    return depth


@inlined
def drifted(start: float, rate: float, time: float, tension: float) -> float:
    """Return the deviation of the tension from its nominal value at a time, in N: a quarter of it at most."""
    limit = 0.25 * tension
    return min(limit, max(-limit, start + rate * time))


@called
def geometric_rise(force: float, position: float, length: float, tension: float, stretch: float) -> float:
    """Return the rise of tension in N by a static press; see `monochord.physics.theory.geometric_tension`."""
    pull = tension * length
    cubic = 3.0 * force * force * position * (length - position) * stretch / (pull * pull * (2.0 * tension))
    w = np.sqrt(cubic)
    if w < 1e-9:
        return 0.0
    return tension * (w / (2.0 * np.sinh(np.arcsinh(1.5 * w) / 3.0)) - 1.0)


@called
def _update_motion(
    sensor: Parameters, state: State, plausible: Plausible | None, index: int
) -> tuple[float, bool, bool]:
    """Read the touches' motion; return the static tension in N, whether one moves, and whether one moved."""
    constants: Constants = sensor.constants
    step = constants.step
    moves, moved = False, False
    if plausible is not None:
        plausible.chain.pressed = 0.0
    tension = constants.tension + drifted(
        constants.drift, constants.drift_rate, index * step, constants.tension
    )
    for t in range(len(sensor.touches)):
        now: Motion = state.motion[t]
        ahead: Motion = state.ahead[t]
        moved = moved or now.position != ahead.position
        now.position = ahead.position
        moved = moved or now.force != ahead.force
        now.force = ahead.force
        moved = moved or now.clearance != ahead.clearance
        now.clearance = ahead.clearance
        moved = moved or now.across != ahead.across
        now.across = ahead.across
        moved = moved or now.depth != ahead.depth
        now.depth = ahead.depth
        read_motion(sensor.keys[t], sensor.touches[t].keys, (index + CONTROL_PERIOD) * step, ahead)
        moves = moves or ahead.position != now.position
        moves = moves or ahead.force != now.force
        moves = moves or ahead.clearance != now.clearance
        moves = moves or ahead.across != now.across
        if state.contact[t].time_off >= CONTACT_HOLD:
            continue
        if constants.linear_law == 1:
            tension += constants.tension_per_force * now.force
        elif now.force > 0.0:
            tension += geometric_rise(
                now.force, now.position, constants.length, constants.tension, constants.axial_stiffness
            )
        if plausible is not None:
            plausible.chain.pressed += plausible.chain.tension_per_force * now.force
    if plausible is not None:
        tension += plausible.chain.pressed
    return tension, moves, moved


@inlined
def _set_bristles(
    touch: TouchParameters,
    contact_state: ContactState,
    load: float,
    step: float,
    layer: LayerParameters | None,
) -> None:
    """Fill stiffness and damping of a touch's bristles under a press in N; a layer yields both ways."""
    k1, k2 = touch.k1, touch.k2
    normal = contact.stiffness(contact.static_root(load, k1, k2), k1, k2)
    if layer is not None:
        normal = 1.0 / (1.0 / normal + contact.layer_compliance(load, layer))
    contact_state.bristle_stiffness = 1.0 / (
        1.0 / (touch.tangential_ratio * normal) + contact_state.residual_compliance
    )
    contact_state.bristle_damping = touch.beta * load / step


@called
def _prepare_turning(sensor: Parameters, state: State, plausible: Plausible, size: int, t: int) -> None:
    """At a control update: the modes' slopes at a touch, and how it resists their turning, if it does."""
    constants: Constants = sensor.constants
    turning_state: TurningState = plausible.turnings[t]
    if turning_state.half + turning_state.arm == 0.0:
        return
    now: Motion = state.motion[t]
    ahead: Motion = state.ahead[t]
    slope, weights = plausible.slopes[t], plausible.slope_weights[t]
    half, length, tension = size // 2, constants.length, state.memory.tuned_tension
    turning.fill_slope(slope, 0, half, now.position / length, weights)
    if ahead.position != now.position:
        turning.fill_slope(slope, 1, half, ahead.position / length, weights)
        for i in range(half):
            slope[1, i] = (slope[1, i] - slope[0, i]) / CONTROL_PERIOD
    load = max(now.force, MIN_BRISTLE_FORCE)
    k1, k2 = sensor.touches[t].k1, sensor.touches[t].k2
    normal = contact.stiffness(contact.static_root(load, k1, k2), k1, k2)
    normal = 1.0 / (1.0 / normal + contact.layer_compliance(load, plausible.layers[t]))
    stiffness = turning_state.half * turning_state.half * normal + turning_state.arm * load
    # Bending smooths a slope over sqrt(E I / T), whose root of the tension the compliance follows.
    whole = interpolated(plausible.slope_compliance[t], now.position / length)
    whole *= np.sqrt(constants.tension / tension)
    rest = max(0.0, whole - turning.static_compliance(state.bank, size, slope, tension, constants.mass))
    turning_state.stiffness = stiffness / (1.0 + stiffness * rest)


@called
def _prepare_touch(sensor: Parameters, state: State, plausible: Plausible | None, size: int, t: int) -> None:
    """At a control update: a touch's depth, its modes' shapes, its residual compliance and its bristles."""
    constants: Constants = sensor.constants
    touch: TouchParameters = sensor.touches[t]
    now: Motion = state.motion[t]
    ahead: Motion = state.ahead[t]
    contact_state: ContactState = state.contact[t]
    bank = state.bank
    length, tension = constants.length, state.memory.tuned_tension
    k1, k2, row, ratio = touch.k1, touch.k2, string.row_of(t), constants.tension / tension
    others = 0.0
    for o in range(len(sensor.touches)):
        if o != t:
            others += state.ahead[o].force * cross_compliance(
                ahead.position, state.ahead[o].position, length, tension
            )
    static = interpolated(sensor.compliance[t], ahead.position / length) * ratio
    if plausible is not None:
        static += plausible.mounts[t].static
    layer = None if plausible is None else plausible.layers[t]
    ahead.depth = surface_depth(ahead.force, k1, k2, static, others, ahead.clearance, layer)
    string.fill_shape(bank, size, row, now.position / length, sensor.weights[t])
    if ahead.position != now.position:
        string.fill_shape(bank, size, row + 1, ahead.position / length, sensor.weights[t])
        for i in range(size // 2):
            bank[(row + 1) * size + i] = (bank[(row + 1) * size + i] - bank[row * size + i]) / CONTROL_PERIOD
    if len(sensor.touches) == 1:
        string.select_touch(bank, size, row)
    modal = string.static_compliance(bank, size, row, tension, constants.mass)
    here = interpolated(sensor.compliance[t], now.position / length) * ratio
    contact_state.residual_compliance = max(0.0, here - modal)
    if plausible is not None:
        contact_state.residual_compliance += plausible.mounts[t].spring
        _prepare_turning(sensor, state, plausible, size, t)
    if contact_state.s > 0.0:
        contact_state.eta = contact.approach(
            contact_state.s, k1, k2, contact_state.residual_compliance, layer
        )
    _set_bristles(touch, contact_state, max(now.force, MIN_BRISTLE_FORCE), constants.step, layer)
    if contact_state.time_off >= CONTACT_HOLD and touch.roughness > 0.0:
        scale = 1.0 / touch.roughness_length
        contact_state.height = touch.roughness * roughness.height(
            roughness.surface_seed(constants.seed, t),
            scale * contact_state.path_across,
            scale * (contact_state.path_along + contact_state.rolled),
        )


@called
def _update_controls(
    sensor: Parameters, state: State, plausible: Plausible | None, size: int, index: int
) -> None:
    """At a control update: read the touches' motion, tune the string, and move the drivers' switches."""
    constants: Constants = sensor.constants
    memory: SensorState = state.memory
    bank = state.bank
    tension, moves, moved = _update_motion(sensor, state, plausible, index)
    changed = moves or moved or memory.touches_changed > 0.0
    memory.touches_changed = 0.0
    if abs(tension - memory.tuned_tension) > RETUNING_THRESHOLD * constants.tension:
        memory.max_q_tension = string.tune(
            bank, size, tension, constants.mass, constants.tension_gain, constants.step
        )
        memory.tuned_tension = tension
        changed = True
    if changed:
        for t in range(len(sensor.touches)):
            _prepare_touch(sensor, state, plausible, size, t)
    largest = CONTROL_PERIOD * constants.step / SWITCHING_TIME
    for d in range(2):
        gate, wanted = state.drivers[d].gate, sensor.drivers[d].on
        if gate != wanted:
            moves = True
            state.drivers[d].gate = gate + min(largest, max(-largest, wanted - gate))
    if moves:
        memory.steady_time = 0.0
        memory.settled = 0.0


@inlined
def _rub(
    constants: Constants,
    touch: TouchParameters,
    contact_state: ContactState,
    motion: Motion,
    solution: ContactSolution,
    across: float,
    compliance: float,
) -> None:
    """Solve both bristles of a touch under its normal force.

    `across` is where the string would be across the press direction, in m, `compliance` its own there over a
    step.
    """
    load, step, length, axial = solution.force, constants.step, constants.length, constants.axial_stiffness
    soft = 0.0  # along the string it is the wire that stretches, on both sides of the touch
    if axial > 0.0:
        soft = motion.position * (length - motion.position) / (axial * length)
    moved = motion.across * step - (across - contact_state.string_across)
    moved_along = solution.speed_along * step + soft * contact_state.force_along
    solution.force_across, solution.force_along, solution.z, solution.z_along = 0.0, 0.0, 0.0, 0.0
    solution.slid_across, solution.slid_along, solution.friction = moved, moved_along, float(NONE)
    solution.string_across = across
    if load <= 0.0:
        return
    speed, stiffness, damping = (
        contact_state.sliding_speed,
        contact_state.bristle_stiffness,
        contact_state.bristle_damping,
    )
    z, z_along = contact_state.z, contact_state.z_along
    coefficient = friction.friction_coefficient(
        speed, touch.static_friction, touch.kinetic_friction, touch.stribeck_speed
    )
    limit = coefficient * load / stiffness
    share = friction.sliding_share(np.sqrt(z * z + z_along * z_along), limit)
    fade = share * speed * step / limit
    force, slid, z_new = friction.bristle(z, moved, compliance, stiffness, damping, fade)
    force_along, slid_along, z_new_along = friction.bristle(
        z_along, moved_along, soft, stiffness, damping, fade
    )
    kind = STICK if share == 0.0 else (CREEP if share < 1.0 else SLIDE)
    cap, whole = touch.static_friction * load, np.sqrt(force * force + force_along * force_along)
    if whole > cap:
        cut = cap / whole
        force, force_along, z_new, z_new_along = (
            cut * force,
            cut * force_along,
            cut * z_new,
            cut * z_new_along,
        )
        slid, slid_along = moved - compliance * force, moved_along - soft * force_along
        kind = SLIDE
    solution.force_across, solution.force_along = force, force_along
    solution.z, solution.z_along = z_new, z_new_along
    solution.slid_across, solution.slid_along, solution.friction = slid, slid_along, float(kind)
    solution.string_across = across + compliance * force


@inlined
def _predict(sensor: Parameters, state: State, plausible: Plausible | None, size: int, t: int) -> float:
    """Predict the selected touch's force in a step, and return what it adds to the stretch sum, in m^2."""
    touch: TouchParameters = sensor.touches[t]
    contact_state: ContactState = state.contact[t]
    solution: ContactSolution = state.solution[t]
    height, compliance, cross, square = string.predict(state.bank, size)
    layer = None if plausible is None else plausible.layers[t]
    if plausible is not None:
        compliance += plausible.mounts[t].modal
    gap = solution.surface - height
    k1, k2, residual = touch.k1, touch.k2, contact_state.residual_compliance
    beta = touch.beta / sensor.constants.step
    s = contact.initial_guess(gap, compliance, contact_state.s, contact_state.eta, k1, k2, residual, layer)
    solution.s, _, load = contact.solve(
        gap, compliance, s, contact_state.s, contact_state.eta, k1, k2, residual, beta, layer
    )
    solution.force = load
    return load * (2.0 * cross + load * square)


@inlined
def _move_touches(
    sensor: Parameters, state: State, plausible: Plausible | None, size: int, past: float
) -> float:
    """Move the touches to a share of the control period; return what they will add to the stretch sum."""
    bank, count, step = state.bank, len(sensor.touches), sensor.constants.step
    added = 0.0
    for t in range(count):
        now: Motion = state.motion[t]
        ahead: Motion = state.ahead[t]
        solution: ContactSolution = state.solution[t]
        contact_state: ContactState = state.contact[t]
        travel = ahead.position - now.position
        if travel != 0.0:
            string.move_shape(bank, size, string.row_of(t))
            if plausible is not None and plausible.turnings[t].stiffness > 0.0:
                turning.move_slope(plausible.slopes[t], size // 2)
        if travel != 0.0 or count > 1:
            string.select_touch(bank, size, string.row_of(t))
        rolls = sensor.touches[t].rolls
        solution.surface = now.depth + past * (ahead.depth - now.depth) + contact_state.height
        if plausible is not None:
            solution.surface -= mount.propagate(plausible.mount_modes[t])
        solution.speed_along = (1.0 - rolls) * travel / (CONTROL_PERIOD * step)
        solution.rolled = rolls * travel / CONTROL_PERIOD
        solution.force_across = 0.0
        added += _predict(sensor, state, plausible, size, t)
    return added


@inlined
def _find_compliances(sensor: Parameters, state: State, plausible: Plausible | None, size: int) -> None:
    """Fill where the string would be at every touch, and the compliance from each touch to each."""
    bank, mutual = state.bank, state.mutual
    count = len(sensor.touches)
    for t in range(count):
        row = string.row_of(t)
        solution: ContactSolution = state.solution[t]
        if count > 1:
            string.select_touch(bank, size, row)
        solution.free_height, solution.free_across, mutual[0, t, t], mutual[1, t, t] = string.free_response(
            bank, size
        )
        if plausible is not None:
            mutual[0, t, t] += plausible.mounts[t].modal
            _find_turning(state, plausible, size, t)
        for o in range(t):
            normal, tangential = string.mutual_compliance(bank, size, row, string.row_of(o))
            mutual[0, t, o], mutual[0, o, t] = normal, normal
            mutual[1, t, o], mutual[1, o, t] = tangential, tangential


@inlined
def _turns(state: State, plausible: Plausible, t: int) -> bool:
    """Return whether a touch that presses resists turning."""
    return plausible.turnings[t].stiffness > 0.0 and state.contact[t].s > 0.0


@inlined
def _find_turning(state: State, plausible: Plausible, size: int, t: int) -> None:
    """Fill what the selected touch's moment would be, and by it where the string would be and how it yields.

    What moments of other touches do is left to the sweeps over them.
    """
    turning_state: TurningState = plausible.turnings[t]
    turning_state.unloaded, turning_state.gain, turning_state.cross, turning_state.compliance = (
        0.0,
        0.0,
        0.0,
        0.0,
    )
    if _turns(state, plausible, t):
        turning_state.turned, turning_state.compliance, turning_state.cross = turning.free_response(
            state.bank, size, plausible.slopes[t]
        )
        turning.prepare(turning_state, turning_state.turned)
        state.mutual[0, t, t] += turning_state.cross * turning_state.gain
    for o in range(len(state.contact)):
        if o != t:
            plausible.turned[0, t, o], plausible.turned[1, t, o] = turning.mutual_compliance(
                state.bank, size, string.row_of(t), plausible.slopes[t], plausible.slopes[o]
            )


@inlined
def _solve_turning(state: State, plausible: Plausible, t: int) -> float:
    """Take other touches into one's moment without a force; return by how much moments lift the string."""
    turning_state: TurningState = plausible.turnings[t]
    lifted, turned = 0.0, turning_state.turned
    for o in range(len(state.contact)):
        if o != t:
            lifted += plausible.turned[0, t, o] * plausible.turnings[o].moment
            turned += plausible.turned[1, t, o] * plausible.turnings[o].moment
            turned += plausible.turned[0, o, t] * state.solution[o].force
    if _turns(state, plausible, t):
        turning.prepare(turning_state, turned)
        lifted += turning_state.cross * turning_state.unloaded
    return lifted


@inlined
def _solve_touch(sensor: Parameters, state: State, plausible: Plausible | None, t: int, turn: int) -> float:
    """Solve one touch under the others' forces; return by how much its own changed, in N."""
    mutual = state.mutual
    contact_state: ContactState = state.contact[t]
    touch: TouchParameters = sensor.touches[t]
    solution: ContactSolution = state.solution[t]
    layer = None if plausible is None else plausible.layers[t]
    height, across = solution.free_height, solution.free_across
    for o in range(len(sensor.touches)):
        if o != t:
            height += mutual[0, t, o] * state.solution[o].force
            across += mutual[1, t, o] * state.solution[o].force_across
    if plausible is not None:
        height += _solve_turning(state, plausible, t)
    before, before_across = solution.force, solution.force_across
    solution.s, solution.eta, solution.force = contact.solve(
        solution.surface - height,
        mutual[0, t, t],
        solution.s,
        contact_state.s,
        contact_state.eta,
        touch.k1,
        touch.k2,
        contact_state.residual_compliance,
        touch.beta / sensor.constants.step,
        layer,
    )
    if plausible is not None:
        plausible.turnings[t].moment = (
            plausible.turnings[t].unloaded + plausible.turnings[t].gain * solution.force
        )
    if turn == 0:
        _rub(sensor.constants, touch, contact_state, state.motion[t], solution, across, mutual[1, t, t])
    return abs(solution.force - before) + abs(solution.force_across - before_across)


@inlined
def _apply_moments(plausible: Plausible, bank: Floats, size: int) -> None:
    """Apply what touches that resist turning do to the string."""
    for t in range(len(plausible.turnings)):
        if plausible.turnings[t].moment != 0.0:
            turning.apply_moment(bank, size, plausible.slopes[t], plausible.turnings[t].moment)


@inlined
def _add_moments(plausible: Plausible, bank: Floats, size: int) -> None:
    """Add the moments of all touches to their modal force."""
    for t in range(len(plausible.turnings)):
        if plausible.turnings[t].moment != 0.0:
            turning.add_force(bank, size, plausible.slopes[t], plausible.turnings[t].moment)


@inlined
def _solve_touches(
    sensor: Parameters, state: State, plausible: Plausible | None, size: int, turn: int
) -> float:
    """Solve all touches together and apply their forces; return the stretch sum in m^2.

    Friction is solved in the first turn of the iteration for the tension, and held in those that follow.
    """
    bank, count = state.bank, len(sensor.touches)
    _find_compliances(sensor, state, plausible, size)
    for _ in range(MAX_CONTACT_SWEEPS):
        change, largest = 0.0, 0.0
        for t in range(count):
            change = max(change, _solve_touch(sensor, state, plausible, t, turn))
            largest = max(largest, state.solution[t].force)
        if count == 1 or change <= FORCE_TOLERANCE * largest:
            break
    if plausible is not None:
        _apply_moments(plausible, bank, size)
    stretch = 0.0
    for t in range(count):
        if count > 1:
            string.select_touch(bank, size, string.row_of(t))
        kept = 0.0 if t == 0 else 1.0
        stretch = string.apply_force(
            bank, size, state.solution[t].force, state.solution[t].force_across, kept
        )
    if plausible is not None:
        _add_moments(plausible, bank, size)
    return stretch


@inlined
def _keep_contact(
    touch: TouchParameters,
    contact_state: ContactState,
    solution: ContactSolution,
    step: float,
    seed: int,
    t: int,
) -> None:
    """Take over a touch's solution, and update its path over the object, its height and its labels."""
    load = solution.force
    lost = solution.slid_across - (solution.z - contact_state.z)
    lost_along = solution.slid_along - (solution.z_along - contact_state.z_along)
    contact_state.s, contact_state.eta, contact_state.force = solution.s, solution.eta, load
    contact_state.z, contact_state.z_along, contact_state.force_along = (
        solution.z,
        solution.z_along,
        solution.force_along,
    )
    contact_state.string_across, contact_state.friction = solution.string_across, solution.friction
    contact_state.sliding_speed = np.sqrt(solution.slid_across**2 + solution.slid_along**2) / step
    began = load > 0.0 and contact_state.time_off >= CONTACT_HOLD
    contact_state.time_off = 0.0 if load > 0.0 else contact_state.time_off + step
    gone, gone_along = 0.0, 0.0
    if contact_state.time_off < CONTACT_HOLD:
        contact_state.path_across += lost
        contact_state.path_along += lost_along
        contact_state.rolled += solution.rolled
        if began:
            contact_state.lag_across, contact_state.smooth_across, contact_state.mark_across = (
                contact_state.path_across,
                contact_state.path_across,
                contact_state.path_across,
            )
            contact_state.lag_along, contact_state.smooth_along, contact_state.mark_along = (
                contact_state.path_along,
                contact_state.path_along,
                contact_state.path_along,
            )
        along = contact_state.path_along + contact_state.rolled
        if (
            abs(contact_state.path_across - contact_state.read_across) + abs(along - contact_state.read_along)
            > MIN_SURFACE_MOTION
        ):
            scale = 1.0 / touch.roughness_length
            contact_state.height = touch.roughness * roughness.height(
                roughness.surface_seed(seed, t), scale * contact_state.path_across, scale * along
            )
            contact_state.read_across, contact_state.read_along = contact_state.path_across, along
        keep = step / PATH_TIME
        contact_state.lag_across += keep * (contact_state.path_across - contact_state.lag_across)
        contact_state.smooth_across += keep * (contact_state.lag_across - contact_state.smooth_across)
        contact_state.lag_along += keep * (contact_state.path_along - contact_state.lag_along)
        contact_state.smooth_along += keep * (contact_state.lag_along - contact_state.smooth_along)
        gone, gone_along = friction.play(
            SLIP_PLAY,
            contact_state.smooth_across,
            contact_state.smooth_along,
            contact_state.mark_across,
            contact_state.mark_along,
        )
        contact_state.mark_across += gone
        contact_state.mark_along += gone_along
    keep = step / SLIP_SPEED_TIME
    contact_state.speed_across += keep * (gone / step - contact_state.speed_across)
    contact_state.speed_along += keep * (gone_along / step - contact_state.speed_along)
    contact_state.mean_force += step / CONTACT_HOLD * (load - contact_state.mean_force)


@inlined
def _solve_tension(
    sensor: Parameters, state: State, plausible: Plausible | None, size: int, guess: float, included: float
) -> float:
    """Find tension and touches that agree, from a guess of the stretch sum; return the extra tension in N.

    The residual of a guess changes from step to step by nearly the same slope, from which the next guess
    follows; should that diverge, a bracket is halved. `included` is the tension in N that the propagators
    already hold.
    """
    constants: Constants = sensor.constants
    memory: SensorState = state.memory
    bank = state.bank
    tension, slope, stretch = 0.0, memory.residual_slope, 0.0
    last_guess, last_stretch, low, high = 0.0, 0.0, 0.0, np.inf
    for turn in range(MAX_STRETCH_ITERATIONS):
        if constants.linear_law == 0:
            tension = max(
                0.5 * constants.tension_per_stretch * (memory.stretch + guess) - included,
                -MAX_SLACK / memory.max_q_tension,
            )
        stretch = string.apply_tension(bank, size, tension, memory.max_q_tension)
        memory.iterations += 1.0
        if len(sensor.touches) > 0:
            stretch = _solve_touches(sensor, state, plausible, size, turn)
        if turn == 1 and abs(guess - last_guess) > MIN_GUESS_CHANGE * stretch:
            slope = (stretch - last_stretch) / (guess - last_guess)
        if constants.linear_law == 1 or abs(stretch - guess) <= constants.stretch_tolerance * stretch:
            break
        last_guess, last_stretch = guess, stretch
        if stretch > guess:
            low = guess
        else:
            high = guess
        guess = (stretch - slope * guess) / (1.0 - slope)
        if not low < guess < high:
            guess = 0.5 * (low + high) if high < np.inf else 2.0 * stretch
    memory.residual_slope = min(0.5, max(-0.5, slope))
    memory.stretch = stretch
    return tension


@inlined
def _keep_place(coil: CoilEffects, place: float) -> None:
    """Note where the string is over a coil."""
    coil.place_before = coil.place
    coil.place = place


@inlined
def _step(sensor: Parameters, state: State, plausible: Plausible | None, size: int, index: int) -> None:
    """Take one step of the whole sensor."""
    constants: Constants = sensor.constants
    memory: SensorState = state.memory
    bank = state.bank
    near = None if plausible is None else plausible.coils[0]
    far = None if plausible is None else plausible.coils[1]
    first = electronics.drive(sensor.drivers[0], state.drivers[0], memory.coil_speed_1, near)
    second = electronics.drive(sensor.drivers[1], state.drivers[1], memory.coil_speed_2, far)
    if plausible is not None:
        plausible.coils[0].drive, plausible.coils[1].drive = first, second
        first += electronics.magnet(plausible.coils[0])
        second += electronics.magnet(plausible.coils[1])
    shake = 0.0
    if sensor.sound.size > 0:
        shake = (
            constants.frame_acceleration * sensor.sound[(index // constants.oversampling) % sensor.sound.size]
        )
    guess, yields = string.propagate(bank, size, first, second, shake)
    time = (index // CONTROL_PERIOD) * CONTROL_PERIOD * constants.step
    drift = drifted(constants.drift, constants.drift_rate, time, constants.tension)
    included = memory.tuned_tension - constants.tension - drift
    if plausible is not None:
        included -= plausible.chain.pressed
    if constants.linear_law == 0:
        guess -= yields * (constants.tension_per_stretch * (memory.stretch + guess) - 2.0 * included)
    guess += _move_touches(sensor, state, plausible, size, (index % CONTROL_PERIOD + 1.0) / CONTROL_PERIOD)
    tension = _solve_tension(sensor, state, plausible, size, max(0.0, guess), included)
    memory.coil_speed_1, memory.coil_speed_2, memory.end_force_1, memory.end_force_2 = string.finish_step(
        bank, size, tension
    )
    for t in range(len(sensor.touches)):
        if plausible is not None and plausible.turnings[t].stiffness > 0.0:
            turning.keep(
                bank,
                size,
                plausible.slopes[t],
                plausible.turnings[t],
                state.contact[t].s > 0.0 and state.solution[t].s > 0.0,
            )
        _keep_contact(
            sensor.touches[t], state.contact[t], state.solution[t], constants.step, constants.seed, t
        )
        if plausible is not None:
            mount.push(plausible.mount_modes[t], state.solution[t].force)
    if plausible is not None:
        first, second = string.places_over_coils(bank, size)
        _keep_place(plausible.coils[0], first)
        _keep_place(plausible.coils[1], second)


@inlined
def _judge_settled(memory: SensorState, first: float, second: float, period: float) -> None:
    """Call the sound settled once short and long levels of both channels have agreed for a while."""
    memory.short_level_1 += period / SHORT_LEVEL_TIME * (first * first - memory.short_level_1)
    memory.short_level_2 += period / SHORT_LEVEL_TIME * (second * second - memory.short_level_2)
    memory.long_level_1 += period / LONG_LEVEL_TIME * (first * first - memory.long_level_1)
    memory.long_level_2 += period / LONG_LEVEL_TIME * (second * second - memory.long_level_2)
    apart_1 = abs(memory.short_level_1 - memory.long_level_1) > LEVEL_TOLERANCE * (
        memory.long_level_1 + SILENT_POWER
    )
    apart_2 = abs(memory.short_level_2 - memory.long_level_2) > LEVEL_TOLERANCE * (
        memory.long_level_2 + SILENT_POWER
    )
    memory.steady_time = 0.0 if apart_1 or apart_2 else memory.steady_time + period
    if memory.steady_time >= SETTLING_TIME:
        memory.settled = 1.0


@inlined
def _residual_ends(
    sensor: Parameters, state: State, plausible: Plausible, past: float
) -> tuple[float, float]:
    """Return what the modes beyond the bank bring to both ends, in N in the pickups' direction."""
    near, far = 0.0, 0.0
    for t in range(len(sensor.touches)):
        solution: ContactSolution = state.solution[t]
        force = plausible.chain.normal * solution.force + plausible.chain.across * solution.force_across
        here, then = state.motion[t].position, state.ahead[t].position
        place = (here + past * (then - here)) / sensor.constants.length
        near += interpolated(plausible.end_shares[t, 0], place) * force
        far += interpolated(plausible.end_shares[t, 1], place) * force
    return near, far


@inlined
def _picked_up(plausible: Plausible, index: int) -> tuple[float, float]:
    """Return what the drivers' coils and the mains induce in both microphones, in full scale."""
    chain: ChainParameters = plausible.chain
    first, second = plausible.coils[0].drive, plausible.coils[1].drive
    turns = chain.hum_step * index
    hum = interpolated(plausible.hum, turns - np.floor(turns))
    return (
        chain.feed_own * first + chain.feed_other * second + chain.hum_1 * hum,
        chain.feed_other * first + chain.feed_own * second + chain.hum_2 * hum,
    )


@inlined
def _write_frame(
    sensor: Parameters, state: State, plausible: Plausible | None, out: Out, frame: int, index: int
) -> None:
    """Write one frame: microphones and labels."""
    constants: Constants = sensor.constants
    memory: SensorState = state.memory
    taut = memory.tuned_tension / constants.tension
    air = 0.0
    if sensor.sound.size > 0:
        air = float(sensor.sound[index % sensor.sound.size])
    past = ((index * constants.oversampling) % CONTROL_PERIOD) / CONTROL_PERIOD
    near, far = taut * memory.end_force_1, taut * memory.end_force_2
    if plausible is not None:
        more_near, more_far = _residual_ends(sensor, state, plausible, past)
        near, far = near + more_near, far + more_far
    first, second = electronics.mixed(sensor.pickup, near, far, air)
    if plausible is not None:
        more_first, more_second = _picked_up(plausible, index)
        first, second = first + more_first, second + more_second
    first = electronics.amplified(sensor.pickup, state.preamps[0], first)
    second = electronics.amplified(sensor.pickup, state.preamps[1], second)
    if plausible is not None:
        first = electronics.distorted(plausible.chain, first)
        second = electronics.distorted(plausible.chain, second)
    noise = sensor.pickup.noise
    out.microphones[0, frame] = electronics.converted(
        first + noise * electronics.normal_noise(constants.seed, 4 * index)
    )
    out.microphones[1, frame] = electronics.converted(
        second + noise * electronics.normal_noise(constants.seed, 4 * index + 2)
    )
    for t in range(len(sensor.touches)):
        contact_state: ContactState = state.contact[t]
        now: Motion = state.motion[t]
        ahead: Motion = state.ahead[t]
        touching = 1 if contact_state.time_off < CONTACT_HOLD else 0
        if contact_state.touching != touching:
            contact_state.touching = float(touching)
            memory.steady_time = 0.0
            memory.settled = 0.0
        speed = np.sqrt(contact_state.speed_across**2 + contact_state.speed_along**2)
        out.contact[t, frame] = touching
        out.position[t, frame] = now.position + past * (ahead.position - now.position)
        if plausible is not None:
            out.position[t, frame] -= plausible.chain.offset
        out.force[t, frame] = contact_state.mean_force * touching
        out.reaction[t, frame] = contact_state.force
        out.slip[t, frame] = 1 if touching == 1 and speed > SLIP_SPEED else 0
        out.across[t, frame] = contact_state.speed_across
        out.along[t, frame] = contact_state.speed_along
        out.friction[t, frame] = int(contact_state.friction)
    _judge_settled(memory, first, second, constants.step * constants.oversampling)
    out.settled[frame] = int(memory.settled)


FILES = (
    sys.modules[__name__],
    contact,
    electronics,
    friction,
    jit,
    mount,
    records,
    roughness,
    string,
    turning,
)
FINGERPRINT = jit.fingerprint(FILES)


@cache
def kernel(
    size: int, fingerprint: int = FINGERPRINT
) -> Callable[[Parameters, State, Plausible | None, Out, Integers, int, int], int]:
    """Return the kernel for banks of `size` modes a row, compiled on its first call for that size and world.

    It runs sensors `first` to `stop` of a batch for as many frames as the output has room for, each from its
    own frame of `starts` on. `fingerprint` puts the text of all files into the cache's key.
    """

    @jit.CACHED(fastmath=jit.FAST, nogil=True, _nrt=False)
    def run(many: Any, states: Any, more: Any, outs: Any, starts: Integers, first: int, stop: int) -> int:
        for i in range(first, stop):
            sensor = Parameters(
                many.constants[i], many.drivers[i], many.pickup[i], many.sound[i], many.touches[i],
                many.keys[i], many.weights[i], many.compliance[i],
            )  # fmt: skip
            state = State(
                states.bank[i], states.contact[i], states.motion[i], states.ahead[i], states.drivers[i],
                states.preamps[i], states.memory[i], states.solution[i], states.mutual[i],
            )  # fmt: skip
            plausible = None
            if more is not None:
                plausible = Plausible(
                    more.layers[i], more.mounts[i], more.mount_modes[i], more.coils[i], more.chain[i],
                    more.hum[i], more.end_shares[i], more.turnings[i], more.slopes[i],
                    more.slope_weights[i], more.slope_compliance[i], more.turned[i],
                )  # fmt: skip
            out = Out(
                outs.microphones[i], outs.contact[i], outs.position[i], outs.force[i], outs.reaction[i],
                outs.slip[i], outs.across[i], outs.along[i], outs.friction[i], outs.settled[i],
            )  # fmt: skip
            oversampling = sensor.constants.oversampling
            for frame in range(out.settled.size):
                for sub in range(oversampling):
                    index = (starts[i] + frame) * oversampling + sub
                    if index % CONTROL_PERIOD == 0:
                        _update_controls(sensor, state, plausible, size, index)
                    _step(sensor, state, plausible, size, index)
                _write_frame(sensor, state, plausible, out, frame, starts[i] + frame)
        return fingerprint

    return run
