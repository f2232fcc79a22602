"""Motors: what a motor, its drive and its load make of the pulses, and whether a step is lost on the way.

`named` has motors by name, `move.simulate` judges a move, `curve` computes torque against speed, `fit` fits a motor to
a published curve, `variants` runs many at once. Motors know pulses, not the ramps they come from.
"""
