"""The input arrives late: drive, bus and computer take their time."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='input delay',
    equation='u(t) acts at t + delay',
    symptom='The model runs ahead of the measurement at every step of the input; '
    'the inductance seems too large.',
    reference='Ljung, System Identification, 2nd ed. 1999, section 4.2',
    enters=Enters.INPUT,
    amplitudes=(
        Amplitude(
            'delay', 's', 'time from command to effect', Scale.SAMPLE, 200.0, positive=True,
            trials=(0.5, 1.0, 2.0, 4.0, 7.0, 12.0, 20.0, 35.0, 60.0),
        ),
    ),
    axis='time',
    delay='delay',
    hidden_by=('begins_driven',),
)  # fmt: skip
