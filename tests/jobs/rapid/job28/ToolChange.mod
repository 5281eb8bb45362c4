%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE ToolChange
  PERS tooldata tMaster:=[TRUE,[[0,0,90],[1,0,0,0]],[8,[0,0,40],[1,0,0,0],0,0,0]];
  PERS tooldata tGripA:=[TRUE,[[0,0,360],[1,0,0,0]],[38,[0,0,170],[1,0,0,0],0,0,0]];
  PERS tooldata tGripB:=[TRUE,[[80,0,330],[0.991445,0,-0.130526,0]],[29,[20,0,150],[1,0,0,0],0,0,0]];
  PERS wobjdata wDock:=[FALSE,TRUE,"",[[-300,-1600,750],[-0.67559,0,0,0.737277]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wTable:=[FALSE,TRUE,"",[[1500,-200,720],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS num nTool:=0;
  CONST robtarget pDockA:=[[-0.06,-0.17,0.21],[0.001387,0.000864,0.999999,0.000116],[-2,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pDockB:=[[0.07,450.56,-0.76],[0.000958,0.001353,0.999998,-0.000519],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC main()
    MoveAbsJ [[0,-25,25,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v800,fine,tMaster;
    TakeTool pDockA,1;
    WorkA;
    DropTool pDockA;
    TakeTool pDockB,2;
    WorkB;
    DropTool pDockB;
    MoveAbsJ [[0,-25,25,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v800,fine,tMaster;
  ENDPROC

  PROC TakeTool(robtarget pDock,num n)
    MoveJ Offs(pDock,0,0,400),v800,z50,tMaster\WObj:=wDock;
    MoveL Offs(pDock,0,0,20),v200,z1,tMaster\WObj:=wDock;
    MoveL pDock,v20,fine,tMaster\WObj:=wDock;
    Reset doUnlock;
    Set doLock;
    WaitDI diLocked,1;
    nTool:=n;
    MoveL Offs(pDock,0,0,400),v200,z50,tMaster\WObj:=wDock;
  ENDPROC

  PROC DropTool(robtarget pDock)
    MoveJ Offs(pDock,0,0,400),v800,z50,tMaster\WObj:=wDock;
    MoveL pDock,v50,fine,tMaster\WObj:=wDock;
    Reset doLock;
    Set doUnlock;
    WaitTime 0.8;
    nTool:=0;
    MoveL Offs(pDock,0,0,400),v100,z50,tMaster\WObj:=wDock;
  ENDPROC

  PROC WorkA()
    MoveJ [[100.69,50.6,250.69],[-0.001477,-0.000253,0.999998,0.001375],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1500,z50,tGripA\WObj:=wTable;
    MoveL [[99.7,50.63,14.29],[0.000387,0.00114,0.999999,0.000953],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v200,fine,tGripA\WObj:=wTable;
    MoveL [[100.04,50.37,250.53],[-0.000404,0.001311,0.999999,-0.000088],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v500,z50,tGripA\WObj:=wTable;
  ENDPROC

  PROC WorkB()
    MoveJ [[299.39,149.49,249.93],[0.217274,0.000975,0.97611,-0.001014],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1500,z50,tGripB\WObj:=wTable;
    MoveL [[300.77,149.43,19.63],[0.215355,-0.000266,0.976535,0.001508],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v200,fine,tGripB\WObj:=wTable;
    MoveC [[320.75,169.37,19.23],[0.217202,0.001131,0.976126,0.000712],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],[[339.63,149.69,19.97],[0.214991,-0.001615,0.976614,0.001182],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v100,fine,tGripB\WObj:=wTable;
    MoveL [[339.91,149.4,249.69],[0.217222,0.000456,0.976122,0.000118],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v500,z50,tGripB\WObj:=wTable;
  ENDPROC
ENDMODULE
