%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Service
  !------------------------------------------------
  ! service positions, TCP check, brake check
  !------------------------------------------------
  TASK PERS tooldata tPin:=[TRUE,[[0,0,250],[1,0,0,0]],[12,[0,0,90],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata wPinStand:=[FALSE,TRUE,"",[[1400,-300,700],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  CONST jointtarget jCalib:=[[0,0,0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST jointtarget jService:=[[90,-40,45,0,80,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST jointtarget jBrake1:=[[-45,-10,10,10,45,-30],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST jointtarget jHomePos:=[[0,-30,30,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC CalibPos()
    MoveAbsJ jCalib\NoEOffs,v100,fine,tool0;
    Stop;
    MoveAbsJ jHomePos\NoEOffs,v300,fine,tool0;
  ENDPROC

  PROC ServicePos()
    MoveAbsJ jHomePos\NoEOffs,v300,z50,tool0;
    MoveAbsJ jService\NoEOffs,v300,fine,tool0;
    Stop;
  ENDPROC

  PROC BrakeCheck()
    MoveAbsJ jBrake1\NoEOffs,v300,fine,tool0;
    WaitTime\InPos,1;
    MoveAbsJ jHomePos\NoEOffs,v300,fine,tool0;
  ENDPROC

  PROC TcpCheck()
    MoveJ [[0.34,0.71,159.49],[-0.000284,0.001819,0.999997,0.001465],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v300,z10,tPin\WObj:=wPinStand;
    MoveL [[-0.13,0.46,-0.09],[0.000043,-0.001457,0.999999,-0.000024],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v20,fine,tPin\WObj:=wPinStand;
    Stop;
    MoveL [[0.99,0.15,159.29],[0.001181,0.000097,0.999999,0.000574],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v100,fine,tPin\WObj:=wPinStand;
    MoveL [[-0.85,0.06,160.1],[-0.113084,-0.494804,0.85928,-0.063392],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v100,fine,tPin\WObj:=wPinStand;
    MoveL [[0.01,0.82,1.5],[-0.110581,-0.497053,0.858172,-0.0652],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v20,fine,tPin\WObj:=wPinStand;
    Stop;
    MoveL [[-0.62,-0.13,160.4],[-0.110914,-0.494219,0.859714,-0.065852],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v100,fine,tPin\WObj:=wPinStand;
    MoveAbsJ jHomePos\NoEOffs,v300,fine,tool0;
  ENDPROC

  PROC main()
    VAR num nSel;
    TPReadFK nSel,"Service",stEmpty,"Calib","Serv","Brake","TCP";
    IF nSel=2 CalibPos;
    IF nSel=3 ServicePos;
    IF nSel=4 BrakeCheck;
    IF nSel=5 TcpCheck;
  ENDPROC
ENDMODULE
