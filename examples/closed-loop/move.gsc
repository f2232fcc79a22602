; One move of 1000 steps.
        S10     ; start-stop speed 100 steps/s
        T100    ; slew speed 1000 steps/s
        R50     ; ramps of 50 steps
        +1000
