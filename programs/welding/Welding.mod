%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Welding
  ! Bracket 2107: an edge, four stitches, half a ring.
  TASK PERS tooldata tTorch:=[TRUE,[[95.3,-2.1,352.7],[0.923879533,0,0.382683432,0]],[12,[40,0,120],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata wFixture:=[FALSE,TRUE,"",[[1450,-400,900],[0.999847695,0,0,0.017452406]],[[0,0,0],[1,0,0,0]]];
  TASK PERS seamdata seam1:=[0.5,0.5,[5,0,24,120,0,0,0,0,0],0,0,0,0,0,[5,0,24,120,0,0,0,0,0],0,0,[5,0,24,120,0,0,0,0,0],0,0,[0,0,0,0,0,0,0,0,0],0];
  TASK PERS welddata weld1:=[8,0,[5,0,24,160,0,0,0,0,0],[0,0,0,0,0,0,0,0,0]];
  TASK PERS welddata weld2:=[6,0,[5,0,23,140,0,0,0,0,0],[0,0,0,0,0,0,0,0,0]];
  CONST jointtarget jHome:=[[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pAbove:=[[350.00,150.00,260.00],[-0.007574427,0.983870434,0.042956711,0.173482903],[-1,-1,1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC main()
    ConfL\On;
    ConfJ\On;
    MoveAbsJ jHome\NoEOffs,v1000,fine,tTorch;
    WaitDI diPartIn,1;
    MoveJ pAbove,v1000,z50,tTorch\WObj:=wFixture;
    edge;
    MoveJ pAbove,v1000,z50,tTorch\WObj:=wFixture;
    stitch;
    MoveJ pAbove,v1000,z50,tTorch\WObj:=wFixture;
    ring;
    MoveJ pAbove,v1000,z50,tTorch\WObj:=wFixture;
    MoveAbsJ jHome\NoEOffs,v1000,fine,tTorch;
    Set doPartDone;
  ENDPROC
ENDMODULE
