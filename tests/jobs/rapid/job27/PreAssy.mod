%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE PreAssy
  PERS tooldata tTool:=[TRUE,[[30.000,0,360.000],[0.996195,0,-0.087156,0]],[70.00,[20.0,0,180.0],[1,0,0,0],0,0,0]];
  PERS wobjdata wPre:=[FALSE,TRUE,"",[[-200.000,1700.000,850.000],[0.707107,0,0,0.707107]],[[0,0,0],[1.000000,0,0,0]]];
  CONST zonedata zWide:=[FALSE,80,120,120,12,120,12];
  CONST speeddata vSlow:=[150,200,5000,1000];
  CONST robtarget q10:=[[-100.58,0.49,420.05],[0.174494,-0.001031,0.984658,0.000204],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget q20:=[[79.40,40.12,160.24],[0.173719,-0.001172,0.984794,0.001359],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget q30:=[[80.41,39.46,12.08],[0.174403,-0.000128,0.984674,-0.000378],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget q40:=[[199.84,39.73,11.98],[0.174688,0.000945,0.984623,0.000863],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget q50:=[[320.11,80.37,13.49],[0.173875,-0.000155,0.984768,0.000514],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget q60:=[[319.93,299.85,199.98],[0.173836,0.000033,0.984774,0.001132],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget q70:=[[100.29,320.03,260.42],[0.174851,0.001101,0.984593,-0.001368],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

  PROC main()
    ConfJ\Off;
    SingArea\Off;
    MoveAbsJ [[0,-20.0000,20.0000,0,60.0000,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tTool;
    MoveJ q10,v1500,zWide,tTool\WObj:=wPre;
    MoveLDO q20,v800,z50,tTool\WObj:=wPre,doNear,1;
    MoveL q30,vSlow,fine\Inpos:=inpos50,tTool\WObj:=wPre;
    WaitTime\InPos,0.3;
    VelSet 50,300;
    MoveLSync q40,vSlow,z1,tTool\WObj:=wPre,"Marker";
    MoveL q50,vSlow,fine,tTool\WObj:=wPre;
    VelSet 100,5000;
    MoveJDO q60,v1000,z50,tTool\WObj:=wPre,doNear,0;
    MoveL q70\V:=400,v1000,z20\Z:=30,tTool\WObj:=wPre;
    MoveJ q10,v1500,zWide,tTool\WObj:=wPre;
    MoveAbsJ [[0,-20.0000,20.0000,0,60.0000,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tTool;
    ConfJ\On;
  ENDPROC

  PROC Marker()
    PulseDO\PLength:=0.2,doMark;
  ENDPROC
ENDMODULE
