%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE MainMill
  TASK PERS tooldata tHSK:=[TRUE,[[140.000,0,390.000],[0.92387953,0,-0.38268343,0]],[60.00,[60.0,0,200.0],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata wBlock:=[FALSE,TRUE,"",[[1750.000,-250.000,1000.000],[1.00000000,0,0,0]],[[0,0,0],[1.00000000,0,0,0]]];
  CONST speeddata vF:=[45,300,5000,1000];
  PROC main()
    ConfL\Off;
    ConfJ\Off;
    MoveAbsJ [[0,-20.0000,25.0000,0,60.0000,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v500,fine,tHSK;
    SetDO doSpindle,1;
    Rough1;
    Finish1;
    SetDO doSpindle,0;
    MoveAbsJ [[0,-20.0000,25.0000,0,60.0000,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v500,fine,tHSK;
  ENDPROC
ENDMODULE
