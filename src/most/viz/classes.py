"""How classes are called and drawn."""

from dataclasses import dataclass

from most.viz.palette import RGB, bright, muted

MARKERS = "o^sDvPX*"  # of the thing classes, in turn: colour is not the only sign of a class


@dataclass
class ClassStyle:
    """Names, colours and marks by training id."""

    names: list[str]
    colours: list[list[int]]  # RGB, 0 to 255
    things: list[int]

    def marker(self, thing: int) -> str:
        """Return matplotlib's name of a thing's mark."""
        return MARKERS[self.things.index(thing) % len(MARKERS)]

    def colour(self, class_id: int) -> RGB:
        """Return the colour of a thing's marks or of stuff's points."""
        if class_id in self.things:
            return bright(self.colours[class_id])
        red, green, blue = muted(self.colours)[class_id]
        return float(red), float(green), float(blue)
