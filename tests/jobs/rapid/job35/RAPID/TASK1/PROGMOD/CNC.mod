%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE CNC
! lathe 12, arm looks to -x of the hall
TASK PERS tooldata tg1:=[TRUE,[[0,110,290],[0.939693,0.34202,0,0]],[44,[0,0,140],[1,0,0,0],0,0,0]];
TASK PERS tooldata tg2:=[TRUE,[[0,-110,290],[0.939693,-0.34202,0,0]],[44,[0,0,140],[1,0,0,0],0,0,0]];
TASK PERS wobjdata wLathe:=[FALSE,TRUE,"",[[-1600,-300,1000],[0,0,0,1]],[[0,0,0],[1,0,0,0]]];
TASK PERS wobjdata wPalIn:=[FALSE,TRUE,"",[[-300,1500,700],[0.707107,0,0,0.707107]],[[0,0,0],[1,0,0,0]]];
CONST robtarget pIn:=[[60.46,39.42,11.45],[-0.002055,0.000999,0.953511,-0.301351],[-1,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
CONST robtarget pOut:=[[59.6,-260.79,11.85],[-0.000843,-0.000784,0.953888,0.30016],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
CONST robtarget pWait:=[[-350.18,0.44,449.99],[0.000665,0.001439,0.953821,0.30037],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
CONST robtarget pCh2:=[[39.25,-0.49,119.41],[0.000826,0.001241,0.954055,0.299628],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
CONST robtarget pCh1:=[[40.37,-0.25,121.95],[0.001171,0.001359,0.95382,-0.300375],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
PERS num nRow:=3;

PROC main()
  MoveAbsJ [[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tg1;
  FOR nCol FROM 0 TO 3 DO
    ! row counter is kept over the shifts, column counts here
    MoveJ Offs(pIn,nCol*110,0,250),v1500,z50,tg1\WObj:=wPalIn;
    MoveL Offs(pIn,nCol*110,0,0),v200,fine,tg1\WObj:=wPalIn;
    Set doG1;
    WaitTime 0.4;
    MoveL Offs(pIn,nCol*110,0,250),v800,z50,tg1\WObj:=wPalIn;
    LatheChange;
    MoveJ Offs(pOut,nCol*110,0,250),v1500,z50,tg2\WObj:=wPalIn;
    MoveL Offs(pOut,nCol*110,0,0),v200,fine,tg2\WObj:=wPalIn;
    Reset doG2;
    WaitTime 0.4;
    MoveL Offs(pOut,nCol*110,0,250),v800,z50,tg2\WObj:=wPalIn;
  ENDFOR
  MoveAbsJ [[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tg1;
  ! sample for the gauge: row from the counter of the line
  nRow:=nRow+1;
  MoveJ Offs(pOut,0,-nRow*20,250),v1000,fine,tg2\WObj:=wPalIn;
  MoveAbsJ [[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tg1;
ENDPROC

PROC LatheChange()
  MoveJ pWait,v1500,fine,tg2\WObj:=wLathe;
  WaitDI diDoor,1;
  MoveL Offs(pCh2,0,0,200),v800,z20,tg2\WObj:=wLathe;
  MoveL pCh2,v100,fine,tg2\WObj:=wLathe;
  Set doG2;
  WaitDI diChuckOpen,1;
  MoveL Offs(pCh2,0,0,200),v400,z20,tg2\WObj:=wLathe;
  MoveJ Offs(pCh1,0,0,200),v800,z20,tg1\WObj:=wLathe;
  MoveL pCh1,v100,fine,tg1\WObj:=wLathe;
  Reset doG1;
  WaitDI diChuckClosed,1;
  MoveL Offs(pCh1,0,0,200),v400,z20,tg1\WObj:=wLathe;
  MoveJ pWait,v1500,z50,tg2\WObj:=wLathe;
ENDPROC
ENDMODULE
