"""Play before a load that has friction of its own, which slows it while the teeth are apart."""

import math

import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.signals.record import Record

J, B, J_L, B_L, GAP, STIFF = 0.16, 0.13, 0.14, 0.06, 0.015, 1500.0
DAMPING = 2 * 0.2 * math.sqrt(STIFF * J_L)
DT, FINER, ROWS, COUNT = 2e-3, 10, 3000, 2 * np.pi / 65536


def rate(state, torque):
    """Return the derivative of twist, speed and speed of the load; teeth push and never pull."""
    twist, speed, load = state
    push = 0.0
    if abs(twist) > GAP:
        push = STIFF * (twist - math.copysign(GAP, twist)) + DAMPING * (speed - load)
        push = max(push, 0.0) if twist > 0.0 else min(push, 0.0)
    return speed - load, (torque - B * speed - push) / J, (push - B_L * load) / J_L


def run(seed: int) -> Record:
    """Return a record of the motor side; truth is Runge and Kutta's in a tenth of the sample."""
    rng, time = np.random.default_rng(seed), DT * np.arange(ROWS)
    torque = 2.5 * np.sin(2 * np.pi * (0.5 + 0.2 * time) * time + seed)
    torque += 1.5 * np.repeat(rng.choice([-1.0, 1.0], ROWS // 150), 150)
    state, angle, step = (0.0, 0.0, 0.0), 0.0, DT / FINER
    angles = np.empty(ROWS)

    def moved(by, slope):
        return tuple(one + by * two for one, two in zip(state, slope, strict=True))

    for k, u in enumerate(torque.tolist()):
        angles[k] = angle
        for _ in range(FINER):
            first = rate(state, u)
            second = rate(moved(0.5 * step, first), u)
            third = rate(moved(0.5 * step, second), u)
            fourth = rate(moved(step, third), u)
            angle += step * (state[1] + step / 6 * (first[1] + second[1] + third[1]))
            mean = [
                (a + 2 * b + 2 * c + d) / 6
                for a, b, c, d in zip(first, second, third, fourth, strict=True)
            ]
            state = moved(step, mean)
    position = COUNT * np.floor(angles / COUNT)
    speed = np.diff(position, prepend=position[0]) / DT
    signals = {'torque': torque, 'position': position, 'speed': speed}
    return Record(time, signals, {'torque': 'N m', 'position': 'rad', 'speed': 'rad/s'})


def test_play_before_a_load_with_friction_is_found_with_both():
    """With all friction on the side of the motor this was told as a flexible shaft."""
    found = diagnose([run(1), run(2)], [run(3)], effects=('backlash', 'flexible_shaft'))
    assert (found.verdict, found.effects) == (Verdict.EFFECT_MISSING, ('backlash',))
    model = found.steps[-1].model
    for name, truth in (
        ('J', J), ('b', B), ('backlash.r', J_L / J), ('backlash.phi_g', GAP),
        ('backlash.w_a', math.sqrt(STIFF / J_L)), ('backlash.s_l', B_L / J_L),
    ):  # fmt: skip
        assert model[name] == pytest.approx(truth, rel=0.05), name
