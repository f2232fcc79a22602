; Single steps, and time to come to rest between them.
        S10     ; 100 steps/s: the step comes 10 ms after the command
        L0
        +1
        D5      ; half a second
        L3
