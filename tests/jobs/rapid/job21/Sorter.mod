%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE Sorter
  PERS tooldata tGr:=[TRUE,[[0,0,320.000],[1.000000,0,0,0]],[40.00,[0,0,150.0],[1,0,0,0],0,0,0]];
  PERS wobjdata wTab:=[FALSE,TRUE,"",[[1500.000,-400.000,700.000],[1.000000,0,0,0]],[[0,0,0],[1.000000,0,0,0]]];
  CONST robtarget pA:=[[80.04,79.55,14.64],[-0.000279,0.000757,1.000000,0.000214],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pB:=[[279.87,79.45,15.44],[-0.000234,0.000740,0.999999,-0.000667],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pC:=[[480.57,79.33,15.21],[0.000298,0.000828,1.000000,0.000468],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pT1:=[[99.44,599.80,21.84],[-0.000326,-0.001157,0.999998,0.001471],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pT2:=[[299.52,599.91,22.65],[0.001358,-0.001468,0.999997,0.001197],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST jointtarget jHome:=[[0,-20.0000,20.0000,0,60.0000,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC main()
    MoveAbsJ jHome\NoEOffs,v1000,z50,tGr;
    Transfer pA,pT1,120;
    Transfer pB,pT2,120;
    Transfer pC,pT1,180;
    Shake pT1,4;
    MoveAbsJ jHome\NoEOffs,v1000,fine,tGr;
  ENDPROC

  PROC Transfer(robtarget pFrom,robtarget pTo,num nHigh)
    MoveJ Offs(pFrom,0,0,nHigh),v1500,z20,tGr\WObj:=wTab;
    MoveL pFrom,v300,fine,tGr\WObj:=wTab;
    Grip TRUE;
    MoveL Offs(pFrom,0,0,nHigh),v800,z20,tGr\WObj:=wTab;
    MoveL Offs(pTo,0,0,nHigh),v1500,z20,tGr\WObj:=wTab;
    MoveL pTo,v300,fine,tGr\WObj:=wTab;
    Grip FALSE;
    MoveL Offs(pTo,0,0,nHigh),v800,z20,tGr\WObj:=wTab;
  ENDPROC

  PROC Shake(robtarget p,num nTimes)
    VAR num k;
    MoveJ Offs(p,0,0,60),v1000,fine,tGr\WObj:=wTab;
    FOR k FROM 1 TO nTimes DO
      MoveL Offs(p,10,0,60),v500,z1,tGr\WObj:=wTab;
      MoveL Offs(p,-10,0,60),v500,z1,tGr\WObj:=wTab;
    ENDFOR
    MoveL Offs(p,0,0,60),v500,fine,tGr\WObj:=wTab;
  ENDPROC

  LOCAL PROC Grip(bool bClose)
    IF bClose THEN
      Set doClose; Reset doOpen;
    ELSE
      Reset doClose; Set doOpen;
    ENDIF
    WaitTime 0.4;
  ENDPROC
ENDMODULE
