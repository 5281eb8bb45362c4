%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE Palletize
  PERS tooldata tVac:=[TRUE,[[0,0,410.000],[1.000000,0,0,0]],[62.00,[0,0,190.0],[1,0,0,0],0,0,0]];
  PERS wobjdata wPallet:=[FALSE,TRUE,"",[[1500.000,-1500.000,150.000],[1.000000,0,0,0]],[[0,0,0],[1.000000,0,0,0]]];
  PERS wobjdata wConv:=[FALSE,TRUE,"",[[2000.000,200.000,720.000],[1.000000,0,0,0]],[[0,0,0],[1.000000,0,0,0]]];
  CONST num nCols:=3;
  CONST num nRows:=3;
  CONST num nLayers:=3;
  CONST num nDx:=390;
  CONST num nDy:=280;
  CONST num nDz:=180;
  PERS loaddata ldBox:=[24,[0,0,560],[1,0,0,0],0.9,0.9,0.6];
  PERS loaddata ldNone:=[0.001,[0,0,0.001],[1,0,0,0],0,0,0];
  CONST jointtarget jpHome:=[[0,-20.0000,25.0000,0,60.0000,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pPick:=[[60.0,0,90.0],[0,0,1.000000,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pPlace0:=[[200.0,150.0,130.0],[0,0,1.000000,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  VAR num i;
  VAR num j;
  VAR num k;

  PROC main()
    ConfL\Off;
    MoveAbsJ jpHome,v1000,fine,tVac;
    FOR k FROM 0 TO nLayers-1 DO
      FOR j FROM 0 TO nRows-1 DO
        FOR i FROM 0 TO nCols-1 DO
          PickBox;
          MoveJ Offs(pPlace0,i*nDx,j*nDy,k*nDz+350),v2000,z100,tVac\WObj:=wPallet;
          MoveL Offs(pPlace0,i*nDx,j*nDy,k*nDz),v500,fine,tVac\WObj:=wPallet;
          Reset doVac;
          GripLoad ldNone;
          WaitTime 0.3;
          MoveL Offs(pPlace0,i*nDx,j*nDy,k*nDz+350),v1500,z100,tVac\WObj:=wPallet;
        ENDFOR
      ENDFOR
    ENDFOR
    MoveAbsJ jpHome,v1000,fine,tVac;
  ENDPROC

  PROC PickBox()
    MoveJ Offs(pPick,0,0,300),v2000,z100,tVac\WObj:=wConv;
    WaitDI diBox,1;
    MoveL pPick,v500,fine,tVac\WObj:=wConv;
    Set doVac;
    GripLoad ldBox;
    WaitTime 0.4;
    MoveL Offs(pPick,0,0,300),v1500,z100,tVac\WObj:=wConv;
  ENDPROC
ENDMODULE
