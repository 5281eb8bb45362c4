%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Tank
  PERS tooldata tTorch:=[TRUE,[[70.000,0,360.000],[0.961262,0,-0.275637,0]],[8.00,[20.0,0,120.0],[1,0,0,0],0,0,0]];
  PERS wobjdata wStn1:=[FALSE,FALSE,"STN1",[[1150.000,-50.000,760.000],[1.000000,0,0,0]],[[0,0,0],[1.000000,0,0,0]]];
  PERS wobjdata wTable:=[FALSE,TRUE,"",[[900.000,-700.000,700.000],[1.000000,0,0,0]],[[0,0,0],[1.000000,0,0,0]]];
  PERS seamdata smTank:=[0.4,0.3,[0,0,0,0,0,0,0,0,0],0,0,0,0,0,[0,0,0,0,0,0,0,0,0],0,0,[0,0,0,0,0,0,0,0,0],0,0,[0,0,0,0,0,0,0,0,0],0];
  PERS welddata wdTank:=[8,0,[3,0,0,0,0,0,0,0,0],[0,0,0,0,0,0,0,0,0]];
  CONST robtarget pA:=[[-60.13,-0.28,219.77],[0.382290,0.000992,0.924041,-0.000879],[-1,0,-1,0],[0,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pW1:=[[0.03,-0.24,111.72],[0.382521,0.000417,0.923946,-0.000734],[-1,0,-1,0],[0,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pW2:=[[-0.02,0.31,112.37],[0.382459,-0.000197,0.923972,0.000528],[-1,0,-1,0],[180,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pW3:=[[0.09,0.31,112.05],[0.382906,0.000631,0.923787,-0.000319],[-1,0,-1,0],[365,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC main()
    MoveAbsJ [[0,-20.0000,25.0000,0,60.0000,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v800,fine,tTorch;
    ActUnit STN1;
    MoveJ pA,v800,z20,tTorch\WObj:=wStn1;
    ! circular seam, the table turns
    ArcLStart pW1,v200,smTank,wdTank,fine,tTorch\WObj:=wStn1;
    ArcL pW2,v100,smTank,wdTank,z1,tTorch\WObj:=wStn1;
    ArcLEnd pW3,v100,smTank,wdTank,fine,tTorch\WObj:=wStn1;
    MoveL Offs(pA,0,0,60),v500,z20,tTorch\WObj:=wStn1;
    DeactUnit STN1;
    bracket;
    MoveAbsJ [[0,-20.0000,25.0000,0,60.0000,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v800,fine,tTorch;
  ENDPROC

  PROC bracket()
    MoveJ [[59.78,40.18,160.40],[0.383414,-0.000287,0.923576,-0.000416],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v800,z20,tTorch\WObj:=wTable;
    ArcLStart [[70.33,50.01,1.78],[0.382467,-0.000206,0.923969,0.000487],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v200,smTank,wdTank,fine,tTorch\WObj:=wTable;
    ArcL [[150.34,50.32,2.21],[0.382689,-0.000214,0.923877,-0.000405],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v100,smTank,wdTank,z1,tTorch\WObj:=wTable;
    ArcLEnd [[210.09,58.02,2.30],[0.382960,-0.000184,0.923765,0.000296],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v100,smTank,wdTank,fine,tTorch\WObj:=wTable;
    MoveL [[200.01,49.92,159.68],[0.382881,-0.000700,0.923797,0.000754],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v500,z20,tTorch\WObj:=wTable;
  ENDPROC
ENDMODULE
