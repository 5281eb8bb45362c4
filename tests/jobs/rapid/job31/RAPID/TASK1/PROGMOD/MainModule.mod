%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE MainModule
    TASK PERS gundata gunA:=[1,2,2,[0,0,0,0],[0,0,0,0],0.05,1,0.4,2,0,0,0];
    TASK PERS spotdata sp2600_12:=[12,2600,1];
    TASK PERS spotdata sp2600_13:=[13,2600,1];
    CONST jointtarget jHome:=[[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    PERS num nStyle:=1;
    PROC main()
        MoveAbsJ jHome\NoEOffs,v1000,fine,gun_1;
        WHILE TRUE DO
            WaitUntil diStart=1;
            nStyle:=giStyle;
            TEST nStyle
            CASE 1:
                Style_A_110;
            CASE 9:
                TipDress;
            DEFAULT:
                TPWrite "no style";
            ENDTEST
            MoveAbsJ jHome\NoEOffs,v1000,fine,gun_1;
            PulseDO doReady;
        ENDWHILE
    ENDPROC
    PROC TipDress()
        MoveJ [[400.21,1499.49,1499.54],[0.137442,-0.599138,0.781497,0.106798],[0,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1500,z50,gun_1;
        MoveL [[420.23,1599.68,1300.09],[0.138415,-0.600211,0.780687,0.105432],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v500,z5,gun_1;
        MoveL [[420.45,1599.49,1232.14],[0.137403,-0.599319,0.781649,0.104704],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v100,fine,gun_1;
        SetDO doDresser,1;
        WaitTime 1.5;
        SetDO doDresser,0;
        MoveL [[419.86,1599.85,1400.48],[0.137625,-0.600245,0.780681,0.106311],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v500,z20,gun_1;
    ENDPROC
ENDMODULE
