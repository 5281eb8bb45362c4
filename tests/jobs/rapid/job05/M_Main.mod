%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE M_Main
  PROC main()
    rInit;
    WHILE diStop=0 DO
      TEST nType
      CASE 1:
        rGetRaw pRaw1;
      CASE 2:
        rGetRaw pRaw2;
      DEFAULT:
        TPErase;
        TPWrite "wrong type "\Num:=nType;
        Stop;
      ENDTEST
      rMachine;
      rPutFinished;
    ENDWHILE
    MoveAbsJ jHome,v500,fine,tGrip1;
  ENDPROC

  PROC rInit()
    SetDO doGr1,0;
    SetDO doGr2,0;
    AccSet 100,100;
    MoveAbsJ jHome,v500,fine,tGrip1;
  ENDPROC
ENDMODULE
