"""Press, slide and lift an object on the virtual sensor; print its sound level and the true contact.

Run it: python examples/touch_the_twin.py
"""

import numpy as np

import monochord as mc

STEP = 0.1  # s


def main() -> None:
    """Print levels and labels every tenth of a second. All of it is simulated."""
    twin = mc.VirtualSensor("prototype", seed=1)
    print("          mic 1     mic 2   contact   slip    force   speed   settled   (simulated)")
    for step in range(13):
        if step == 2:
            twin.press(0.09, 1.0, material="wood")
        if step == 6:
            twin.slide(0.3, across=0.02)  # across the string at 20 mm/s
        if step == 10:
            twin.release()
        sound, labels = twin.advance(STEP)
        levels = 20.0 * np.log10(sound.std(axis=1) + 1e-9)
        contact, slip, force, speed = (
            np.nan_to_num(labels[name]).mean() for name in ("contact", "slip", "force", "slip_velocity")
        )
        print(
            f"{twin.time:4.1f} s {levels[0]:6.1f} dB {levels[1]:6.1f} dB   {contact:5.0%}   {slip:5.0%}"
            f"  {force:5.2f} N  {1e3 * speed:4.1f} mm/s   {labels['settled'].mean():5.0%}"
        )


if __name__ == "__main__":
    main()
