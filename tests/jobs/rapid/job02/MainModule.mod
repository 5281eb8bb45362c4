%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE MainModule
  PERS tooldata tWeldGun:=[TRUE,[[78.2,-0.6,352.1],[0.961262,0,-0.275637,0]],[7.5,[20,0,120],[1,0,0,0],0,0,0]];
  PERS wobjdata wobjStn1:=[FALSE,TRUE,"",[[950,-400,650],[1,0,0,0]],[[100,80,0],[0.999914,0,0,0.01309]]];
  PERS seamdata sm1:=[0.3,0.2,[0,0,0,0,0,0,0,0,0],0,0,0,0,0,[0,0,0,0,0,0,0,0,0],0,0.3,[0,0,0,0,0,0,0,0,0],0,0,[0,0,0,0,0,0,0,0,0],0.4];
  PERS welddata wd4:=[9,0,[4,0,0,0,0,0,0,0,0],[0,0,0,0,0,0,0,0,0]];
  PERS welddata wd5:=[7,0,[5,0,0,0,0,0,0,0,0],[0,0,0,0,0,0,0,0,0]];
  PERS weavedata wv1:=[1,0,3,2.5,0,0,0,0,0,0,0,0,0,0,0];
  VAR num nParts:=0;

  PROC main()
    AccSet 80,80;
    VelSet 100,2000;
    rHome;
    WHILE nParts<20 DO
      WaitDI diClamped,1;
      rWeld4711;
      Incr nParts;
      IF nParts MOD 5=0 rClean;
    ENDWHILE
    rHome;
  ENDPROC

  PROC rHome()
    MoveAbsJ [[0,-15,20,0,70,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v500,fine,tool0;
  ENDPROC

  PROC rClean()
    MoveJ [[250.33,-1000.49,980.29],[0.268042,0.585288,0.734761,-0.213817],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v800,z20,tWeldGun;
    MoveL [[249.97,-1050.34,760.39],[0.268933,0.58466,0.735236,-0.212783],[-1,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v200,fine,tWeldGun;
    SetDO doCleaner,1;
    WaitTime 3;
    SetDO doCleaner,0;
    MoveL [[249.93,-1000.46,979.77],[0.268195,0.58405,0.736299,-0.211708],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v500,z20,tWeldGun;
  ENDPROC
ENDMODULE
