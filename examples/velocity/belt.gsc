; A belt that is indexed to the next mark, three times.
        S10     ; start-stop speed 100 steps/s
        T80     ; slew speed 800 steps/s
        R40     ; ramps of 40 steps
        L0
        +30     ; off the mark
        G+2     ; on, until the sensor on UI2 is 0, then ramp down
        D2      ; 0.2 s
        L3
