%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Hood_Glue
    PERS beaddata bdHood:=[4,4,100,100];
    CONST robtarget pA:=[[-0.41,-0.4,249.58],[0.438876,-0.000764,0.898547,0.000775],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST robtarget pB:=[[29.86,29.52,7.56],[0.438802,-0.00015,0.898584,0.000102],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST robtarget pC:=[[400.38,28.19,7.72],[0.439317,0.00012,0.898332,-0.000701],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST robtarget pD:=[[455.39,54.96,8.15],[0.438661,0.001386,0.89865,-0.00142],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST robtarget pE:=[[477.76,109.74,8.21],[0.437779,-0.000122,0.899083,0.000537],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST robtarget pF:=[[480.28,320.34,9.09],[0.438246,-0.00006,0.898855,-0.000414],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST robtarget pG:=[[49.97,329.77,9.29],[0.438165,-0.000694,0.898894,0.000498],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PROC GlueHood()
        VAR num nTry:=0;
        MoveJ pA,v1000,z50,toolGlue\WObj:=wHood;
        DispL\On,pB,v200,bdHood,fine,toolGlue\WObj:=wHood;
        DispL pC,v250,bdHood,z5,toolGlue\WObj:=wHood;
        DispC pD,pE,v250,bdHood,z5,toolGlue\WObj:=wHood;
        DispL pF,v250,bdHood,z5,toolGlue\WObj:=wHood;
        DispL\Off,pG,v250,bdHood,fine,toolGlue\WObj:=wHood;
        MoveL Offs(pG,0,0,200),v800,z50,toolGlue\WObj:=wHood;
    ERROR
        IF nTry<2 THEN
            nTry:=nTry+1;
            ProcerrRecovery\SyncLastMoveInst;
            RETRY;
        ENDIF
        RAISE;
    ENDPROC
ENDMODULE
