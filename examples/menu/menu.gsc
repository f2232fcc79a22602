; A menu: three buttons choose which part of the program runs (GS-C200S).
        S10             ; start-stop speed 100 steps/s
        T100            ; slew speed 1000 steps/s
        R50             ; ramps of 50 steps
menu:
        jc1,near        ; UI1 alone: the value of the inputs is 1
        jc2,far         ; UI2 alone: 2
        jc4,back        ; UI3 alone: 4
        j menu

near:
        G+200
        j done
far:
        G+800
        j done
back:
        G+0
done:
        A1              ; tell that the position is reached
        D1
        C1
release:
        jc0,menu        ; wait until no button is pressed
        j release
