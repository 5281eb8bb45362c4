%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Depal
  PERS tooldata tSuck:=[TRUE,[[0,0,380],[1,0,0,0]],[58,[0,0,180],[1,0,0,0],0,0,0]];
  PERS wobjdata wStack:=[FALSE,TRUE,"",[[1800,-500,200],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wOut:=[FALSE,TRUE,"",[[500,1900,650],[0.766044,0,0,0.642788]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget pAbove:=[[350.03,450.64,1249.78],[0.001298,-0.000638,0.999998,0.001374],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pDown:=[[350.23,450.46,80.52],[-0.001183,-0.000278,0.999999,0.000474],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  VAR robtarget pFound;
  CONST robtarget pOutUp:=[[-100.68,80.41,619.76],[-0.001078,0.00085,0.999998,0.001404],[0,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pOut:=[[99.5,79.44,109.62],[0.001121,0.000457,0.999999,0.001076],[0,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  VAR bool bFound;

  PROC main()
    MoveAbsJ [[0,-25,25,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tSuck;
    REP:
    bFound:=FALSE;
    rSearch;
    IF bFound=FALSE THEN
      TPWrite "stack empty";
      RETURN;
    ENDIF
    MoveL Offs(pFound,0,0,-8),v100,fine,tSuck\WObj:=wStack;
    Set doVac;
    WaitTime 0.5;
    MoveL Offs(pFound,0,0,350),v800,z50,tSuck\WObj:=wStack;
    MoveJ pOutUp,v1500,z50,tSuck\WObj:=wOut;
    MoveL pOut,v300,fine,tSuck\WObj:=wOut;
    Reset doVac;
    WaitTime 0.3;
    MoveL pOutUp,v1500,z50,tSuck\WObj:=wOut;
    GOTO REP;
  ENDPROC

  PROC rSearch()
    MoveJ pAbove,v1500,z50,tSuck\WObj:=wStack;
    SearchL\Stop,diSensor,pFound,pDown,v100,tSuck\WObj:=wStack;
    bFound:=TRUE;
  ERROR
    IF ERRNO=ERR_WHLSEARCH THEN
      StorePath;
      MoveL pAbove,v500,fine,tSuck\WObj:=wStack;
      RestoPath;
      RETURN;
    ENDIF
  ENDPROC
ENDMODULE
