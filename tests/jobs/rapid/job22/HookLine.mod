%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE HookLine
  PERS tooldata tHook:=[TRUE,[[0,0,400],[1,0,0,0]],[33,[0,0,190],[1,0,0,0],0,0,0]];
  PERS wobjdata wRail:=[FALSE,TRUE,"",[[1450,-800,900],[0.984808,0,0,-0.173648]],[[0,0,0],[1,0,0,0]]];
  VAR robtarget pNow;
  VAR jointtarget jNow;
  CONST robtarget pSafe:=[[-0.59,300.69,599.78],[0.000155,-0.001101,0.999999,-0.000561],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pH1:=[[200.35,300.57,59.58],[-0.00079,0.001553,0.999998,-0.000802],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pH2:=[[200.54,419.8,59.4],[0.001643,0.000366,0.999999,0.000156],[-1,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST jointtarget jHome:=[[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC main()
    ToHome;
    MoveJ pSafe,v1500,z50,tHook\WObj:=wRail;
    MoveL Offs(pH1,0,0,200),v1000,z20,tHook\WObj:=wRail;
    MoveL pH1,v200,fine,tHook\WObj:=wRail;
    WaitDI diHooked,1;
    MoveL pH2,v100,fine,tHook\WObj:=wRail;
    MoveL Offs(pH2,0,0,300),v500,z50,tHook\WObj:=wRail;
    MoveJ pSafe,v1500,z50,tHook\WObj:=wRail;
    MoveAbsJ jHome,v1000,fine,tHook;
  ENDPROC

  PROC ToHome()
    ! straight up from wherever the arm is
    pNow:=CRobT(\Tool:=tHook\WObj:=wobj0);
    IF pNow.trans.z<1400 THEN
      pNow.trans.z:=1400;
      MoveL pNow,v200,fine,tHook;
    ENDIF
    MoveL Offs(CRobT(\Tool:=tHook),0,0,50),v100,fine,tHook;
    jNow:=CJointT();
    jNow.robax.rax_1:=0;
    MoveAbsJ jNow\NoEOffs,v300,z50,tHook;
    MoveAbsJ jHome\NoEOffs,v500,fine,tHook;
  ENDPROC
ENDMODULE
