%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Oven
  PERS tooldata tMag:=[TRUE,[[0,0,270],[1,0,0,0]],[30,[0,0,120],[1,0,0,0],0,0,0]];
  PERS wobjdata wTray:=[FALSE,TRUE,"",[[1500,-350,680],[0.999657325,0,0,0.026176948]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wOven:=[FALSE,TRUE,"",[[1700,400,900],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  VAR intnum intAir;
  VAR intnum intTimer;
  PERS num nAirLost:=2;
  PERS num nSeconds:=81230;
  CONST robtarget pTrayUp:=[[150.02,119.63,279.35],[0.0014463,0.000215972,0.999998861,-0.00037281],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pTray:=[[149.95,120.02,2.65],[0.000265764,-0.000612942,0.99999904,0.00121389],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pOvenFront:=[[-419.49,0.35,360.31],[0.001179989,0.000768364,0.999998929,0.000398194],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pOvenIn:=[[59.76,0.39,339.64],[-0.001360782,-0.001283246,0.999998021,0.00067732],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pOvenDown:=[[60.19,-0.2,144.89],[0.001447427,0.001424588,0.999997513,-0.000922156],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC main()
    IDelete intAir;
    CONNECT intAir WITH trAir;
    ISignalDI diAirOk,0,intAir;
    IDelete intTimer;
    CONNECT intTimer WITH trTimer;
    ITimer 1,intTimer;
    MoveAbsJ [[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tMag;
    rLoad;
    MoveAbsJ [[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tMag;
    ISleep intTimer;
  ERROR
    TEST ERRNO
    CASE ERR_WAIT_MAXTIME:
      TPWrite "time out";
      EXIT;
    DEFAULT:
      ErrWrite "Oven","unexpected";
      EXIT;
    ENDTEST
  ENDPROC

  PROC rLoad()
    MoveJ pTrayUp,v1500,z50,tMag\WObj:=wTray;
    MoveL pTray,v200,fine,tMag\WObj:=wTray;
    SetDO doMag,1;
    WaitTime 0.5;
    MoveL pTrayUp,v600,z50,tMag\WObj:=wTray;
    MoveJ pOvenFront,v1500,fine,tMag\WObj:=wOven;
    WaitDI diDoor,1\MaxTime:=20;
    MoveL pOvenIn,v1000,z10,tMag\WObj:=wOven;
    MoveL pOvenDown,v150,fine,tMag\WObj:=wOven;
    SetDO doMag,0;
    WaitTime 0.8;
    MoveL pOvenIn,v600,z10,tMag\WObj:=wOven;
    MoveL pOvenFront,v1500,z50,tMag\WObj:=wOven;
    PulseDO doDoorClose;
  ENDPROC

  TRAP trAir
    nAirLost:=nAirLost+1;
    SetDO doLamp,1;
  ENDTRAP

  TRAP trTimer
    nSeconds:=nSeconds+1;
  ENDTRAP
ENDMODULE
