%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE PalTable
  PERS tooldata tClamp:=[TRUE,[[0,0,450],[1,0,0,0]],[88,[0,0,230],[1,0,0,0],0,0,0]];
  PERS wobjdata wP1:=[FALSE,TRUE,"",[[1700,-1450,180],[1,0,0,0]],[[10,-5,0],[0.999994,0,0,0.003491]]];
  PERS wobjdata wFeed:=[FALSE,TRUE,"",[[2100,100,700],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  ! x, y, turn of the six places of a layer
  CONST num nPat{6,3}:=[[0,0,0],[400,0,0],[800,0,90],[0,600,90],[400,600,0],[800,600,0]];
  CONST robtarget pZero:=[[200,200,60],[0,0,1,0],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pFeed:=[[50,0,40],[0,0,1,0],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  PERS num nDone:=0;

  PROC main()
    VAR num iLayer;
    VAR num iPos;
    MoveAbsJ [[0,-25,25,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tClamp;
    FOR iLayer FROM 1 TO 2 DO
      FOR iPos FROM 1 TO 6 DO
        MoveJ Offs(pFeed,0,0,500),v2000,z100,tClamp\WObj:=wFeed;
        MoveL pFeed,v500,fine,tClamp\WObj:=wFeed;
        Set doClamp;
        WaitTime 0.4;
        MoveL Offs(pFeed,0,0,600),v1500,z100,tClamp\WObj:=wFeed;
        ConfL\Off;
        MoveJ RelTool(Offs(pZero,nPat{iPos,1},nPat{iPos,2},(iLayer-1)*310+400),0,0,0\Rz:=nPat{iPos,3}),v2000,z100,tClamp\WObj:=wP1;
        MoveL RelTool(Offs(pZero,nPat{iPos,1},nPat{iPos,2},(iLayer-1)*310),0,0,0\Rz:=nPat{iPos,3}),v400,fine,tClamp\WObj:=wP1;
        Reset doClamp;
        WaitTime 0.4;
        MoveL RelTool(Offs(pZero,nPat{iPos,1},nPat{iPos,2},(iLayer-1)*310+400),0,0,0\Rz:=nPat{iPos,3}),v1500,z100,tClamp\WObj:=wP1;
        ConfL\On;
        nDone:=nDone+1;
      ENDFOR
    ENDFOR
    ! slip sheet beside the pallet, place number comes from the line
    MoveJ Offs(pZero,0,giSheet*50,900),v1000,fine,tClamp\WObj:=wP1;
    MoveAbsJ [[0,-25,25,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tClamp;
  ENDPROC
ENDMODULE
