%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE M_Raw
  PROC rGetRaw(robtarget pRaw)
    MoveJ pRawUp,v2000,z50,tGrip1\WObj:=wRaw;
    MoveL Offs(pRaw,0,0,150),v1000,z10,tGrip1\WObj:=wRaw;
    MoveL pRaw,v200,fine,tGrip1\WObj:=wRaw;
    SetDO doGr1,1;
    WaitDI diGr1,1;
    MoveL Offs(pRaw,0,0,250),v800,z20,tGrip1\WObj:=wRaw;
    MoveJ pRawUp,v2000,z50,tGrip1\WObj:=wRaw;
  ENDPROC

  PROC rPutFinished()
    MoveJ pFinUp,v2000,z50,tGrip2\WObj:=wFin;
    MoveL pFin,v300,fine,tGrip2\WObj:=wFin;
    SetDO doGr2,0;
    WaitTime 0.3;
    MoveL pFinUp,v1000,z50,tGrip2\WObj:=wFin;
  ENDPROC
ENDMODULE
