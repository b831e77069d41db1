"""What the paper prints in its Tables 4, 5 and 6 (Wee and Ahmad 2025)."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Printed:
    """One column of Table 4: ITAE over ten runs, iterations and seconds of a run."""

    mean: float
    least: float
    most: float
    deviation: float
    seconds: float


OPEN: Mapping[str, Printed] = {
    'PSO': Printed(0.116400, 0.041662, 0.240532, 0.092653, 1729.741),
    'GWO': Printed(0.108766, 0.047495, 0.226417, 0.081053, 1239.095),
    'BA': Printed(0.429319, 0.102241, 0.761809, 0.218425, 1794.492),
    'GA': Printed(0.292678, 0.067564, 0.587750, 0.200852, 1836.451),
    'LS': Printed(0.229115, float('nan'), 0.597561, 0.207816, 1219.264),
    'NN': Printed(0.221304, 0.091546, 0.989074, 0.194561, 2036.262),
}
"""Open loop.  One cell of the row of minima is empty in print; GA and LS may be exchanged."""

CLOSED: Mapping[str, Printed] = {
    'PSO': Printed(0.003729, 0.003471, 0.004483, 0.000406, 1698.117),
    'GWO': Printed(0.003880, 0.003653, 0.004176, 0.000186, 1275.936),
    'BA': Printed(0.016652, 0.006594, 0.039456, 0.009956, 1702.824),
    'GA': Printed(0.013148, 0.005102, 0.023378, 0.008048, 1792.693),
    'LS': Printed(0.073398, 0.009460, 0.222000, 0.088374, 1427.257),
    'NN': Printed(0.015920, 0.010370, 0.027102, 0.005516, 2085.348),
}
"""Closed loop."""

ESTIMATES: Mapping[str, tuple[float, float, float, float, float]] = {
    'PSO CL': (5.929, 3.807, 1.173, 4.653, 1.206),
    'PSO OL': (5.722, 4.357, 1.332, 5.360, 1.426),
    'GWO CL': (5.077, 3.666, 1.333, 4.852, 1.084),
    'GWO OL': (5.162, 2.790, 0.755, 5.169, 1.452),
    'BA CL': (7.695, 4.990, 1.252, 5.104, 1.688),
    'BA OL': (6.361, 4.228, 1.319, 5.415, 1.597),
    'GA CL': (5.832, 4.241, 1.722, 4.888, 1.380),
    'GA OL': (5.407, 3.637, 1.227, 4.691, 1.461),
    'LS CL': (6.310, 4.203, 1.507, 5.636, 1.265),
    'LS OL': (5.550, 4.169, 1.453, 5.321, 1.391),
}
"""Table 5: a0, a1, a2, b, tau."""

VALIDATION: Mapping[str, tuple[float, float]] = {
    'PSO': (1.171853, 1.055644),
    'GWO': (0.525352, 1.058793),
    'BA': (5.560765, 1.951218),
    'GA': (4.151888, 1.891103),
    'LS': (4.217755, 1.057431),
    'NN': (5.596660, 1.722316),
}
"""Table 6: ITAE on a variable step, open and closed loop."""
