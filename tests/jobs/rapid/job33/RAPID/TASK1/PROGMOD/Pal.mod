%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE Pal
  VAR num x;
  VAR num y;
  VAR num z;
  PROC main()
    MoveAbsJ [[0,-25.0000,25.0000,0,60.0000,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]]\NoEOffs,v1500,fine,tFork;
    FOR z FROM 0 TO 1 DO
      FOR y FROM 0 TO 2 DO
        FOR x FROM 0 TO 1 DO
          Fetch;
          Place x*nPitchX,y*nPitchY,z*nPitchZ;
        ENDFOR
      ENDFOR
    ENDFOR
    MoveAbsJ [[0,-25.0000,25.0000,0,60.0000,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]]\NoEOffs,v1500,fine,tFork;
    PulseDO doPalFull;
  ENDPROC
  PROC Fetch()
    MoveJ pInfUp,v2000,z100,tFork\WObj:=wInf;
    WaitDI diBox,1;
    MoveL pInfeed,v400,fine,tFork\WObj:=wInf;
    Set doFork;
    WaitTime 0.5;
    MoveL pInfUp,v1500,z100,tFork\WObj:=wInf;
  ENDPROC
  PROC Place(num dx,num dy,num dz)
    MoveJ Offs(pPalRef,dx,dy,dz+600),v2000,z100,tFork\WObj:=wPal;
    MoveL Offs(pPalRef,dx,dy,dz+30),v800,z10,tFork\WObj:=wPal;
    MoveL Offs(pPalRef,dx,dy,dz),v100,fine,tFork\WObj:=wPal;
    Reset doFork;
    WaitTime 0.5;
    MoveL Offs(pPalRef,dx,dy,dz+600),v1500,z100,tFork\WObj:=wPal;
  ENDPROC
ENDMODULE
