"""Press a virtual sensor, slide along it and release it, while a model estimates the touch; print both.

Run it: python examples/press_and_follow.py
"""

import monochord as mc

PRESS, SLIDE, RELEASE, END = 0.6, 1.2, 1.8, 2.4  # s
PLACE, FORCE, SPEED = 0.09, 1.0, 0.05  # m, N, m/s


def main() -> None:
    """Print events, and every tenth of a second estimate and truth. All of it is simulated."""
    twin = mc.VirtualSensor("prototype", seed=1)
    for number, update in enumerate(mc.listen(twin, model="demo", seconds=END)):
        if update.time == PRESS:
            twin.press(PLACE, FORCE, material="wood")
        if update.time == SLIDE:
            twin.slide(0.4, along=SPEED)
        if update.time == RELEASE:
            twin.release()
        for event in update.events:
            print(f"{event.time:4.2f} s  {event.name} {'begins' if event.on else 'ends'}")
        if number % 10 == 0:
            truth = f"{1e3 * update.truth['position']:.1f} mm" if "position" in update.truth else "untouched"
            print(f"{update.time:4.2f} s  {update.position}, {update.force}  (truth {truth})")


if __name__ == "__main__":
    main()
