"""What holds a touching object: a few modes of object, gripper and frame, and a spring in series.

A held object gives way to the string. Where it touches, it moves by the sum of its modes,

    m (u'' + omega / Q u' + omega^2 u) = f,

f being the force of the contact, and by what all higher modes and the gripper's pads give without delay. Each
mode is propagated exactly under a force held over a step, as those of the string are. Its free motion then
shifts the object's surface, what the held force moves it adds to the string's compliance over the step, and
the spring adds to the residual compliance of the contact: a step remains one scalar equation, and the work of
the contact's force is the rise of the modes' energy, exactly.
"""

from monochord.physics.twin.jit import inlined
from monochord.physics.twin.records import Records


@inlined
def propagate(modes: Records) -> float:
    """Propagate a mount's modes over a step without a force; return how far the object has then given way."""
    moved = 0.0
    for i in range(len(modes)):
        mode = modes[i]
        q = mode.q_q * mode.q + mode.q_v * mode.v
        mode.v_free = mode.v_q * mode.q + mode.v_v * mode.v
        mode.q = q
        moved += q
    return moved


@inlined
def push(modes: Records, force: float) -> None:
    """Add to modes that have been propagated what a force in N held over the step does to them."""
    for i in range(len(modes)):
        mode = modes[i]
        mode.q += mode.q_force * force
        mode.v = mode.v_free + mode.v_force * force
