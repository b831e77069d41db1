"""Motors of one type, simulated independently of the package, and what sensors see of them."""

import numpy as np

from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.sensors import measure, Sensors
from motor_sysid.benchmark.truth import Control, run
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.signals.record import Record

DT = 1e-3
TYPE = {
    'R': 2.1, 'L': 2.4e-3, 'k_t': 0.046, 'J': 2.6e-5, 'b': 1.3e-5, 'coulomb_friction.tau_c': 4e-3,
}  # fmt: skip


def sister(rng: np.random.Generator, spread: float) -> dict[str, float]:
    """Return a motor whose parameters differ from those of the type by that relative spread."""
    return {name: v * float(np.exp(spread * rng.standard_normal())) for name, v in TYPE.items()}


def model_of(values: dict[str, float]) -> Model:
    """Return the model with given parameters, dry friction included."""
    own = {name: v for name, v in values.items() if '.' not in name}
    model = Model.base(
        'brushed_dc', {**own, 'omega_eps': 0.3, 'i_eps': 3e-3},
        speed_sensor=SpeedSensor.DIFFERENCE,
    )  # fmt: skip
    return model.with_effect('coulomb_friction', {'tau_c': values['coulomb_friction.tau_c']})


def steps(seconds: float, rng: np.random.Generator) -> np.ndarray:
    """Return a held voltage of random steps, both ways, from the first sample on."""
    count = round(seconds / DT)
    edges = np.cumsum(rng.uniform(0.05, 0.3, count // 50 + 2))
    heights = rng.uniform(-9, 9, edges.size + 1)
    return heights[np.searchsorted(edges, DT * np.arange(count))]


def lazy(seconds: float, rng: np.random.Generator) -> np.ndarray:
    """Return a voltage that tells little: one start in one direction, then nearly constant."""
    t = DT * np.arange(round(seconds / DT))
    return 4.0 + 0.2 * np.sin(2 * np.pi * t + rng.uniform(0, 6))


def recorded(
    values: dict[str, float], volts: np.ndarray, rng: np.random.Generator, gain: float = 1.0
) -> Record:
    """Return what an encoder and a current sensor of that gain see of a motor."""
    tau = values['coulomb_friction.tau_c']
    base = (values[name] for name in ('R', 'L', 'k_t', 'J', 'b'))
    truth = run(Plant(*base, tau_plus=tau, tau_minus=tau), Control(volts), DT)
    scaled = Sensors(4096, 0.0, 0.02, 1e-3, 0.015, current_scale=gain)
    return measure(truth, scaled, DT, rng)
