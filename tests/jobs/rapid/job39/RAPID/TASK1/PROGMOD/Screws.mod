%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE Screws
  TASK PERS tooldata tDriver:=[TRUE,[[70.000,0,280.000],[0.984807753,0,0.173648178,0]],[17.00,[20.0,0,110.0],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata wHousing:=[FALSE,TRUE,"",[[1150.000,-150.000,1000.000],[0.999847695,0,0,0.017452406]],[[15.000,-5.000,0],[1.000000000,0,0,0]]];
  VAR intnum intTorque;
  PERS num nAlarms:=0;
  PROC main()
    CONNECT intTorque WITH trTorque;
    ISignalDI\Single,diTorque,1,intTorque;
    MoveAbsJ [[0,-20.0000,25.0000,0,60.0000,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tDriver;
    MoveJ pArr{1},v800,z10,tDriver\WObj:=wHousing;
    Drive pS1;
    Drive pS2;
    Drive pS3;
    MoveL pArr{4},v800,z10,tDriver\WObj:=wHousing;
    Drive pS4;
    Drive pS5;
    Drive pS6;
    FOR i FROM 6 TO 1 STEP -1 DO
      MoveL pArr{i},v500,z5,tDriver\WObj:=wHousing;
      PulseDO doCamera;
    ENDFOR
    MoveAbsJ [[0,-20.0000,25.0000,0,60.0000,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tDriver;
    IDelete intTorque;
  ENDPROC
  PROC Drive(robtarget p)
    MoveL Offs(p,0,0,50),v800,z5,tDriver\WObj:=wHousing;
    MoveL p,v60,fine,tDriver\WObj:=wHousing;
    SetDO doDrive,1;
    WaitDI diDone,1;
    SetDO doDrive,0;
    MoveL RelTool(p,0,0,-50),v500,z5,tDriver\WObj:=wHousing;
  ENDPROC
  TRAP trTorque
    nAlarms:=nAlarms+1;
  ENDTRAP
ENDMODULE
