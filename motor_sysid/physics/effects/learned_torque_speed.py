"""A torque over speed that was learned from data: what no effect of the catalogue explains."""

from motor_sysid.physics.effect import Card, Enters, Scale
from motor_sysid.physics.laws import table
from motor_sysid.physics.learned import limits, values

CARD = Card(
    title='learned torque over speed',
    equation='tau = straight lines between values at knots of speed',
    symptom='The unexplained torque is a function of speed of no shape that is known.',
    reference='de Boor, A Practical Guide to Splines, 2001, chapter 3',
    enters=Enters.MECHANICAL,
    amplitudes=values('N m', Scale.TORQUE),
    shapes=limits('rad/s', Scale.SPEED),
    axis='speed',
)


def torque(
    omega: float, back: float, ahead: float, fade: float, m_12: float, m_11: float,
    m_10: float, m_9: float, m_8: float, m_7: float, m_6: float, m_5: float, m_4: float,
    m_3: float, m_2: float, m_1: float, p_0: float, p_1: float, p_2: float, p_3: float,
    p_4: float, p_5: float, p_6: float, p_7: float, p_8: float, p_9: float, p_10: float,
    p_11: float, p_12: float,
) -> float:  # fmt: skip
    """Torque in N m."""
    minus = (p_0, m_1, m_2, m_3, m_4, m_5, m_6, m_7, m_8, m_9, m_10, m_11, m_12)
    plus = (p_0, p_1, p_2, p_3, p_4, p_5, p_6, p_7, p_8, p_9, p_10, p_11, p_12)
    return table(omega, back, ahead, fade, minus, plus)
