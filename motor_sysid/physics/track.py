"""Where the shaft is between the samples of a measured position."""

from numba import njit


@njit(cache=True, nogil=True, error_model='numpy', forceinline=True)
def follow(wide, position, sample, share, angle):  # type: ignore[no-untyped-def]
    """Set `angle` (W,) to the position at the `share` (W,) of the time to the next sample.

    A cubic joins two samples with the slopes that their neighbours tell (Catmull and Rom 1974): a
    straight line is off by an eighth of what the speed changes in a sample, which is much of a
    short wave.
    """
    last = position.shape[0] - 1
    here, ahead = position[sample], position[min(sample + 1, last)]
    way = ahead - here
    begins = way - (here - position[sample - 1]) if 0 < sample < last else 0.0
    ends = position[sample + 2] - ahead - way if sample + 2 <= last else 0.0
    for k in range(wide):
        s = share[k]
        bend = 0.5 * s * (1.0 - s) * ((1.0 - s) * begins + s * ends)
        angle[k] = here + s * way - bend
