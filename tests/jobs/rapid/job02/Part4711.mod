%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Part4711
  ! Konsole 4711, zwei Kehlnähte
  LOCAL CONST robtarget pAppr:=[[20.02,-0.08,219.72],[0.382651,0.00085,0.923893,-0.000563],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pS1:=[[30.12,20.21,1.94],[0.382129,0.001152,0.924108,-0.000958],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pS2:=[[179.92,22.07,2.58],[0.382003,-0.000546,0.924161,0.000282],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pM1:=[[215.15,35.43,2.18],[0.383386,-0.000786,0.923588,0.000286],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pC1:=[[230.08,70.44,2.34],[0.383283,0.000091,0.923631,0.000627],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pE1:=[[231.22,160.14,1.89],[0.382903,-0.001174,0.923787,0.001063],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pDep:=[[224.92,150.45,139.59],[0.382783,-0.000377,0.923838,-0.00034],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pT1:=[[60.42,239.58,1.93],[0.365785,0.233927,0.897083,-0.081982],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pT2:=[[159.56,243.68,2.25],[0.367113,0.232558,0.897031,-0.080496],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC rWeld4711()
    MoveJ pAppr,v800,z20,tWeldGun\WObj:=wobjStn1;
    ArcLStart pS1,v200,sm1,wd4\Weave:=wv1,fine,tWeldGun\WObj:=wobjStn1;
    ArcL pS2,v100,sm1,wd4\Weave:=wv1,z1,tWeldGun\WObj:=wobjStn1;
    ArcC pM1,pC1,v100,sm1,wd5\Weave:=wv1,z1,tWeldGun\WObj:=wobjStn1;
    ArcLEnd pE1,v100,sm1,wd4\Weave:=wv1,fine,tWeldGun\WObj:=wobjStn1;
    MoveL pDep,v500,z10,tWeldGun\WObj:=wobjStn1;
    MoveJ Offs(pT1,0,0,80),v800,z10,tWeldGun\WObj:=wobjStn1;
    ArcLStart pT1,v200,sm1,wd5,fine,tWeldGun\WObj:=wobjStn1;
    ArcLEnd pT2,v100,sm1,wd5,fine,tWeldGun\WObj:=wobjStn1;
    MoveL Offs(pT2,0,0,80),v500,z10,tWeldGun\WObj:=wobjStn1;
    MoveJ pAppr,v800,z50,tWeldGun\WObj:=wobjStn1;
  ERROR
    ! arc ignition: operator decides
    TPWrite "Weld error, see log";
    Stop;
  ENDPROC
ENDMODULE
