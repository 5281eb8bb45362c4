%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Geo
  CONST robtarget pR1:=[[-0.42,-0.15,799.46],[0.000678,-0.00058,0.999999,0.001205],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pR2:=[[0.13,-0.25,300.55],[0.000147,-0.000855,1,0.000235],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pR3:=[[0.53,0.01,118.2],[-0.000383,0.000008,1,-0.000637],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pF1:=[[-299.54,-0.52,520.15],[-0.051951,0.000675,0.998649,-0.000897],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pF2:=[[-0.31,0.24,349.79],[0.000753,0.001039,0.999999,-0.001101],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pF3:=[[-0.23,0.57,176.54],[0.001266,0.000938,0.999999,0.00059],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  VAR bool bPart;

  PROC main()
    MoveAbsJ jHome1\NoEOffs,v1000,z50,tGeo;
    MoveAbsJ jHome2\NoEOffs,v1000,z50,tGeo;
    GetPart;
    MoveAbsJ jHome2\NoEOffs,v800,z50,tGeo;
    PutPart;
    MoveAbsJ jHome1\NoEOffs,v1000,fine,tGeo;
  ENDPROC

  PROC GetPart()
    MoveJ pR1,v1000,z50,tGeo\WObj:=wRack;
    MoveL pR2,v500,z10,tGeo\WObj:=wRack;
    MoveL pR3,v80,fine,tGeo\WObj:=wRack;
    PulseDO\PLength:=0.8,doClamp;
    WaitDI diClamped,1\MaxTime:=4\TimeFlag:=bPart;
    IF bPart THEN
      TPWrite "no part";
      Stop;
    ENDIF
    GripLoad ldSide;
    MoveL pR2,v100,z10,tGeo\WObj:=wRack;
    MoveL pR1,v500,z50,tGeo\WObj:=wRack;
  ENDPROC

  PROC PutPart()
    MoveJ pF1,v800,z50,tGeo\WObj:=wFrame;
    MoveL pF2,v500,z10,tGeo\WObj:=wFrame;
    MoveL pF3,v50,fine,tGeo\WObj:=wFrame;
    WaitUntil diFr1=1 AND diFr2=1;
    PulseDO\PLength:=0.8,doOpen;
    GripLoad load0;
    MoveL pF2,v200,z10,tGeo\WObj:=wFrame;
    MoveL pF1,v1000,z50,tGeo\WObj:=wFrame;
  ENDPROC
ENDMODULE
