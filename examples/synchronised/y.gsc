; The short axis.
        S10     ; start-stop speed 100 steps/s
        T50     ; slew speed 500 steps/s
        R20     ; ramps of 20 steps
        W1      ; wait for the start switch
        +400
