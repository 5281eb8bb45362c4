%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Stamp
  PERS tooldata tProbe:=[TRUE,[[0,0,260.000],[1.000000,0,0,0]],[14.00,[0,0,100.0],[1,0,0,0],0,0,0]];
  PERS wobjdata wSheet:=[FALSE,TRUE,"",[[1450.000,-300.000,760.000],[1.000000,0,0,0]],[[0,0,0],[1.000000,0,0,0]]];
  CONST pose peRow2:=[[0,220,0],[1,0,0,0]];
  VAR robtarget pHit;
  VAR num nOff;
  CONST robtarget pUp:=[[59.89,60.27,180.21],[0.000625,-0.000386,1.000000,0.000400],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget p1:=[[60.24,59.69,2.03],[-0.000618,-0.000534,1.000000,-0.000550],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget p2:=[[169.61,60.21,2.29],[0.000375,-0.000603,0.999999,0.000776],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget p3:=[[279.89,64.08,2.40],[0.000205,-0.001010,0.999999,0.000246],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pEdge:=[[-39.52,119.61,0.55],[-0.000379,-0.000264,1.000000,0.000026],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pEdgeTo:=[[19.51,119.86,1.42],[0.000895,-0.000867,0.999999,0.000825],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

  PROC main()
    MoveAbsJ [[0,-20.0000,20.0000,0,60.0000,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tProbe;
    rRow;
    ! second row: the same points, 220 mm farther
    PDispSet peRow2;
    rRow;
    PDispOff;
    ! third time: displaced by what the edge search found
    MoveL Offs(pEdge,0,0,80),v500,z5,tProbe\WObj:=wSheet;
    MoveL pEdge,v100,fine,tProbe\WObj:=wSheet;
    SearchL\Stop,diTouch,pHit,pEdgeTo,v20,tProbe\WObj:=wSheet;
    nOff:=pHit.trans.x-(-10);
    MoveL pEdge,v100,fine,tProbe\WObj:=wSheet;
    MoveL Offs(pEdge,0,0,80),v500,fine,tProbe\WObj:=wSheet;
    MoveL Offs(p1,nOff,0,60),v500,z5,tProbe\WObj:=wSheet;
    MoveL Offs(p1,nOff,0,0),v100,fine,tProbe\WObj:=wSheet;
    PulseDO doStamp;
    MoveL Offs(p1,nOff,0,60),v500,z5,tProbe\WObj:=wSheet;
    MoveAbsJ [[0,-20.0000,20.0000,0,60.0000,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tProbe;
  ENDPROC

  PROC rRow()
    MoveJ pUp,v1000,z20,tProbe\WObj:=wSheet;
    MoveL p1,v100,fine,tProbe\WObj:=wSheet;
    PulseDO doStamp;
    MoveL RelTool(p1,0,0,-40),v300,z5,tProbe\WObj:=wSheet;
    MoveL RelTool(p2,0,0,-40),v300,z5,tProbe\WObj:=wSheet;
    MoveL p2,v100,fine,tProbe\WObj:=wSheet;
    PulseDO doStamp;
    MoveL RelTool(p2,0,0,-40),v300,z5,tProbe\WObj:=wSheet;
    MoveL RelTool(p3,0,0,-40),v300,z5,tProbe\WObj:=wSheet;
    MoveL p3,v100,fine,tProbe\WObj:=wSheet;
    PulseDO doStamp;
    MoveL RelTool(p3,0,0,-180),v500,z20,tProbe\WObj:=wSheet;
  ENDPROC
ENDMODULE
