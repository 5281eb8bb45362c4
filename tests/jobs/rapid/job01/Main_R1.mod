%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE Main_R1
  TASK PERS tooldata tGun1:=[TRUE,[[-180.4,2.2,640.5],[0.994522,0,-0.104528,0]],[108,[-40,4,300],[1,0,0,0],9.1,9.4,4.2]];
  TASK PERS wobjdata wFixt10:=[FALSE,TRUE,"",[[1650,-350,980],[0.999999,0,0,0.001309]],[[0,0,0],[1,0,0,0]]];
  PERS spotdata sd12:=[12,2600,1];
  PERS spotdata sd13:=[13,2600,1];
  PERS spotdata sd15:=[15,3000,1];
  PERS gundata gun1:=[1,2,2,[0,0,0,0],[0,0,0,0],0.05,1,0.4,2,0,0,0];
  CONST jointtarget jHome:=[[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC main()
    MoveAbsJ jHome\NoEOffs,v800,fine,tGun1;
    WHILE TRUE DO
      WaitDI diStart,1;
      rSpot_A;
      MoveAbsJ jHome\NoEOffs,v800,fine,tGun1;
      PulseDO\PLength:=0.5,doReady;
      IF diMaint=1 THEN
        EXIT;
      ENDIF
    ENDWHILE
  ENDPROC
ENDMODULE
