%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Welding(SYSMODULE, NOSTEPIN)
  ! Two seams and a search; every kind of statement once.
  RECORD seam
    robtarget start;
    num count;
  ENDRECORD
  ALIAS num level;
  LOCAL CONST robtarget pHome:=[[1250.00,-0.25,1500],[0.5,0,0.866025404,0],[0,-1,0,1],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PERS robtarget p10:=[[1000.5,200,900],[0.00123,-0.70711,0.70711,0],
      [-1,0,-1,0], ! a comment; in the middle
      [9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  VAR robtarget list{2}:=[[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],
    [[4,5,6],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]];
  VAR robtarget later;
  CONST jointtarget jPark:=[[0,-20.5,15,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  TASK PERS tooldata tTorch:=[TRUE,[[95.3,-2.1,352.7],[0.924,0,0.3827,0]],[0.001,[0,10,90],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata wTable:=[FALSE,TRUE,"",[[850,-300,412.5],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS loaddata load1:=[5,[50,0,50],[1,0,0,0],0,0,0];
  CONST speeddata vSlow:=[50,500,5000,1000];
  CONST zonedata zMine:=[FALSE,0.3,0.3,0.3,0.03,0.3,0.03];
  CONST pos offset:=[0,0,10.5];
  CONST orient upright:=[1,0,0,0];
  CONST pose shift:=[[0,0,5],[1,0,0,0]];
  VAR num n:=-1;
  VAR intnum stop1;

  PROC main()
    VAR seam s1;
    ConfL\Off;
    SingArea \Wrist;
    CONNECT stop1 WITH t_stop;
    MoveAbsJ jPark\NoEOffs,v1000,fine,tTorch\WObj:=wobj0;
    MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs, v1000, z50, tTorch;
    MoveJ pHome,v1000,z50,tTorch\WObj:=wTable;
    again:
    FOR i FROM 1 TO 2 STEP 1 DO
      MoveL list{i},v200,z5,tTorch\WObj:=wTable;
      IF i=2 MoveL Offs(list{i},0,0,-12.5),v200,
          fine,tTorch\WObj:=wTable;
    ENDFOR
    ArcLStart p10,v100,seam1,weld1,fine,tTorch\WObj:=wTable;
    ArcC [[10,20,30],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[40,50,60],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,seam1,weld1,z1,tTorch;
    SearchL\Stop,di1,later,p10,v20,tTorch\WObj:=wTable;
    WHILE n<3 DO
      n:=n+1;
      TEST n
      CASE 1,2:
        MoveL RelTool(p10,0,0,-50\Rz:=-5),v500,z10,tTorch\WObj:=wTable;
      DEFAULT:
        PDispOn\ExeP:=p10,pHome,tTorch;
        PDispOff;
      ENDTEST
    ENDWHILE
    IF n>5 THEN
      GOTO again;
    ELSEIF ready() THEN
      weld 1.5\fast;
    ELSE
      TPWrite "done; ""really"" ! no comment"\Num:=n;
    ENDIF
    %"weld"+"2"%;
    GripperOpen;
  ERROR (ERR_WAIT_MAXTIME)
    RETRY;
  UNDO
    Stop;
  ENDPROC

  LOCAL PROC weld(num length\switch fast|switch slow,VAR robtarget p{*})
    EGMMoveL later;
    RETURN;
  ENDPROC

  FUNC bool ready()
    RETURN n=0;
  ENDFUNC

  TRAP t_stop
    StopMove;
  ENDTRAP
ENDMODULE
