"""Hold an object of unknown weight between two strings: grip harder while they hear it slip.

Run it: python examples/grasp_by_sound.py (with the extra sim)
"""

from monochord.sim.grasp import GraspScene, slip_reflex

SEED = 4


def main() -> None:
    """Print each change of the grip, and how far the object has sunk in the end. All of it is simulated."""
    scene, reflex = GraspScene(), slip_reflex()
    state = scene.reset(SEED, "tube")
    while not state.ended:
        grip = reflex(state)
        if grip != state.grip and state.time > 1.0:
            slip = ", ".join(str(update.slip) for update in state.updates)
            print(f"{state.time:4.2f} s  grip {grip:.2f} N  (slip {slip}; sunk by {1e3 * state.drop:.1f} mm)")
        state = scene.step(grip)
    print(f"the {scene.object} sank by {1e3 * state.drop:.1f} mm")
    print(f"{state.grip:.2f} N hold it, {state.needed:.2f} N would")


if __name__ == "__main__":
    main()
