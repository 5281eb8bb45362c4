%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE ScrewMain
  VAR num i:=1;
  PROC main()
    MoveAbsJ [[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tScrew;
    i:=1;
    WHILE i<=8 DO
      MoveJ RelTool(pScrew{i},0,0,-60),v1000,z10,tScrew\WObj:=wEngine;
      SetGO goProg,nProg{i};
      MoveL pScrew{i},v100,fine,tScrew\WObj:=wEngine;
      SetDO doStart,1;
      WaitUntil diOk=1 OR diNok=1;
      IF diNok=1 Incr nNok;
      SetDO doStart,0;
      MoveL RelTool(pScrew{i},0,0,-60),v500,z10,tScrew\WObj:=wEngine;
      i:=i+1;
    ENDWHILE
    Check pScrew{1};
    MoveAbsJ [[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tScrew;
  ENDPROC

  ! marks the first screw
  PROC Check(robtarget p)
    MoveJ Offs(p,-30,0,90),v800,z10,tScrew\WObj:=wEngine;
    MoveL Offs(p,-30,0,15),v100,fine,tScrew\WObj:=wEngine;
    PulseDO doMark;
    MoveL Offs(p,-30,0,90),v500,z10,tScrew\WObj:=wEngine;
  ENDPROC
ENDMODULE
