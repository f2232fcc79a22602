; Bar positioning, datasheet example 2: five holes, 120 steps apart, then the cut.
; U3 repeats it for bar after bar while the stop switch on UI3 is closed to 1.
        U3      ; execute until UI3 = 0
        S10     ; start-stop speed 100 steps/s
        T100    ; slew speed 1000 steps/s
        R40     ; ramps of 40 steps
        W1      ; wait for the start switch
        +250    ; reach the first drilling position
        L0      ; loop starting point
        A2      ; call the drill: UO2 = 1
        D1      ; for 0.1 s
        C2
        W2      ; wait until the hole is drilled
        +120    ; next drilling position, 120 steps clockwise
        L4      ; four holes in the loop
        A2      ; the fifth hole
        C2
        W2      ; wait until it is drilled
        +250    ; reach the cutting position
        A1      ; cutting blade: UO1 = 1
        D5      ; for 0.5 s
        C1
