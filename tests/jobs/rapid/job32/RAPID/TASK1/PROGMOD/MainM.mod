%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE MainM
  TASK PERS tooldata tFronius:=[TRUE,[[75,0,350],[0.953716951,0,-0.3007058,0]],[7,[15,0,120],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata wLeft:=[FALSE,TRUE,"",[[1150,500,800],[0.923879533,0,0,0.382683432]],[[0,0,0],[1,0,0,0]]];
  TASK PERS seamdata seamA:=[0.3,0.3,[0,0,0,0,0,0,0,0,0],0,0,0,0,0,[0,0,0,0,0,0,0,0,0],0,0.2,[0,0,0,0,0,0,0,0,0],0,0,[0,0,0,0,0,0,0,0,0],0.3];
  TASK PERS welddata weldA:=[8,0,[11,0,0,0,0,0,0,0,0],[0,0,0,0,0,0,0,0,0]];
  TASK PERS welddata weldB:=[7,0,[12,0,0,0,0,0,0,0,0],[0,0,0,0,0,0,0,0,0]];
  PROC main()
    MoveAbsJ [[0,-20,25,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v800,fine,tFronius;
    IF diTableL=1 THEN
      Weld_L;
    ENDIF
    MoveAbsJ [[0,-20,25,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v800,fine,tFronius;
    SetDO doDone,1;
  ENDPROC
ENDMODULE
