"""``python -m hardware.wiring``: draw both schematics beside this file."""

from pathlib import Path

from hardware.wiring.symbols import Drawing

HERE = Path(__file__).parent


def piezo_buffer() -> Drawing:
    """Draw the buffer of one contact microphone."""
    sheet = Drawing("Piezo buffer: one for each microphone, in a screened box at the block", 950, 370)
    rail, base = 70.0, 300.0
    sheet.line((60, rail), (520, rail))
    sheet.resistor(520, rail, "R6 100")
    sheet.line((580, rail), (680, rail))
    sheet.text((686, rail + 5), "+9 V")
    sheet.capacitor(520, rail, "C3 100 µF", down=True)
    sheet.line((520, 130), (520, 145))
    sheet.ground(520, 145)
    sheet.dot(520, rail)
    # the disc
    sheet.box(44, 170, 32, 10)
    sheet.line((60, 150), (60, 166), (48, 166), (72, 166))
    sheet.line((48, 184), (72, 184), (60, 184), (60, base))
    sheet.text((10, 215), "X1 disc")
    sheet.line((60, 150), (90, 150))
    sheet.resistor(90, 150, "R1 1 k")
    sheet.line((150, 150), (300, 150))
    # clamps
    for low, wire in ((rail + 20, rail), (190.0, 150.0)):
        sheet.line((190, wire), (190, low))
        sheet.diode_up(190, low)
    sheet.line((190, rail + 60), (190, 150))
    sheet.line((190, 230), (190, base))
    sheet.text((100, 250), "D1 BAV199")
    for at in ((190, 150), (190, rail), (245, 150), (330, rail)):
        sheet.dot(*at)
    # bias
    sheet.line((245, 150), (245, 165))
    sheet.resistor(245, 165, "R2 10 M", down=True)
    sheet.line((245, 225), (245, 240), (282, 240))
    sheet.text((286, 244), "3 V")
    # follower
    sheet.jfet(300, 150)
    sheet.text((338, 143), "Q1 J113")
    sheet.line((330, 120), (330, rail))
    sheet.line((330, 180), (330, 225))
    sheet.resistor(330, 225, "R5 4.7 k", down=True)
    sheet.line((330, 285), (330, base))
    sheet.dot(330, 190)
    sheet.line((330, 190), (420, 190))
    sheet.capacitor(420, 190, "C2 10 µF")
    sheet.dot(490, 190)
    sheet.line((480, 190), (500, 190))
    sheet.resistor(490, 210, "R8 100 k", down=True)
    sheet.line((490, 190), (490, 210))
    sheet.line((490, 270), (490, base))
    sheet.resistor(500, 190, "R7 100")
    sheet.line((560, 190), (600, 190))
    sheet.text((606, 195), "to the input")
    sheet.line((60, base), (520, base))
    sheet.ground(130, base)
    sheet.text((146, base + 18), "screen, brass side of the disc, bar", note=True)
    _bias(sheet)
    return sheet


def _bias(sheet: Drawing) -> None:
    """Draw the divider that makes the gate's 3 V."""
    sheet.text((742, 112), "+9 V")
    sheet.resistor(760, 120, "R3 200 k", down=True)
    sheet.line((760, 180), (760, 210))
    sheet.resistor(760, 210, "R4 100 k", down=True)
    sheet.line((720, 190), (860, 190), (860, 210))
    sheet.capacitor(860, 210, "C1 10 µF", down=True)
    sheet.text((690, 194), "3 V")
    sheet.dot(760, 190)
    sheet.ground(760, 270)
    sheet.ground(860, 270)


def coil_driver() -> Drawing:
    """Draw the driver of both coils: line outputs, class-D board, coils."""
    sheet = Drawing("Coil driver: one board drives the drive coils of both ends", 760, 330)
    sheet.box(330, 70, 130, 190)
    sheet.text((352, 170), "PAM8403")
    sheet.text((345, 188), "5 V, gain 24 dB", note=True)
    for channel, y in ((1, 100.0), (2, 205.0)):
        sheet.text((14, y + 5), f"line out {channel}")
        sheet.line((80, y), (110, y))
        sheet.resistor(110, y, f"R{channel}1 10 k")
        sheet.line((170, y), (220, y))
        sheet.dot(200, y)
        sheet.resistor(200, y, f"R{channel}2 1 k", down=True)
        sheet.ground(200, y + 60)
        sheet.capacitor(220, y, f"C{channel}1 0.47 µF")
        sheet.line((280, y), (330, y))
        sheet.text((336, y + 5), "IN")
        sheet.text((424, y + 5), "OUT+")
        sheet.text((424, y + 45), "OUT-")
        sheet.line((460, y), (490, y))
        sheet.resistor(490, y, f"R{channel}3 8.2, 1 W")
        sheet.line((550, y), (620, y))
        sheet.coil(620, y, f"L{channel} 8 ohm")
        sheet.line((620, y + 60), (590, y + 60), (590, y + 40), (460, y + 40))
    sheet.text((482, 292), "twisted pair, no side of the coil to ground", note=True)
    sheet.line((395, 70), (395, 50), (440, 50))
    sheet.text((446, 54), "+5 V, 470 µF and 1 µF to ground at the board")
    sheet.line((395, 260), (395, 275))
    sheet.ground(395, 275)
    return sheet


def main() -> None:
    """Write both drawings."""
    piezo_buffer().write(HERE / "piezo_buffer.svg")
    coil_driver().write(HERE / "coil_driver.svg")


if __name__ == "__main__":
    main()
