%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE Deburr
CONST jointtarget jH:=[[0,-15.0000,20.0000,0,60.0000,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PERS tooldata tSpindle:=[TRUE,[[40.000,0,310.000],[0.9762960,0,-0.2164396,0]],[15.00,[10.0,0,130.0],[1,0,0,0],0,0,0]];
PERS wobjdata wCast:=[FALSE,TRUE,"",[[1050.000,-200.000,700.000],[0.9990482,0,0,0.0436194]],[[0,0,0],[1.0000000,0,0,0]]];
CONST speeddata vCut:=[40,100,5000,1000];
CONST zonedata zCut:=[FALSE,0.5,0.8,0.8,0.08,0.8,0.08];
VAR robtarget pRing1:=[[100.00,100.00,0],[0.3420201,0,0.9396926,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
VAR robtarget pRing2:=[[260.00,100.00,0],[0.3420201,0,0.9396926,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
CONST robtarget pEdge{5}:=[[[30.00,30.00,0.50],[0.3420201,0,0.9396926,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[120.00,24.00,0.60],[0.3420201,0,0.9396926,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[210.00,22.00,0.80],[0.3420201,0,0.9396926,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[300.00,28.00,0.60],[0.3420201,0,0.9396926,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[330.00,60.00,0.40],[0.3420201,0,0.9396926,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]];

PROC main()
SingArea\Off;
MoveAbsJ jH,v500,fine,tSpindle\WObj:=wCast;
SetDO doSpin,1;
Ring pRing1,30;
Ring pRing2,22.5;
Edge;
SetDO doSpin,0;
MoveAbsJ jH,v500,fine,tSpindle\WObj:=wCast;
ENDPROC

! full circle of radius r round p
PROC Ring(robtarget p,num r)
MoveJ RelTool(Offs(p,r,0,0),0,0,-60),v500,z10,tSpindle\WObj:=wCast;
MoveL Offs(p,r,0,0),vCut,fine,tSpindle\WObj:=wCast;
MoveC Offs(p,0,r,0),Offs(p,-r,0,0),vCut,zCut,tSpindle\WObj:=wCast;
MoveC Offs(p,0,-r,0),Offs(p,r,0,0),vCut,zCut,tSpindle\WObj:=wCast;
MoveL RelTool(Offs(p,r,0,0),0,0,-60),v200,z10,tSpindle\WObj:=wCast;
ENDPROC

PROC Edge()
VAR num n;
MoveJ RelTool(pEdge{1},0,0,-80),v500,z10,tSpindle\WObj:=wCast;
FOR n FROM 1 TO 5 DO
MoveL pEdge{n},vCut,zCut,tSpindle\WObj:=wCast;
ENDFOR
MoveL RelTool(pEdge{5},0,0,-80),v200,z10,tSpindle\WObj:=wCast;
MoveL RelTool(pEdge{5},0,0,-150\Rz:=20),v500,fine,tSpindle\WObj:=wCast;
ENDPROC
ENDMODULE
