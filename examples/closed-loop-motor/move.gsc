; One move of 2000 half steps, with a ramp that asks too much of the motor.
        S30     ; start-stop speed 300 half steps/s
        T400    ; slew speed 4000 half steps/s
        R40     ; ramps of 40 steps
        +2000
