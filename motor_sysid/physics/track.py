"""Where the shaft is between the samples of a measured position, and which rows a lane sees."""

from motor_sysid.physics.native import inlined
from motor_sysid.physics.vector import spread, WIDTH, with_element


@inlined
def row_in(places, lane, sample):  # type: ignore[no-untyped-def]
    """Return the row of a sample of a lane that has rows of its own, of those that it may see."""
    return min(max(places[0, lane] + sample, places[1, lane]), places[2, lane] - 1)


@inlined
def curve(position, places, first, sample):  # type: ignore[no-untyped-def]
    """Return the cubic from a sample to the next one, in lane `first` and those behind."""
    if places.shape[1] == 0:
        one = cubic(position, sample, 0, position.shape[0])
        return spread(one[0]), spread(one[1]), spread(one[2]), spread(one[3])
    here, way, begins, ends = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
    for k in range(WIDTH):
        lane = first + k
        at = row_in(places, lane, sample)
        one = cubic(position, at, places[1, lane], places[2, lane])
        here, way = with_element(here, k, one[0]), with_element(way, k, one[1])
        begins, ends = with_element(begins, k, one[2]), with_element(ends, k, one[3])
    return here, way, begins, ends


@inlined
def cubic(position, row, lowest, end):  # type: ignore[no-untyped-def]
    """Return position, change, and how far both slopes are from it, from a row to the next one.

    A cubic joins two samples with the slopes that their neighbours tell (Catmull and Rom 1974): a
    straight line is off by an eighth of what the speed changes in a sample, which is much of a
    short wave.
    """
    last = end - 1
    here, ahead = position[row], position[min(row + 1, last)]
    way = ahead - here
    begins = way - (here - position[row - 1]) if lowest < row < last else 0.0
    ends = position[row + 2] - ahead - way if row + 2 <= last else 0.0
    return here, way, begins, ends


@inlined
def at_share(s, cubic):  # type: ignore[no-untyped-def]
    """Return the value of a cubic at the share `s` of its way."""
    here, way, begins, ends = cubic
    bend = 0.5 * s * (1.0 - s) * ((1.0 - s) * begins + s * ends)
    return here + s * way - bend
