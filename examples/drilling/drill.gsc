; Drill, datasheet example 2, for five holes a bar: the printed program serves one.
        U3      ; execute until UI3 = 0
        S15     ; start-stop speed 150 steps/s
        T200    ; slew speed 2000 steps/s
        R25     ; ramps of 25 steps
        W1      ; wait for the start switch
        L0      ; loop starting point
        W2      ; wait for a drilling command
        A2      ; drill motor on: UO2 = 1
        +150    ; pull down the drill
        D1      ; wait 0.1 s
        G0      ; lift the drill up
        C2      ; drill motor off
        A1      ; hole is drilled: UO1 = 1
        D1      ; for 0.1 s
        C1
        L5      ; five holes
