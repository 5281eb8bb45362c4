%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE M_Machine
  PROC rMachine()
    WaitDI diDoorOpen,1;
    MoveJ pDoor,v1500,z50,tGrip2\WObj:=wMach;
    MoveL pChuckUp2,v800,z10,tGrip2\WObj:=wMach;
    MoveL pChuck2,v150,fine,tGrip2\WObj:=wMach;
    SetDO doGr2,1;
    WaitDI diChuckOpen,1;
    MoveL pChuckUp2,v400,z10,tGrip2\WObj:=wMach;
    MoveJ pChuckUp1,v800,z10,tGrip1\WObj:=wMach;
    MoveL pChuck1,v150,fine,tGrip1\WObj:=wMach;
    SetDO doGr1,0;
    WaitDI diChuckClosed,1;
    MoveL pChuckUp1,v400,z10,tGrip1\WObj:=wMach;
    MoveJ pDoor,v1500,z50,tGrip2\WObj:=wMach;
    PulseDO doMachStart;
  ENDPROC
ENDMODULE
