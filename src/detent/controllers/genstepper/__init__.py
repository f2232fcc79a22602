"""The Norberg BS0610 and BS0710 boards with GenStepper 2.18: two motors, microstepped, on a tick of 16 us.

`firmware` is the device, a `board` that obeys; `commands` the table of serial commands; `link` numbers and the form of
answers, `prompter` when they go out; `motor` one motor's motion, `windings` what its coils get, `inputs` limits and
slew keys, `direct` the E mode, `reports` what `?` tells. `wiring` and `supply` are the manual's engineering pages.
"""
