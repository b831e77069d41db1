"""Where the shaft is between the samples of a measured position, and which rows a lane sees."""

from numba import njit


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def row_in(places, lane, sample):  # type: ignore[no-untyped-def]
    """Return the row of a sample of a lane that has rows of its own, of those that it may see."""
    return min(max(places[0, lane] + sample, places[1, lane]), places[2, lane] - 1)


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def meet(wide, position, places, sample, angle):  # type: ignore[no-untyped-def]
    """Set `angle` (W,) to the position at a sample."""
    if places.shape[1] == 0:
        for k in range(wide):
            angle[k] = position[sample]
    else:
        for k in range(wide):
            angle[k] = position[row_in(places, k, sample)]


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def follow(wide, position, places, sample, share, angle):  # type: ignore[no-untyped-def]
    """Set `angle` (W,) to the position at the `share` (W,) of the time to the next sample."""
    if places.shape[1] == 0:
        here, way, begins, ends = cubic(position, sample, 0, position.shape[0])
        for k in range(wide):
            angle[k] = at_share(share[k], here, way, begins, ends)
    else:
        for k in range(wide):
            at = row_in(places, k, sample)
            here, way, begins, ends = cubic(position, at, places[1, k], places[2, k])
            angle[k] = at_share(share[k], here, way, begins, ends)


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
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


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def at_share(s, here, way, begins, ends):  # type: ignore[no-untyped-def]
    """Return the value of a cubic at the share `s` of its way."""
    bend = 0.5 * s * (1.0 - s) * ((1.0 - s) * begins + s * ends)
    return here + s * way - bend
