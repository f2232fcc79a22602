"""From the settings of a controller to the pulses of a move: one law for each, which everybody uses who computes moves.

`laws.law` gives the law of a model; `Law.train` makes, from settings counted as the commands count them, the train
that the controller gives for the commands of `Law.commands`, pulse for pulse. `spelling` reads settings as people
write them. This room knows controllers, ramps and motors' windings; nothing here waits, draws or keeps a state.
"""
