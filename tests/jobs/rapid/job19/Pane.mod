%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE Pane
  ! the arm carries the pane past a fixed nozzle
  PERS tooldata tGripPane:=[TRUE,[[0,0,250],[1,0,0,0]],[35,[0,0,160],[1,0,0,0],0,0,0]];
  PERS tooldata tStatGun:=[FALSE,[[1650,250,1150],[1,0,0,0]],[0.001,[0,0,0.001],[1,0,0,0],0,0,0]];
  PERS wobjdata wStand:=[FALSE,TRUE,"",[[700,-1450,700],[0.866025,0,0,-0.5]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wPane:=[TRUE,TRUE,"",[[0,0,250],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS loaddata ldPane:=[11,[0,0,300],[1,0,0,0],0.6,0.6,1.1];
  CONST robtarget pSt1:=[[0,0,350],[0,0,1,0],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pSt2:=[[0,0,12],[0,0,1,0],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pg10:=[[184.46,-160.00,80.46],[-0.026177,0,0.999657,0],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pg20:=[[180.17,-160.00,-1.43],[-0.026177,0,0.999657,0],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pg30:=[[-179.33,-160.00,17.41],[-0.026177,0,0.999657,0],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pg40:=[[-179.33,160.00,17.41],[-0.026177,0,0.999657,0],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pg50:=[[180.17,160.00,-1.43],[-0.026177,0,0.999657,0],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pg60:=[[180.17,-150.00,-1.43],[-0.026177,0,0.999657,0],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pg70:=[[184.46,-150.00,80.46],[-0.026177,0,0.999657,0],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC main()
    MoveAbsJ [[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tGripPane;
    MoveJ pSt1,v1000,z50,tGripPane\WObj:=wStand;
    MoveL pSt2,v200,fine,tGripPane\WObj:=wStand;
    Set doVac;
    WaitTime 0.6;
    GripLoad ldPane;
    MoveL pSt1,v600,z50,tGripPane\WObj:=wStand;
    MoveJ pg10,v800,z20,tStatGun\WObj:=wPane;
    MoveL pg20,v200,fine,tStatGun\WObj:=wPane;
    Set doGlue;
    MoveL pg30,v200,z5,tStatGun\WObj:=wPane;
    MoveL pg40,v200,z5,tStatGun\WObj:=wPane;
    MoveL pg50,v200,z5,tStatGun\WObj:=wPane;
    MoveL pg60,v200,fine,tStatGun\WObj:=wPane;
    Reset doGlue;
    MoveL pg70,v500,z20,tStatGun\WObj:=wPane;
    MoveJ pSt1,v1000,z50,tGripPane\WObj:=wStand;
    MoveL pSt2,v200,fine,tGripPane\WObj:=wStand;
    Reset doVac;
    GripLoad load0;
    MoveL pSt1,v600,z50,tGripPane\WObj:=wStand;
    MoveAbsJ [[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1000,fine,tGripPane;
  ENDPROC
ENDMODULE
