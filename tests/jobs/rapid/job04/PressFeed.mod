%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE PressFeed
    TASK PERS tooldata tGripper:=[TRUE,[[0,0,295],[1,0,0,0]],[42,[0,0,150],[1,0,0,0],1.2,1.2,0.8]];
    TASK PERS wobjdata wPress1:=[FALSE,TRUE,"",[[1650,300,820],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    TASK PERS wobjdata wInfeed:=[FALSE,TRUE,"",[[700,-1500,640],[0.843391446,0,0,-0.537299608]],[[0,0,0],[1,0,0,0]]];
    PERS loaddata loPart:=[18.5,[15,0,340],[1,0,0,0],0.4,0.5,0.2];
    CONST robtarget phome:=[[1299.86,0.86,1400.2],[0.000033875,-0.000758117,0.999998961,0.001225987],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST robtarget pInUp:=[[120.59,60.62,329.48],[0.000787199,-0.000590414,0.99999916,-0.000843971],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST robtarget pInPick:=[[120.56,60.62,4.27],[0.000866318,-0.000023264,0.999998643,0.001401207],[-1,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST robtarget pPrOut:=[[-430.85,39.38,420.61],[-0.000772907,0.000689822,0.999998337,0.001501204],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST robtarget pPrUp:=[[39.32,30.84,379.19],[0.000203382,-0.001899726,0.999997683,0.000992204],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST robtarget pPrDrop:=[[39.13,30.69,61],[-0.001731661,-0.001762879,0.999996261,-0.001171304],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    ! not used any more (old die)
    CONST robtarget pPrDrop_old:=[[38.2,22.1,80.0],[0,0,1,0],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    PERS num nPieces:=10443;

    PROC main()
        ConfJ\On; ConfL\On;
        MoveJ phome,v1000,fine,tGripper;
        rPick;
        rDrop;
        MoveJ phome,v1000,z50,tGripper;
        nPieces:=nPieces+1;
    ENDPROC

    PROC rPick()
        MoveJ pInUp,v2000,z50,tGripper\WObj:=wInfeed;
        WaitUntil diPartIn=1 AND diSafe=1;
        MoveL pInPick,v300,fine,tGripper\WObj:=wInfeed;
        SetDO doGrip,1;
        WaitDI diGripped,1\MaxTime:=3;
        GripLoad loPart;
        MoveL pInUp,v800,z50,tGripper\WObj:=wInfeed;
    ERROR
        IF ERRNO=ERR_WAIT_MAXTIME THEN
            TPWrite "part not gripped";
            Stop;
            RETRY;
        ENDIF
    ENDPROC

    PROC rDrop()
        MoveJ pPrOut,v2000,z100,tGripper\WObj:=wPress1;
        WaitDI diPressTop,1;
        MoveL pPrUp,v1500,z50,tGripper\WObj:=wPress1;
        MoveL pPrDrop,v200,fine,tGripper\WObj:=wPress1;
        SetDO doGrip,0;
        WaitTime 0.4;
        GripLoad load0;
        MoveL pPrUp,v800,z50,tGripper\WObj:=wPress1;
        MoveL pPrOut,v2000,z100,tGripper\WObj:=wPress1;
        PulseDO\PLength:=0.3,doPressGo;
    ENDPROC
ENDMODULE
